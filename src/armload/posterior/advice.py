"""What to change where a motion does not determine everything: the bound of the same motion with one joint moved more.

Each joint in turn swings on top of the motion, as far and as fast as its limits leave room; the joint after which the
bound is best is named. It is a derivative of the bound taken in earnest, not a rule of thumb, but it looks at the
information alone: whether the arm may run such a motion is for `check_motion` to say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.arms.units import unit_of
from armload.inertia import NAMES
from armload.motion import Motion
from armload.posterior.cramer_rao import Bound, bound, followed
from armload.recording import Recording
from armload.regression import JointFeatures

_SWING, _FREQUENCY = 0.5, 0.5  # [rad], [Hz] at most
_LEAST_SWING, _LEAST_FREQUENCY = 0.1, 0.1  # [rad], [Hz] less is not worth naming
# [Hz] of the samples, and features of pose and velocity: enough to compare. Of 24 motions that leave something open, 12
# of a Panda and 12 of a UR10e, half or twice the rate names the same joint each time and half or twice the features for
# 23, and what the widths shrink to differs by 0.01 at most (test_the_joint_named_is_that_of_a_finer_comparison)
_RATE, _FEATURES = 50.0, (32, 4)
_LONGEST = 20.0  # [s] of a run that is looked at
_ALIKE = 0.95  # combinations known almost as little as the least are named with it: none of them is special
_PART = 0.3  # of a combination's largest part: smaller parts are not named
_HELPS = 0.9  # of the half-widths that are not small enough: what counts as better


@dataclass(frozen=True, eq=False)
class Advice:
    """The joint that is worth moving more.

    joint: its name; swing, frequency: how much it was moved more [`unit`, Hz].
    missing: parameters that the motion leaves undetermined; gained: those of them that the swing determines.
    weakest: what the motion tells least about, in words: a combination of parameters, or several alike.
    share: its standard deviation over the one before the run.
    shrinks: factor on the half-widths of the missing parameters, geometric mean.
    """

    joint: str
    swing: float
    unit: str
    frequency: float
    missing: tuple[str, ...]
    gained: tuple[str, ...]
    weakest: str
    share: float
    shrinks: float

    def __str__(self) -> str:
        what = (
            f"would determine {', '.join(self.gained)}"
            if self.gained
            else f"would narrow {', '.join(self.missing)} to {self.shrinks:.0%}"
        )
        return (
            f"least is known about {self.weakest} ({self.share:.0%} of the standard deviation is left); of the joints "
            f"with room for it, {self.joint} is most worth moving more: ±{self.swing:.2g} {self.unit} at "
            f"{self.frequency:.2g} Hz on top {what}"
        )


def advise(arm: Arm, run: Recording | Motion, tare: Recording | Motion | None = None) -> Advice | None:
    """Which joint to move more; None if all is determined, or if no joint alone helps.

    Args:
        arm, run, tare: as for `bound`; of a log longer than 20 s the first 20 s count.
    """
    log = _thinned(followed(arm, run, _RATE))
    before = None if tare is None else _thinned(followed(arm, tare, _RATE))
    now = _last(arm, log, before)
    missing = ~now.determined[-1]
    if not missing.any():
        return None
    swings = [(j, *swing) for j in range(arm.n) if (swing := _swing(arm, log, j)) is not None]
    found = {(j, a, f): _last(arm, _swung(log, j, a, f), before) for j, a, f in swings}
    if not found:
        return None

    def shrinks(other: Bound) -> float:
        return float(np.exp(np.mean(np.log(other.std[-1] / now.std[-1])[missing])))

    def gained(other: Bound) -> NDArray[np.bool_]:
        return missing & other.determined[-1]

    best, after = min(found.items(), key=lambda item: (-int(gained(item[1]).sum()), shrinks(item[1])))
    if not gained(after).any() and shrinks(after) > _HELPS:
        return None
    names = np.array(NAMES)
    shares, directions = now.combinations
    return Advice(
        joint=arm.joint_names[best[0]],
        swing=best[1],
        unit=unit_of("position", arm.limits.slides[best[0]]),
        frequency=best[2],
        missing=tuple(names[missing].tolist()),
        gained=tuple(names[gained(after)].tolist()),
        weakest=_in_words(directions[shares > _ALIKE * shares[0]]),
        share=float(shares[0]),
        shrinks=shrinks(after),
    )


def _last(arm: Arm, log: Recording, tare: Recording | None) -> Bound:
    return bound(arm, log, tare=tare, features=JointFeatures(arm.n, *_FEATURES), times=(log.duration,))


def _thinned(log: Recording) -> Recording:
    """The first `_LONGEST` seconds of a log, at `_RATE` at most."""
    log = log.between(log.t[0], log.t[0] + _LONGEST) if log.duration > _LONGEST else log
    tick = np.floor((log.t - log.t[0]) * _RATE + 1e-6)
    return log.select(np.flatnonzero(np.diff(tick, prepend=-1.0) > 0))


def _swing(arm: Arm, log: Recording, joint: int) -> tuple[float, float] | None:
    """Amplitude [rad] and frequency [Hz] that the joint's limits leave room for; None: next to nothing."""
    limits, q, dq = arm.limits, log.q[:, joint], log.dq[:, joint]
    room = min(q.min() - limits.position_low[joint], limits.position_high[joint] - q.max())
    amplitude = min(_SWING, float(room))
    if amplitude < _LEAST_SWING:
        return None
    speed = float(limits.velocity[joint] - np.abs(dq).max())
    frequency = min(_FREQUENCY, speed / (2.0 * np.pi * amplitude))
    return (amplitude, frequency) if frequency >= _LEAST_FREQUENCY else None


def _swung(log: Recording, joint: int, amplitude: float, frequency: float) -> Recording:
    """The log with one joint swinging on top; its torque plays no part."""
    q, dq, angle = log.q.copy(), log.dq.copy(), 2.0 * np.pi * frequency * (log.t - log.t[0])
    q[:, joint] += amplitude * np.sin(angle)
    dq[:, joint] += amplitude * 2.0 * np.pi * frequency * np.cos(angle)
    return Recording(log.t, q, dq, log.tau, source=log.source)


def _in_words(directions: NDArray[np.float64]) -> str:
    """Directions (K, 10) in units of the prior's standard deviations: one by its largest parts, several by their span.

    >>> _in_words(np.array([[0, 0, 0, 0.8, 0, 0, 0, -0.6, 0, 0.02]]))
    'm·rz − 0.75 Iyy'
    >>> _in_words(np.eye(10)[:3])
    'm, m·rx, m·ry'
    """
    if len(directions) > 1:  # any basis of their span would do: name the parameters that lie in it
        inside = np.linalg.norm(directions, axis=0)
        return ", ".join(name for name, size in zip(NAMES, inside, strict=True) if size > _PART)
    parts = directions[0] / directions[0][np.abs(directions[0]).argmax()]
    out = ""
    for k in [k for k in np.argsort(-np.abs(parts), kind="stable")[:3] if abs(parts[k]) > _PART]:
        sign = "" if not out else " + " if parts[k] > 0 else " − "
        out += sign + ("" if not out else f"{abs(parts[k]):.2g} ") + NAMES[k]
    return out
