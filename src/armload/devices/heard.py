"""What the times of an arm's samples tell of samples that wait: their clock beside ours."""

from __future__ import annotations

import time

import numpy as np

from armload.devices.supervision import SILENCE


class Heard:
    """The newest sample of an arm, at rest and on its way.

    While this process does not run (it is stopped, its disk hangs), samples wait where nobody says since when. So what
    our clock went on beyond theirs is kept until they have caught up, and counts as waited, too.

    Attributes:
        newest: its time [s]; NaN before the first.
        behind: how old it is at least, should samples have waited unseen [s].
    """

    def __init__(self) -> None:
        self.newest, self.behind = np.nan, 0.0
        self._seen = np.nan  # when it was, on our clock [s]

    def at(self, t: float) -> tuple[float, float]:
        """How far the samples' clock, now at t, and ours went on since the sample before [s]; 0 at the first one."""
        before, seen = self.newest, self._seen
        self.newest, self._seen = t, time.monotonic()
        if np.isnan(before):
            return 0.0, 0.0
        passed, waited = t - before, self.behind + self._seen - seen
        if passed >= 0.0:  # else their clock was set back, which tells nothing of what waits
            self.behind = max(0.0, waited - passed) if waited > SILENCE or self.behind else 0.0
        return passed, waited
