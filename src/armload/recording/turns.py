"""Joint angles that a robot counts anew after each turn, counted on: a joint that is a full turn on is the same pose.

Robots whose joints turn without end report angles from −π to π, or from 0 to 2π (Kinova's), whatever a joint's own
limits are. Dynamics is periodic in them, but what is learned of an arm from its poses is not, and no joint jumps by a
turn. An arm whose joints all have limits knows where it is: one that seems to be beyond them is another.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.recording.recording import GAP, Recording

TURN = 2.0 * np.pi
# [rad] to which a jump between neighbouring samples is a full turn: at 10 Hz a joint moves by less meanwhile
_MOVED = 1.0
# turns that an angle is off at most at first: degrees taken for radians are off by more, and stay as they are
_MOST = 2


def endless(arm: Arm) -> NDArray[np.bool_]:
    """Which joints (n,) of an arm turn without end."""
    return arm.limits.position_high - arm.limits.position_low > 2.0 * TURN + 1e-6


class Turns:
    """Counts the turns of an arm's joints through the chunks of a log.

    Of an arm with a joint without limits, the first sample of all is taken within each joint's limits, or from −π to π;
    where it cannot be, as it is. After that an angle that jumps by a turn between two samples goes on.

    Args:
        arm: whose log it is.
    """

    def __init__(self, arm: Arm) -> None:
        self._low, self._high = arm.limits.position_low, arm.limits.position_high
        self._endless = endless(arm)
        # of the last sample: time [s], angles as they came, and what was added to each, whole turns
        self._last: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None
        self._counted: list[int] = []  # joints that have had turns added, in this chunk or before

    def of(self, recording: Recording) -> Recording:
        """The next chunk, with full turns added or taken; a note says of which joints in the log so far."""
        q, t = np.asarray(recording.q), recording.t
        if not self._endless.any() or recording.n != len(self._low) or not len(t):
            return recording
        last_t, last_q, so_far = (t[0], q[0], self._first(q[0])) if self._last is None else self._last
        near = (np.diff(t, prepend=last_t) <= GAP)[:, None]
        step = np.diff(q, axis=0, prepend=last_q[None])
        turns = np.rint(step / TURN)
        jumps = near & (np.abs(turns) == 1.0) & (np.abs(step - TURN * turns) < _MOVED)
        added = so_far - np.cumsum(np.where(jumps, TURN * turns, 0.0), axis=0)
        self._last = float(t[-1]), q[-1].copy(), added[-1].copy()
        if not added.any():
            return recording
        self._counted = sorted({*self._counted, *(np.flatnonzero(added.any(axis=0)) + 1).tolist()})
        joints = ", ".join(f"q{j}" for j in self._counted)
        note = f"{recording.source}: full turns were added to {joints}, which are counted anew after each turn"
        return replace(recording, q=q + added, notes=(*recording.notes, note))

    def _first(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is added to the first sample (n,) [rad]."""
        low, high = np.where(self._endless, -np.pi, self._low), np.where(self._endless, np.pi, self._high)
        middle = (low + high) / 2.0
        added = -TURN * np.rint((q - middle) / TURN)
        outside, inside = (q < low) | (q > high), (q + added >= low) & (q + added <= high)
        return np.where(outside & inside & (np.abs(added) < (_MOST + 0.5) * TURN), added, 0.0)
