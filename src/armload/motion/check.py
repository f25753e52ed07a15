"""Whether an arm may run a motion: joint limits, torque with a payload, clearance to the floor and to itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.arms import PAYLOAD_REACH, Arm
from armload.arms.limits import Limits
from armload.arms.units import QUANTITIES, called, heading, marked, unit_of
from armload.errors import MotionError
from armload.inertia import InertialParameters
from armload.motion.collision import PAYLOAD_RADIUS, CapsuleArm, capsule_arm
from armload.motion.motion import Motion

_EQUAL = 1e-9  # [m] clearances that differ by rounding only: the first instant counts
_AT_REST = 1e-3  # share of the velocity or acceleration limit that still counts as starting and ending at rest


@dataclass(frozen=True, eq=False)
class MotionCheck:
    """What a motion leaves of each limit. A negative margin or clearance means the limit is passed.

    arm, motion: their names; joint_names: the joints, in the order of the arrays; duration [s].
    peak: by quantity ("position", "velocity", "acceleration", "jerk", "torque"), the largest magnitude (n,).
    margin: by quantity, what is left to the nearest limit (n,); infinite where the arm has no such limit.
    floor_clearance, self_clearance: smallest distances [m]; `floor_nearest`, `self_nearest` say of what and when.
    problems: one sentence for each limit that is passed, with the joint and the time; empty when the arm may run it.
    slides: which joints (n,) slide along an axis: m and N take the place of rad and N·m.
    """

    arm: str
    motion: str
    joint_names: tuple[str, ...]
    duration: float
    peak: dict[str, NDArray[np.float64]]
    margin: dict[str, NDArray[np.float64]]
    floor_clearance: float
    self_clearance: float
    floor_nearest: str
    self_nearest: str
    problems: list[str]
    slides: NDArray[np.bool_]

    @property
    def ok(self) -> bool:
        """True if no limit is passed and nothing touches."""
        return not self.problems

    def used(self, quantity: str) -> NDArray[np.float64]:
        """Share of the limit that is used (n,), peak / limit; of velocity, acceleration, jerk or torque."""
        return self.peak[quantity] / (self.peak[quantity] + self.margin[quantity])

    def __str__(self) -> str:
        joints = [marked(joint, self.slides, j) for j, joint in enumerate(self.joint_names)]
        width = max(len("joint"), *map(len, joints))
        heads = [heading(what, self.slides) for what in QUANTITIES]
        wide = max(23, *(len(head) + 2 for head in heads))
        lines = [
            f"motion {self.motion} on {self.arm}, {self.duration:g} s: margin to each limit (share of the limit used)",
            f"{'joint':<{width}}" + "".join(f"{head:>{wide}}" for head in heads),
        ]
        for i, joint in enumerate(joints):
            lines.append(f"{joint:<{width}}" + "".join(f"{self._cell(name, i):>{wide}}" for name in QUANTITIES))
        lines.append(_clearance("floor", self.floor_clearance, self.floor_nearest))
        lines.append(_clearance("itself", self.self_clearance, self.self_nearest))
        lines.append("the arm may run it" if self.ok else "the arm must NOT run it:")
        lines += [f"- {problem}" for problem in self.problems]
        return "\n".join(lines)

    def _cell(self, name: str, joint: int) -> str:
        margin = self.margin[name][joint]
        if np.isinf(margin):
            return "no limit"
        return f"{margin:.2f}" if name == "position" else f"{margin:.2f} ({100 * self.used(name)[joint]:.0f} %)"


def check_motion(
    arm: Arm,
    motion: Motion,
    payload: InertialParameters | None = None,
    *,
    payload_radius: float = PAYLOAD_RADIUS,
    floor: float | None = 0.0,
    rate: float = 200.0,
    collision_rate: float = 50.0,
) -> MotionCheck:
    """Check a motion against the arm's limits, the floor and the arm itself, at the instants of `Motion.looked_at`.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> check_motion(arm("panda"), taie2024()).ok
    True

    Args:
        payload: what the arm carries, about its payload frame, for the torque; None: nothing but what is attached.
        payload_radius: radius of the ball kept free around a point 0.1 m beyond the payload frame [m]; 0: no ball.
        floor: height of the floor in the base's frame [m]; None: there is none.
        rate, collision_rate: how often limits and clearances are looked at [Hz].

    Raises:
        MotionError: the motion has another number of joints than the arm; a rate, radius or floor that is none.
    """
    check_joints(motion, arm)
    if not 0.0 <= payload_radius < np.inf:
        raise MotionError(f"the payload's ball has a radius of {payload_radius!r} m: expected a number of 0 or more")
    if floor is not None and not np.isfinite(floor):
        raise MotionError(f"the floor is at {floor!r} m: expected a finite height, or None where there is none")
    t = motion.looked_at(rate)
    q, dq, ddq = motion(t)
    jerk = motion.jerk(t)
    loaded = arm if payload is None else arm.with_payload(payload)
    torque = loaded.torque(q, dq, ddq)

    limits = arm.limits
    values = {"velocity": dq, "acceleration": ddq, "jerk": jerk, "torque": torque}
    allowed = {
        "velocity": limits.velocity_at(q, dq),
        "acceleration": limits.acceleration,
        "jerk": limits.jerk,
        "torque": limits.effort,
    }
    room = np.minimum(q - limits.position_low, limits.position_high - q)
    peak, margin = {"position": np.abs(q).max(axis=0)}, {"position": room.min(axis=0)}
    problems = [
        f"{arm.joint_names[j]} passes its position limit by {-room[k, j]:.3f} {unit_of('position', limits.slides[j])} "
        f"at t = {t[k]:.2f} s ({q[k, j]:.3f} {unit_of('position', limits.slides[j])})"
        for j, k in enumerate(room.argmin(axis=0))
        if room[k, j] < 0
    ]
    for name, value in values.items():
        size, limit = np.abs(value), np.broadcast_to(allowed[name], value.shape)
        units = [unit_of(name, slides) for slides in limits.slides]
        room = limit - size
        peak[name] = size.max(axis=0)
        margin[name] = room.min(axis=0)
        problems += [
            f"{arm.joint_names[j]} passes its {called(name, limits.slides[j])} limit of {limit[k, j]:.4g} {units[j]}"
            f"{_near_end(limits, name, j, limit[k, j], q[k, j])} with {size[k, j]:.4g} {units[j]} at t = {t[k]:.2f} s"
            for j, k in enumerate(room.argmin(axis=0))
            if room[k, j] < 0
        ]
    problems += _jumps(arm, t, dq, ddq)

    model = capsule_arm(arm, payload_radius)
    ticks = motion.instants(collision_rate)
    clearances = nearest(model, motion(ticks)[0], ticks, floor)
    for (distance, what), threat in zip(clearances, ("the floor", "itself"), strict=True):
        if distance <= 0:
            problems.append(f"the arm hits {threat}: {what}, {distance:.3f} m")
    (floor_clearance, floor_nearest), (self_clearance, self_nearest) = clearances
    return MotionCheck(
        arm.name,
        motion.name,
        arm.joint_names,
        motion.duration,
        peak,
        margin,
        floor_clearance,
        self_clearance,
        floor_nearest,
        self_nearest,
        problems,
        limits.slides,
    )


def _near_end(limits: Limits, name: str, joint: int, limit: float, q: float) -> str:
    """Where a limit of velocity is one of the place."""
    if name != "velocity" or limit >= limits.velocity[joint]:
        return ""
    return f" at {q:.4g} {unit_of('position', limits.slides[joint])}, near the end of its range,"


def check_joints(motion: Motion, arm: Arm) -> None:
    """See that a motion is one of the arm's joints.

    Raises:
        MotionError: it moves another number of joints.
    """
    if motion.n != arm.n:
        raise MotionError(
            f"the motion {motion.name!r} moves {motion.n} joints: {arm.name} has {arm.n}; name the arm that it is of, "
            "or another motion"
        )


def rated_load(arm: Arm) -> InertialParameters | None:
    """The maker's rated payload as a solid ball of radius 0.05 m, 0.1 m beyond the payload frame; None: not known."""
    if arm.rated_payload is None:
        return None
    inertia = 0.4 * arm.rated_payload * 0.05**2 * np.eye(3)
    return InertialParameters.from_com(arm.rated_payload, (0.0, 0.0, PAYLOAD_REACH), inertia)


