"""How long a stream has said nothing that could be used, and why: an old answer must not look like a new one."""

from __future__ import annotations

import math
from typing import Any

from armload.online.gate import ANY_TIME, REASONS, Gate
from armload.online.thresholds import BAD_IN_A_ROW, PAUSES_IN_A_ROW, SILENT

UNUSED = "no sample could be used"  # how `trouble` begins while samples are left out one after the other


class Listening:
    """The clock of a stream, whose samples may be bad.

    Attributes:
        clock: time of the last sample [s], also of one that was left out if it rises.
        ahead: for how long no sample could be used [s]. unseen: pauses since `forget_pauses`, as far as the gate's
            own clock leaves them out [s].
        trouble: what keeps samples from being used; None while nothing does.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the stream."""
        self.clock = self.ahead = self.unseen = 0.0
        self.trouble: str | None = None
        self._used: float | None = None  # time of the last sample that could be used, or of the first of all
        self._shift = 0.0
        self._pauses, self._apart = 0, 0  # pauses so far; in a row
        self._number, self._reported = 0, 0  # bad samples in a row; tenths of a second of them that were reported
        self._before: tuple[int, ...] = ()  # counts of each reason before these

    def used(self, gate: Gate, t: float) -> None:
        """The gate let a sample through."""
        if gate.shift != self._shift:
            self.unseen += max(self._shift - gate.shift, 0.0)
            self._shift = gate.shift
        if gate.health.pauses > self._pauses:
            self._pauses, self._apart = gate.health.pauses, self._apart + 1
            self._number, self.trouble = 0, None
            if self._apart >= PAUSES_IN_A_ROW and self._used is not None:
                self.trouble = (
                    f"samples come {t - self._used:.3g} s apart: those farther apart than {gate.gap:g} s tell nothing; "
                    "are their times in seconds?"
                )
        elif self._apart or self._number:
            self._apart, self._number, self.trouble = 0, 0, None
        self._used = self.clock = t
        self.ahead = 0.0

    def left_out(self, gate: Gate, t: Any, q: Any, dq: Any, tau: Any) -> None:
        """The gate left a sample out: its time, if it has one, goes on all the same."""
        try:
            now = float(t)
        except Exception:  # an array of another library raises what it likes
            now = math.nan
        if abs(now) < ANY_TIME:
            if self._used is None:
                self._used = now
            if now > self._used:
                self.ahead = now - self._used
            self.clock = self._used + self.ahead
        counts = tuple(gate.health.left_out.values())
        if self._number == 0:
            own = REASONS.index(gate.reason)
            self._before, self._reported = tuple(c - (k == own) for k, c in enumerate(counts)), 0
        self._number += 1
        tenths = int(self.ahead / SILENT)
        if tenths > self._reported or self._number % BAD_IN_A_ROW == 0:
            self._reported = tenths
            most = max(range(len(REASONS)), key=lambda k: counts[k] - self._before[k])
            since = f" for {self.ahead:.1f} s" if tenths else ""
            why = gate.why(REASONS[most], t, q, dq, tau)
            self.trouble = f"{UNUSED}{since} ({self._number} left out): {why}"

    def forget_pauses(self) -> None:
        """The answer rests on samples after them."""
        self.unseen = 0.0
