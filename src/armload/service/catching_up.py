"""Whether samples are late because functions were compiled: then the machine is not too busy."""

from __future__ import annotations

import math

from armload.runtime.compiling import COMPILING, compiling
from armload.service.unknown import SILENT

CATCHING_UP = "what came while functions were compiled is caught up with"
_STUCK = 2.0  # [s] without getting any closer to the newest sample: a machine that is too busy never does


class CatchingUp:
    """Remembers that functions were compiled until the samples that waited for them are answered."""

    def __init__(self) -> None:
        self._waited = False
        self._least = math.inf  # lag since it was compiled [s]
        self._closer = -math.inf  # when it last became less [s, monotonic]

    def why(self, lag: float | None, now: float) -> str | None:
        """Why answers are late, a sentence; None: not because anything is compiled, or was.

        Args:
            lag: how late the newest answer is [s]; None: there is none. now: [s, monotonic].
        """
        if compiling():
            self._waited, self._least, self._closer = True, math.inf, now
            return COMPILING
        if not self._waited or lag is None:
            return None
        if lag < self._least:
            self._least, self._closer = lag, now
        self._waited = lag > SILENT and now - self._closer < _STUCK
        return CATCHING_UP if self._waited else None