def nearest(
    model: CapsuleArm, q: NDArray[np.float64], t: NDArray[np.float64], floor: float | None
) -> tuple[tuple[float, str], tuple[float, str]]:
    """The smallest distance to the floor, and of the arm to itself, along poses q (N, n): metres; of what and when."""
    clear = model.clearance(q, floor)
    k, m = (int(np.argmax(x <= x.min() + _EQUAL)) for x in (clear.floor, clear.self))
    down = f"{model.names[clear.floor_part[k]]} at t = {t[k]:.2f} s" if np.isfinite(clear.floor[k]) else ""
    pair = ""
    if np.isfinite(clear.self[m]):
        i, j = model.pairs[clear.self_pair[m]]
        pair = f"{model.names[i]} and {model.names[j]} at t = {t[m]:.2f} s"
    return (float(clear.floor[k]), down), (float(clear.self[m]), pair)


def _jumps(arm: Arm, t: NDArray, dq: NDArray, ddq: NDArray) -> list[str]:
    """Where the motion does not start or end at rest: a robot cannot follow a jump of velocity or acceleration."""
    out = []
    speed = np.where(np.isfinite(arm.limits.velocity), arm.limits.velocity, 1.0)
    push = np.where(np.isfinite(arm.limits.acceleration), arm.limits.acceleration, 4.0 * speed)
    for name, value, limit in (("velocity", dq, speed), ("acceleration", ddq, push)):
        for k in (0, -1):
            j = int(np.argmax(np.abs(value[k]) / limit))
            if abs(value[k, j]) > _AT_REST * limit[j]:
                unit = unit_of(name, arm.limits.slides[j])
                out.append(
                    f"{arm.joint_names[j]} has {name} {value[k, j]:.3g} {unit} at t = {t[k]:.2f} s where the arm is at "
                    "rest: use FourierMotion.smooth()"
                )
    return out


def _clearance(what: str, distance: float, nearest: str) -> str:
    return f"clearance to {what}: " + ("not checked" if np.isinf(distance) else f"{distance:.3f} m ({nearest})")
