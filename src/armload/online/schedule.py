"""Work that a row calls for, spread over the samples that follow it: no sample of a fast stream pays for all of it."""

from __future__ import annotations

from armload.posterior.map import FAST
from armload.regression.rows import SPACING

_LATER = 2  # [samples] after a row: the row, the answer and the look at the innovations then fall on three samples


class Deferred:
    """One task for each row: done at once on a slow stream, some samples later on a fast one, before the next row.

    if deferred.due(t):  # at each sample, before the row it may complete
        …
    if deferred.row(t):  # at a sample that completed a row: True if the task is due at once
        …
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the stream: nothing is due."""
        self._last = self._row = float("-inf")
        self.clear()

    def clear(self) -> None:
        """Forget the row: nothing is due for it any more."""
        self._samples: int | None = None  # since the row

    def due(self, t: float) -> bool:
        """Whether the last row's task is due at a sample at t [s]."""
        if self._samples is None:
            return False
        self._samples += 1
        return self._samples >= _LATER or t - self._row >= SPACING

    def row(self, t: float) -> bool:
        """A sample at t [s] completed a row: whether its task is due at once."""
        self._row, self._samples = t, 0
        return t - self._last > FAST

    def seen(self, t: float) -> None:
        """A sample at t [s] is done with."""
        self._last = t
