"""What a live stream really sends, sorted: samples that count, and samples that are left out, with a reason.

Nothing here raises: a robot that stutters must not stop its identifier.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from armload.arms import Arm
from armload.recording import Sample

REASONS = (
    "wrong size",  # not n numbers
    "not finite",
    "implausible",  # beyond anything this arm can do
    "repeated",  # the time of the sample before
    "late",  # out of order by less than a clock's jump
    "jump",  # joint angles that cannot have been reached since: swapped joints, a glitch of an encoder
)
_SLACK_POSITION = 0.5  # [rad] beyond a joint's limits
_TIMES_VELOCITY, _TIMES_EFFORT = 3.0, 3.0  # beyond a joint's limits
_ANY_VELOCITY, _ANY_EFFORT = 50.0, 1e4  # [rad/s], [N·m] where limits are unknown
_JUMP, _JUMP_TIMES = 0.05, 1.5  # [rad] and, times the largest velocity, what a joint may move between two samples
_BELIEVED = 0.1  # [s] after which an arm that stays where it jumped to is believed
_CLOCK = 1.0  # [s] a time so far back is a clock that was set, not a late sample
_PAUSE = 0.2  # [s] what a jump or a longer pause counts as: the filters start anew


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
        said = [f"{count} {reason}" for reason, count in self.left_out.items() if count]
        said += [f"{self.pauses} pauses"] if self.pauses else []
        said += [f"{self.clock_jumps} clock jumps"] if self.clock_jumps else []
        return f"{self.used} samples" + (f", left out: {', '.join(said)}" if said else "")


class Passed(NamedTuple):
    """A sample that counts, on a clock of its own that always rises; `paused`: the stream was interrupted before it."""

    sample: Sample
    paused: bool


class Gate:
    """Lets through the samples of a stream that can be of this arm.

    Args:
        arm: the arm.
        gap: a longer pause between samples counts as an interruption [s].
    """

    def __init__(self, arm: Arm, gap: float = 0.1) -> None:
        limits, n = arm.limits, arm.n
        self.n, self.gap, self._shape = n, gap, (n,)
        self._low, self._high = limits.position_low - _SLACK_POSITION, limits.position_high + _SLACK_POSITION
        self._velocity = np.where(np.isfinite(limits.velocity), _TIMES_VELOCITY * limits.velocity, _ANY_VELOCITY)
        self._effort = np.where(np.isfinite(limits.effort), _TIMES_EFFORT * limits.effort, _ANY_EFFORT)
        self._fast = np.where(np.isfinite(limits.velocity), _JUMP_TIMES * limits.velocity, _ANY_VELOCITY)
        self.reset()

    def reset(self) -> None:
        """Forget the stream and its counts."""
        self.health = Health()
        self._shift = 0.0  # of the stream's clock against our own
        self._t: float | None = None  # of the last sample, on the stream's clock
        self._q: NDArray | None = None
        self._elsewhere: tuple[float, NDArray] | None = None  # where the arm seems to have jumped to, and since when

    def take(self, t: Any, q: Any, dq: Any, tau: Any) -> Passed | None:
        """A sample as it came; None if it was left out (`health` counts why)."""
        found = self._numbers(t, q, dq, tau)
        if isinstance(found, str):
            return self._leave_out(found)
        now, q, dq, tau = found
        paused = False
        if self._t is not None:
            step = now - self._t
            if step == 0.0:
                return self._leave_out("repeated")
            if -_CLOCK < step < 0.0:
                return self._leave_out("late")
            if step < 0.0:
                self.health.clock_jumps += 1
                self._shift += _PAUSE - step
                step, paused = _PAUSE, True
            assert self._q is not None
            if _beyond(q, self._q, self._fast, step):
                if not self._believed(now, q):
                    self._t = now if paused else self._t
                    return self._leave_out("jump")
                paused = True
                self._shift += max(_PAUSE - step, 0.0)
            elif step > self.gap:
                self.health.pauses += 1
                self._shift -= max(step - _PAUSE, 0.0)  # an arm that was switched off has told nothing meanwhile
                paused = True
        self._elsewhere = None
        self._t, self._q = now, q
        self.health.used += 1
        return Passed(Sample(now + self._shift, q, dq, tau), paused)

    def _numbers(self, t: Any, q: Any, dq: Any, tau: Any) -> tuple[float, NDArray, NDArray, NDArray] | str:
        try:
            now = float(t)
            arrays = [np.array(x, dtype=float) for x in (q, dq, tau)]
        except (TypeError, ValueError, OverflowError):
            return "wrong size"
        q, dq, tau = arrays
        if q.shape != self._shape or dq.shape != self._shape or tau.shape != self._shape:
            return "wrong size"
        verdict = _verdict(now, q, dq, tau, self._low, self._high, self._velocity, self._effort)
        return REASONS[verdict] if verdict else (now, q, dq, tau)

    def _believed(self, t: float, q: NDArray) -> bool:
        """Whether the arm has been where it seems to have jumped to for long enough."""
        since = self._elsewhere
        if since is None or t < since[0] or _beyond(q, since[1], self._fast, t - since[0]):
            self._elsewhere = (t, q)
            return False
        return t - since[0] >= _BELIEVED

    def _leave_out(self, reason: str) -> None:
        self.health.left_out[reason] += 1


@njit(cache=True, nogil=True)
def _verdict(t, q, dq, tau, low, high, velocity, effort):  # pragma: no cover - compiled
    """Index of the reason to leave a sample out; 0: there is none."""
    total = t
    for k in range(q.shape[0]):
        total += q[k] + dq[k] + tau[k]
    if not np.isfinite(total):
        return 1
    if abs(t) > 1e12:
        return 2
    for k in range(q.shape[0]):
        if q[k] < low[k] or q[k] > high[k] or abs(dq[k]) > velocity[k] or abs(tau[k]) > effort[k]:
            return 2
    return 0


@njit(cache=True, nogil=True)
def _beyond(q, before, fast, step):  # pragma: no cover - compiled
    """Whether a joint has moved farther than it can have."""
    for k in range(q.shape[0]):  # noqa: SIM110 - numba knows no any() of a generator
        if abs(q[k] - before[k]) > _JUMP + fast[k] * step:
            return True
    return False
