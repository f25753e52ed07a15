"""How long a stream has said nothing that could be used, and why: an old answer must not look like a new one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.online.gate import ANY_TIME, REASONS, Gate
from armload.online.thresholds import BAD_IN_A_ROW, MOVING, PAUSES_IN_A_ROW, RECENT, SILENT
from armload.recording import GAP, Sample

UNUSED = "no sample could be used"  # how `trouble` begins while samples are left out one after the other


class Listening:
    """The clock of a stream, whose samples may be bad.

    Attributes:
        gate: which samples count. clock: time of the last sample [s], also of one that was left out if it rises.
        ahead: for how long no sample could be used [s]. unseen: pauses since `forget_pauses`, as far as the gate's
            own clock leaves them out [s].
        trouble: what keeps samples from being used; None while nothing does.
        now: time of the last sample that counts, on the gate's clock [s].
    """

    def __init__(self, arm: Arm) -> None:
        self.gate = Gate(arm)
        self.reset()

    def reset(self) -> None:
        """Forget the stream."""
        self.gate.reset()
        self.clock = self.ahead = self.unseen = 0.0
        self.trouble: str | None = None
        self._used: float | None = None  # time of the last sample that could be used, or of the first of all
        self._shift = self.now = 0.0
        self._moved = -math.inf  # when the arm was last seen to move, on the same clock [s]
        self._apart = self._number = 0  # pauses and bad samples in a row

    def take(self, t: Any, q: Any, dq: Any, tau: Any) -> Sample | None:
        """A sample as it came, as `Gate.take` lets it through; None: it is left out."""
        pauses = self.gate.health.pauses
        sample = self.gate.take(t, q, dq, tau)
        if sample is None:
            self._left_out(self.gate.now, t, q, dq, tau)
        else:
            self._use(self.gate.now, self.gate.health.pauses > pauses)
            self.now = sample.t
            if sample.t - self._moved > 0.1 * RECENT and np.abs(sample.dq).max() > MOVING:
                self._moved = sample.t
        return sample

    @property
    def moving(self) -> bool:
        """Whether the arm was seen to move lately."""
        return self.now + self.ahead - self._moved < RECENT

    def _use(self, t: float, paused: bool) -> None:
        self.unseen += max(self._shift - self.gate.shift, 0.0)
        self._shift = self.gate.shift
        if paused or self._apart or self._number:
            self._apart = self._apart + 1 if paused else 0
            self._number, self.trouble = 0, None
            if self._apart >= PAUSES_IN_A_ROW and self._used is not None:
                self.trouble = (
                    f"samples come {t - self._used:.3g} s apart: those farther apart than {GAP:g} s tell nothing; "
                    "are their times in seconds?"
                )
        self._used = self.clock = t
        self.ahead = 0.0

    def _left_out(self, now: float, t: Any, q: Any, dq: Any, tau: Any) -> None:
        """The time of a sample that was left out, if it has one, goes on all the same."""
        if abs(now) < ANY_TIME:
            if self._used is None:
                self._used = now
            if now > self._used:
                self.ahead = now - self._used
            self.clock = self._used + self.ahead
        if self._number == 0:
            self._bad: dict[str, int] = dict.fromkeys(REASONS, 0)  # of those in a row
            self._reported = 0  # tenths of a second of them
        self._number += 1
        self._bad[self.gate.reason] += 1
        tenths = int(self.ahead / SILENT)
        if tenths > self._reported or self._number % BAD_IN_A_ROW == 0:
            self._reported = tenths
            since = f" for {self.ahead:.1f} s" if tenths else ""
            most = max(REASONS, key=lambda reason: self._bad[reason])
            why = self.gate.why(most, t, q, dq, tau)
            self.trouble = f"{UNUSED}{since} ({self._number} left out): {why}"

    def forget_pauses(self) -> None:
        """The answer rests on samples after them."""
        self.unseen = 0.0
