"""Whether a motion keeps to its constraints: looked at sample by sample at 1 kHz, by code the design does not use.

The samples are the positions of the motion, as a robot gets them. Velocity, acceleration and jerk are difference
quotients of them, torque is Pinocchio's recursive Newton–Euler plus the payload's regressor at every corner of the
payload range, clearances are coal's distances, the tool's speed the difference quotient of its place. The design
itself knows splines, the momentum form and penalties instead (`penalty.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.arms import payload_regressor
from armload.arms.units import called, unit_of
from armload.excitation.constraints import Constraints
from armload.motion import Motion

RATE = 1000.0  # [Hz]
_EXACT = 1e-9  # of a limit, or [rad]: rounding
# of the largest velocity and acceleration allowed, what difference quotients over 1 ms may show at rest: a motion whose
# jerk sets in at its limit shows half a millisecond of it
_AT_REST = 1e-3


@dataclass(frozen=True)
class Used:
    """How much of one limit a motion uses.

    what: the quantity; joint: its name, "" for the tool and clearances; share: used over allowed, above 1 where the
    limit is passed; time: when [s]; text: a sentence.
    """

    what: str
    joint: str
    share: float
    time: float
    text: str


def used(constraints: Constraints, motion: Motion, rate: float = RATE) -> list[Used]:
    """How much a motion uses of each limit, the most first; it may be run where no share is above 1."""
    arm = constraints.arm
    steps = max(4, int(np.ceil(motion.duration * rate)))
    t = np.linspace(0.0, motion.duration, steps + 1)
    h = float(t[1])
    q = motion(t)[0]
    dq, ddq, jerk = (np.diff(q, k, axis=0) / h**k for k in (1, 2, 3))
    out = [*_positions(constraints, t, q)]
    fastest = constraints.fastest((q[1:] + q[:-1]) / 2.0, dq)
    for name, x, most in (
        ("velocity", dq, np.maximum(fastest, _EXACT)),
        ("acceleration", ddq, constraints.most["acceleration"]),
        ("jerk", jerk, constraints.most["jerk"]),
    ):
        out += _joints(constraints, name, t, x, most)
    rates = np.gradient(q, h, axis=0)
    rates[[0, -1]] = 0.0
    pushes = np.concatenate([ddq[:1], ddq, ddq[-1:]])
    Y = payload_regressor(arm.frame_motion(q), rates, pushes)  # (N, n, 10)
    torque = arm.torque(q, rates, pushes)[:, :, None] + Y @ constraints.corners.T
    out += _joints(constraints, "torque", t, np.abs(torque).max(axis=2), constraints.most["torque"])
    place = arm.frame_pose(q)[1]
    speed = np.linalg.norm(np.diff(place, axis=0), axis=1) / h
    k = int(speed.argmax())
    text = f"the tool moves at {speed[k]:.3g} m/s at t = {t[k]:.2f} s, {constraints.speed:.3g} m/s are allowed"
    out.append(Used("tool speed", "", float(speed[k] / constraints.speed), float(t[k]), text))
    out += _clearances(constraints, t, q)
    out.append(_rest(constraints, t, q, h))
    return sorted(out, key=lambda one: -one.share)


def problems(constraints: Constraints, motion: Motion) -> list[str]:
    """One sentence for each limit that a motion passes."""
    return [one.text for one in used(constraints, motion) if one.share > 1.0 + _EXACT]


def _positions(constraints: Constraints, t: NDArray, q: NDArray) -> list[Used]:
    out, start = [], constraints.start
    slides = constraints.arm.limits.slides
    for j, name in enumerate(constraints.arm.joint_names):
        unit = unit_of("position", slides[j])
        below, above = start[j] - constraints.low[j], constraints.high[j] - start[j]
        over = np.maximum(
            (q[:, j] - start[j]) / max(above, _EXACT),
            (start[j] - q[:, j]) / max(below, _EXACT),
        )
        k = int(over.argmax())
        text = (
            f"{name} goes to {q[k, j]:.4g} {unit} at t = {t[k]:.2f} s, {constraints.low[j]:.4g} to "
            f"{constraints.high[j]:.4g} {unit} are allowed"
        )
        share = float(over[k]) if abs(q[k, j] - start[j]) > _EXACT else 0.0
        out.append(Used("position", name, share, float(t[k]), text))
    return out


def _joints(constraints: Constraints, what: str, t: NDArray, x: NDArray, most: NDArray) -> list[Used]:
    """most: what is allowed of x (N, n), (n,) or at each sample (N, n)."""
    out, whose, slides = [], constraints.whose(what), constraints.arm.limits.slides
    most = np.broadcast_to(most, x.shape)
    shares = np.abs(x) / most
    for j, name in enumerate(constraints.arm.joint_names):
        k = int(shares[:, j].argmax())
        size, unit = abs(float(x[k, j])), unit_of(what, slides[j])
        text = (
            f"{name} has {called(what, slides[j])} {size:.4g} {unit} at t = {t[k]:.2f} s, "
            f"{most[k, j]:.4g} {unit} are allowed ({constraints.share:g} of {whose[j]})"
        )
        out.append(Used(what, name, float(shares[k, j]), float(t[k]), text))
    return out


def _clearances(constraints: Constraints, t: NDArray, q: NDArray) -> list[Used]:
    around = constraints.around
    found, kept = around.clearance(q), around.kept(constraints.start)
    room = around.clearance(constraints.start[None])[0] - kept
    out = []
    for kind, what in enumerate(("the floor", "the arm itself", "the boxes")):
        if not np.isfinite(kept[kind]) or not np.isfinite(found[:, kind]).all():
            continue
        k = int(found[:, kind].argmin())
        share = 1.0 + float(kept[kind] - found[k, kind]) / max(float(room[kind]), _EXACT)
        text = (
            f"the clearance to {what} is {found[k, kind]:.3f} m at t = {t[k]:.2f} s "
            f"({around.nearest(q[k : k + 1], kind)}), {kept[kind]:.3f} m are kept"
        )
        out.append(Used("clearance", "", max(share, 0.0), float(t[k]), text))
    return out


def _rest(constraints: Constraints, t: NDArray, q: NDArray, h: float) -> Used:
    """At rest at both ends, and at the start pose."""
    speed = np.abs(q[[1, -1]] - q[[0, -2]]) / h / constraints.most["velocity"]
    off = max(float(np.abs(q[0] - constraints.start).max()), float(np.abs(q[-1] - constraints.start).max()))
    share = max(float(speed.max()) / _AT_REST, off / _EXACT)
    text = "the motion does not start and end at rest at its start pose"
    return Used("rest", "", share if share > 1.0 else 0.0, float(t[0]), text)
