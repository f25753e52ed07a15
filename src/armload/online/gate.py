"""What a live stream really sends, sorted: samples that count, and samples that are left out, with a reason.

Nothing here raises: a robot that stutters must not stop its identifier.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.arms.units import unit_of
from armload.identification.thresholds import DEGREES_FROM, EFFORT
from armload.recording import GAP, TURN, Sample, endless
from armload.runtime.kernels import kernel

REASONS = (
    "wrong size",  # not n numbers
    "not finite",
    "implausible",  # beyond anything this arm can do
    "repeated",  # the time of the sample before
    "late",  # out of order by less than a clock's jump
    "jump",  # joint angles that cannot have been reached since: swapped joints, a glitch of an encoder
)
_IN_GENERAL = {
    "implausible": "beyond anything this arm can do",
    "repeated": "the time of the samples does not change",
    "late": "the times of the samples do not rise",
    "jump": "joint angles cannot have been reached since the sample before; check the order of the joints",
}
_PARTS = ("position", "velocity", "torque")
_NOTHING, _NOT_FINITE, _IMPLAUSIBLE, _REPEATED, _LATE, _JUMPED = range(6)  # into them; sizes are looked at before
# A stream cannot be mended and sent again: only what no arm can do is left out, wider than `identification.thresholds`
_SLACK_POSITION = 0.5  # [rad] beyond a joint's limits
_TIMES_VELOCITY = 3.0  # times a joint's limit: a single sample may be a spike of a differentiated encoder
_ANY_VELOCITY, _ANY_EFFORT = 50.0, 1e4  # [rad/s], [N·m] where limits are unknown: ten times the catalogue's and more
# times what a joint without a limit is taken to be built for, if that is more: makers' limits are up to 5.6 times that
# (`arms.strength`), and `EFFORT` times one may be seen (test_a_strong_arm_without_limits_has_its_samples_listened_to)
_TIMES_EFFORT = 20.0
# [rad] and, times the largest velocity, what a joint may move between two samples: stamps jitter by milliseconds
# (test_swapped_joints_are_left_out). Compiled code holds most of these: change them in this file
_JUMP, _JUMP_TIMES = 0.05, 1.5
# [s] after which an arm that stays where it jumped to is believed: longer than a glitch of an encoder
# (test_an_arm_that_is_elsewhere_after_a_pause_is_believed)
_BELIEVED = 0.1
# [s] a time so far back is a clock that was set, not a late sample
# (test_a_clock_that_is_set_anew_costs_nothing_but_a_pause)
_CLOCK = 1.0
_PAUSE = 2.0 * GAP  # [s] what a jump or a longer pause counts as: more than a gap, so the filters start anew
ANY_TIME = 1e12  # [s] no clock shows more: 30 000 years


@dataclass
class Health:
    """Counts of a stream: samples that counted, samples left out by reason, pauses and clocks that jumped."""

    used: int = 0
    left_out: dict[str, int] = field(default_factory=lambda: dict.fromkeys(REASONS, 0))
    pauses: int = 0
    clock_jumps: int = 0

    @property
    def bad(self) -> int:
        """Samples left out."""
        return sum(self.left_out.values())

    def __str__(self) -> str:
        left_out = ", ".join(f"{count} {reason}" for reason, count in self.left_out.items() if count)
        parts = [f"{self.used} samples" + (f", left out: {left_out}" if left_out else "")]
        parts += [f"{self.pauses} pause{'s' * (self.pauses > 1)}"] if self.pauses else []
        parts += [f"{self.clock_jumps} clock jump{'s' * (self.clock_jumps > 1)}"] if self.clock_jumps else []
        return "; ".join(parts)


class Gate:
    """Lets through the samples of a stream that can be of this arm.

    Args:
        arm: the arm.

    Attributes:
        health: counts of the stream. reason: why the last sample that was left out was. now: time of the last sample of
            all [s], NaN if it had none. shift: what our own clock, without pauses, is ahead of the stream's [s].
    """

    def __init__(self, arm: Arm) -> None:
        limits, self.n = arm.limits, arm.n
        known, bounded = np.isfinite(limits.velocity), np.isfinite(limits.effort)
        # in one array, as each array that is handed to compiled code costs as much as the comparisons with it
        self._limits = np.array(
            [
                limits.position_low - _SLACK_POSITION,
                limits.position_high + _SLACK_POSITION,
                np.where(known, _TIMES_VELOCITY * limits.velocity, _ANY_VELOCITY),
                np.where(bounded, EFFORT * limits.effort, np.maximum(_ANY_EFFORT, _TIMES_EFFORT * rated_effort(arm))),
                np.where(known, _JUMP_TIMES * limits.velocity, _ANY_VELOCITY),
            ]
        )
        self._slides = limits.slides
        self._endless = np.flatnonzero(endless(arm))
        self.reset()

    def reset(self) -> None:
        """Forget the stream and its counts."""
        self.health = Health()
        self.reason, self.now, self.shift = REASONS[0], math.nan, 0.0
        self._t, self._q = np.nan, np.zeros(self.n)  # of the last sample, on the stream's clock; NaN: there is none
        self._elsewhere: tuple[float, NDArray] | None = None  # where the arm seems to have jumped to, and since when

    def take(self, t: Any, q: Any, dq: Any, tau: Any) -> Sample | None:
        """A sample as it came, on a clock of its own that always rises; None if left out (`health` counts why)."""
        self.now = math.nan
        try:
            now = self.now = float(t)
            q, dq, tau = np.array(q, float), np.array(dq, float), np.array(tau, float)  # copies: buffers are used again
        except Exception:  # an array of another library raises what it likes
            return self._leave_out("wrong size")
        if not q.shape == dq.shape == tau.shape == (self.n,):
            return self._leave_out("wrong size")
        if len(self._endless):  # some robots count them anew after each turn
            near = self._q[self._endless]  # zero at first
            with np.errstate(invalid="ignore"):  # what is not finite is left out below
                q[self._endless] -= TURN * np.rint((q[self._endless] - near) / TURN)
        found = _look(now, q, dq, tau, self._limits, self._t, self._q)
        if _NOTHING < found < _JUMPED:
            return self._leave_out(REASONS[found])
        step = now - self._t
        if step < 0.0:  # far enough not to be late: the clock was set back
            self.health.clock_jumps += 1
            self.shift += _PAUSE - step
            self._t, step = now, _PAUSE
        if found == _JUMPED:
            if not self._believed(now, q):
                return self._leave_out("jump")
            self.shift += max(_PAUSE - step, 0.0)
        elif step > GAP:
            self.health.pauses += 1
            self.shift -= max(step - _PAUSE, 0.0)  # an arm that was switched off gave no information meanwhile
        self._elsewhere = None
        self._t, self._q = now, q
        self.health.used += 1
        return Sample(now + self.shift, q, dq, tau)

    def _believed(self, t: float, q: NDArray) -> bool:
        """Whether the arm has been where it seems to have jumped to for long enough."""
        since = self._elsewhere
        if since is None or t < since[0] or _beyond(q, since[1], self._limits, t - since[0]):
            self._elsewhere = (t, q)
            return False
        return t - since[0] >= _BELIEVED

    def _leave_out(self, reason: str) -> None:
        self.reason = reason
        self.health.left_out[reason] += 1

    def why(self, reason: str, t: Any, q: Any, dq: Any, tau: Any) -> str:
        """In words why a sample is left out, if it shows the reason itself; the reason in general elsewhere."""
        try:
            now, parts = float(t), [np.array(x, float) for x in (q, dq, tau)]
        except Exception:
            return f"expected a time and three times {self.n} numbers"
        for what, x in zip(_PARTS, parts, strict=True):
            if x.shape != (self.n,):
                return f"expected {self.n} joints, found {what} of shape {x.shape}"
        low, high, velocity, effort, _ = self._limits
        if reason == "not finite":
            for what, x in [*zip(_PARTS, parts, strict=True)][::-1]:
                for k in np.flatnonzero(~np.isfinite(x)):
                    return f"{what} of joint {k + 1} is {'not a number' if np.isnan(x[k]) else 'infinite'}"
            if not math.isfinite(now):
                return "the time is not a number"
        elif reason == "implausible":
            if abs(now) > ANY_TIME:
                return f"the time is {now:.3g} s"
            for k in np.flatnonzero((parts[0] < low) | (parts[0] > high)):
                slides, far = self._slides[k], np.abs(parts[0]).max() > DEGREES_FROM
                degrees, unit = "; is it in degrees?" if far and not slides else "", unit_of("position", slides)
                return f"position of joint {k + 1} is {parts[0][k]:.4g} {unit}, beyond its limits{degrees}"
            for what, x, most in zip(_PARTS[1:], parts[1:], (velocity, effort), strict=True):
                for k in np.flatnonzero(np.abs(x) > most):
                    unit = unit_of(what, self._slides[k])
                    return f"{what} of joint {k + 1} is {x[k]:.4g} {unit}, beyond anything it can do"
        return _IN_GENERAL.get(reason, reason)


@kernel
def all_finite(values):  # pragma: no cover - compiled
    """Whether each of a few numbers (k,) is finite: what numpy takes 2 µs for."""
    for value in values:  # noqa: SIM110 - numba knows no all() of a generator
        if not np.isfinite(value):
            return False
    return True


@kernel
def _beyond(q, before, limits, step):  # pragma: no cover - compiled
    """Whether a joint has moved farther than it can have."""
    for k in range(q.shape[0]):  # noqa: SIM110 - numba knows no any() of a generator
        if abs(q[k] - before[k]) > _JUMP + limits[4, k] * step:
            return True
    return False


@kernel
def _look(t, q, dq, tau, limits, last, before):  # pragma: no cover - compiled
    """Why a sample at t cannot come after the one with q = before at `last` (NaN: there is none); into REASONS."""
    total = t
    for k in range(q.shape[0]):
        total += q[k] + dq[k] + tau[k]
    if not np.isfinite(total):
        return _NOT_FINITE
    if abs(t) > ANY_TIME:
        return _IMPLAUSIBLE
    for k in range(q.shape[0]):
        low, high, velocity, effort = limits[0, k], limits[1, k], limits[2, k], limits[3, k]
        if q[k] < low or q[k] > high or abs(dq[k]) > velocity or abs(tau[k]) > effort:
            return _IMPLAUSIBLE
    step = t - last
    if step == 0.0:
        return _REPEATED
    if -_CLOCK < step < 0.0:
        return _LATE
    if step < 0.0:
        step = _PAUSE
    return _JUMPED if _beyond(q, before, limits, step) else _NOTHING
