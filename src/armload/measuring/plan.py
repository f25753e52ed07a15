"""What will move, how far, how fast and for how long: said, and checked, before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.arms.units import heading, marked, unit_of
from armload.devices.mover import AT_START
from armload.errors import SafetyError
from armload.excitation import Obstacle, PayloadRange, Surroundings
from armload.inertia import InertialParameters
from armload.motion import Motion, MotionCheck, StraightMotion, check_motion, rated_load

# [rad] a joint may be from where the motion begins, unless more is allowed: further should be seen first
APPROACH = 1.0
SHARES = (0.2, 0.1, 0.05)  # of the limits of velocity, acceleration and jerk that a straight way uses, fastest first
_SAMPLES = 1000.0  # [Hz] at which a plan is checked, as fast as the fastest controller takes commands
_CLEARANCES = 100.0  # [Hz] at which clearances are: at 2 m/s the tool goes 2 cm in between
_SHOWN = (("position", "from"), ("position", "to"), ("velocity", "fastest"))  # columns of a plan
_TOO_MANY = 100_000  # samples of a check


@dataclass(frozen=True)
class Room:
    """What movements have to keep clear of, and how far the arm may be from where they begin.

    Args:
        floor: height of the floor in the base's frame [m]; None: there is none.
        boxes: what stands around; the arm, and a ball of 0.15 m around the payload, must not touch them.
        approach: how far a joint may be from the motion's start [rad].
    """

    floor: float | None = 0.0
    boxes: Sequence[Obstacle] = ()
    approach: float = APPROACH


@dataclass(frozen=True, eq=False)
class Leg:
    """One movement: what it is for, the motion, what the check of it found, and how near it comes to a box [m]."""

    purpose: str
    motion: Motion
    check: MotionCheck
    box_clearance: float = np.inf


@dataclass(frozen=True, eq=False)
class Plan:
    """All movements of a measurement, in their order.

    arm: whose. legs: in order. tool: corners (2, 3) of the box, in the base's frame, in which the payload frame stays
    [m]; speed: the fastest it moves [m/s].
    """

    arm: Arm
    legs: tuple[Leg, ...]
    tool: NDArray[np.float64]
    speed: float

    def leg(self, purpose: str) -> Leg | None:
        """The movement for a purpose; None: it is not needed."""
        return next((leg for leg in self.legs if leg.purpose == purpose), None)

    @property
    def duration(self) -> float:
        """Of all movements [s]."""
        return sum(leg.motion.duration for leg in self.legs)

    def check(self, so_far: str = "nothing was moved") -> None:
        """See that the arm may make all movements.

        Args:
            so_far: what to say of the arm if it may not.

        Raises:
            SafetyError: a limit is passed, or something touches; the message says which.
        """
        for leg in self.legs:
            if leg.check.problems:
                raise SafetyError(
                    f"{so_far}, because of the way {leg.purpose}: {'; '.join(leg.check.problems)}; choose "
                    "another motion, or move the arm to another place"
                )

    def __str__(self) -> str:
        slides = self.arm.limits.slides
        lines = [f"{self.arm.name} will move for {self.duration:.1f} s:"]
        for k, leg in enumerate(self.legs, start=1):
            q = leg.motion.position(leg.motion.instants(100.0))
            far = np.ptp(q, axis=0)
            j = int(np.argmax(far))
            lines.append(
                f"{k}. {leg.purpose}: {leg.motion.name}, {leg.motion.duration:.1f} s, at most {far[j]:.2f} "
                f"{unit_of('position', slides[j])} ({self.arm.joint_names[j]})"
            )
        joints = [marked(joint, slides, j) for j, joint in enumerate(self.arm.joint_names)]
        width = max(len("joint"), *map(len, joints))
        where, to, fast = (heading(what, slides, name) for what, name in _SHOWN)
        wide, wider = (max(least, len(head) + 2) for least, head in ((12, where), (17, fast)))
        lines.append(f"{'joint':<{width}}{where:>{wide}}{to:>{wide}}{fast:>{wider}}{'of its limit':>14}")
        q = np.concatenate([leg.motion.position(leg.motion.instants(200.0)) for leg in self.legs])
        fastest = np.max([leg.check.peak["velocity"] for leg in self.legs], axis=0)
        limit = self.arm.limits.velocity
        for j, joint in enumerate(joints):
            share = f"{100 * fastest[j] / limit[j]:.0f} %" if np.isfinite(limit[j]) else "no limit"
            low, high = q[:, j].min(), q[:, j].max()
            lines.append(f"{joint:<{width}}{low:>{wide}.2f}{high:>{wide}.2f}{fastest[j]:>{wider}.2f}{share:>14}")
        low, high = self.tool
        box = ", ".join(f"{a} from {x:.2f} to {y:.2f}" for a, x, y in zip("xyz", low, high, strict=True))
        lines.append(f"{self.arm.frame} stays within {box} m of the base, at most {self.speed:.2f} m/s")
        for what in ("floor", "self"):
            distance = min(getattr(leg.check, f"{what}_clearance") for leg in self.legs)
            if np.isfinite(distance):
                lines.append(f"nearest to {'itself' if what == 'self' else 'the floor'}: {distance:.3f} m")
        to_box = min(leg.box_clearance for leg in self.legs)
        if np.isfinite(to_box):
            lines.append(f"nearest to a box: {to_box:.3f} m")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """The same as JSON."""
        return {
            "robot": self.arm.name,
            "duration": self.duration,
            "movements": [
                {"purpose": leg.purpose, "motion": leg.motion.name, "duration": leg.motion.duration}
                for leg in self.legs
            ],
            "tool_box": self.tool.tolist(),
            "tool_speed": self.speed,
            "box_clearance": distance if np.isfinite(distance := min(leg.box_clearance for leg in self.legs)) else None,
            "problems": [problem for leg in self.legs for problem in leg.check.problems],
        }


TO_START, EMPTY, BACK, LOADED = "to the start", "without the payload", "back to the start", "with the payload"


def plan_of(
    arm: Arm,
    motion: Motion,
    at: ArrayLike,
    *,
    empty_run: bool = True,
    empty_motion: Motion | None = None,
    room: Room | None = None,
    heaviest: float | None = None,
) -> Plan:
    """The movements of a measurement by an arm that stands.

    Args:
        arm: bare, or with the tool that is mounted in all runs.
        motion: from rest to rest.
        at: where the arm is commanded to be (n,) [rad].
        empty_run: whether the motion is run without the payload first.
        empty_motion: what is run then; None: the same motion.
        room: what they keep clear of; None: the floor at the base's height alone.
        heaviest: the payload that each movement is checked with [kg]; None: the rated one.

    Raises:
        SafetyError: the arm is farther from the start than `Room.approach`.
        MotionError: the motion is of another arm.
    """
    here, legs = np.asarray(at, dtype=float), []
    room = room or Room()
    check = _Check(arm, room, heaviest)

    def add(purpose: str, way: Motion) -> None:
        nonlocal here
        start = way.position([0.0])[0]
        away = np.abs(start - here)
        if np.max(away) > AT_START:
            j = int(np.argmax(away))
            if away[j] > room.approach:
                unit = unit_of("position", arm.limits.slides[j])
                raise SafetyError(
                    f"{arm.joint_names[j]} is {away[j]:.2f} {unit} from where {way.name} begins, more than the "
                    f"{room.approach:g} {unit} of --approach: move the arm nearer to {np.round(start, 2).tolist()}, "
                    "or allow more"
                )
            legs.append(_way(check, here, start, TO_START if not legs else BACK))
        legs.append(check(purpose, way))
        here = way.position([way.duration])[0]

    if empty_run:
        add(EMPTY, empty_motion or motion)
    add(LOADED, motion)
    points = [arm.frame_pose(leg.motion.position(leg.motion.instants(100.0)))[1] for leg in legs]
    steps = [np.linalg.norm(np.diff(p, axis=0), axis=1).max() * (len(p) - 1) / leg.motion.duration
             for p, leg in zip(points, legs, strict=True)]  # fmt: skip
    every = np.concatenate(points)
    return Plan(arm, tuple(legs), np.stack([every.min(axis=0), every.max(axis=0)]), float(max(steps)))


class _Check:
    """Makes legs of motions: checks each of them, in one room and with one payload."""

    def __init__(self, arm: Arm, room: Room, heaviest: float | None) -> None:
        self.arm, self._floor = arm, room.floor
        self._load: InertialParameters | None = rated_load(arm)
        if heaviest is not None:
            self._load = PayloadRange(heaviest).payload(1.0, np.zeros(3))
        self._around = Surroundings(arm, None, tuple(room.boxes)) if room.boxes else None

    def __call__(self, purpose: str, motion: Motion) -> Leg:
        rate = min(_SAMPLES, _TOO_MANY / motion.duration)
        seldom = min(rate, _CLEARANCES)
        found = check_motion(self.arm, motion, self._load, floor=self._floor, rate=rate, collision_rate=seldom)
        if self._around is None:
            return Leg(purpose, motion, found)
        t = motion.instants(seldom)
        q = motion.position(t)
        distance = self._around.clearance(q)[:, 2]
        k = int(distance.argmin())
        if distance[k] <= 0.0:
            what = f"{self._around.nearest(q[k : k + 1], 2)} at t = {t[k]:.2f} s, {distance[k]:.3f} m"
            found = replace(found, problems=[*found.problems, f"the arm hits a box: {what}"])
        return Leg(purpose, motion, found, float(distance[k]))


def _way(check: _Check, here: NDArray[np.float64], there: NDArray[np.float64], purpose: str) -> Leg:
    """The straight way between two poses, slower where the arm is not strong enough for it with its payload."""
    for share in SHARES:
        leg = check(purpose, StraightMotion.slow(check.arm, here, there, share, "a straight line in joint space"))
        if not leg.check.problems:
            break
    return leg
