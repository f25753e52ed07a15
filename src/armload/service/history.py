"""Estimates over time, for curves: days of them in a fixed amount of memory.

Several rings hold the same columns, each coarser than the one before by a factor: the last half minute is kept ten
times a second, the last days once in some hours. A curve is taken from the finest ring that reaches far enough back.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import ArrayLike, NDArray


class History:
    """Rows of numbers over rising times, bounded.

    >>> history = History(1, step=1.0, rows=10, levels=3, factor=4)
    >>> for t in range(100):
    ...     history.append(t, [10.0 * t])
    >>> t, values = history.last(5.0)
    >>> t.tolist(), values[-1].tolist()
    ([94.0, 95.0, 96.0, 97.0, 98.0, 99.0], [990.0])
    >>> history.last()[0].tolist()  # all there is: coarser
    [0.0, 16.0, 32.0, 48.0, 64.0, 80.0, 96.0, 99.0]

    Args:
        columns: numbers of a row.
        step: what comes sooner than so long after the last row is left out [s].
        rows: of each ring. levels: rings. factor: by how much each is coarser than the one before.
    """

    def __init__(self, columns: int, step: float = 0.1, rows: int = 300, levels: int = 9, factor: int = 4) -> None:
        self._rings = np.full((levels, rows, 1 + columns), np.nan)
        self._steps = step * float(factor) ** np.arange(levels)
        self._soonest = 0.999 * float(self._steps[0])
        self._lock = threading.Lock()
        self.clear()

    @property
    def nbytes(self) -> int:
        """Memory of all rows [bytes]; it never grows."""
        return self._rings.nbytes

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._written = np.zeros(len(self._steps), dtype=np.int64)
            self._newest = np.full(self._rings.shape[2], np.nan)
            self._finest = -np.inf  # [s] of the last row in the finest ring

    def due(self, t: float) -> bool:
        """Whether a row at time t [s] would be kept in the finest ring, or starts a clock that was set back."""
        return not 0.0 <= t - self._finest < self._soonest

    def append(self, t: float, row: ArrayLike) -> None:
        """Keep a row (columns,) at time t [s]; a time before the last one means that the clock was set: all is new."""
        if self._written[0] and t < self._newest[0]:
            self.clear()
        with self._lock:
            self._newest = np.concatenate([[t], np.asarray(row, dtype=float)])
            for level, step in enumerate(self._steps):
                if self._written[level] and t - self._time_of_last(level) < 0.999 * step:
                    break  # what is too soon for a ring is too soon for the coarser ones
                self._rings[level, self._written[level] % self._rings.shape[1]] = self._newest
                self._written[level] += 1
                if level == 0:
                    self._finest = float(t)

    def last(self, seconds: float = np.inf) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (N,) [s] and rows (N, columns) of the last so many seconds, the newest row included."""
        with self._lock:
            if not self._written[0]:
                return np.empty(0), np.empty((0, self._rings.shape[2] - 1))
            since = self._newest[0] - seconds
            for level in range(len(self._steps)):
                rows = self._rows(level)
                if rows[0, 0] <= since or self._written[level] <= self._rings.shape[1]:
                    break
            rows = rows[rows[:, 0] >= since]
            if not len(rows) or rows[-1, 0] < self._newest[0]:
                rows = np.vstack([rows, self._newest])
        return rows[:, 0], rows[:, 1:]

    def _rows(self, level: int) -> NDArray[np.float64]:
        count, size = int(self._written[level]), self._rings.shape[1]
        return self._rings[level, np.arange(max(0, count - size), count) % size]

    def _time_of_last(self, level: int) -> float:
        last = (self._written[level] - 1) % self._rings.shape[1]
        return float(self._rings[level, last, 0]) if self._written[level] else -np.inf
