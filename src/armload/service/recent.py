"""The latest samples, in a fixed amount of memory: a tare is made of them."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from armload.recording import Recording, Sample


class Recent:
    """The last samples of a stream, of rising times.

    Args:
        n: joints. rows: samples that are kept.
    """

    def __init__(self, n: int, rows: int = 30000) -> None:
        self.n = n
        self._rows = np.empty((rows, 1 + 3 * n))  # one block: thousands of small objects would burden the collector
        self._written = 0
        self._lock = threading.Lock()

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._written = 0

    def append(self, sample: Sample) -> None:
        """Keep a sample; one that is not later than the last starts anew."""
        n, size = self.n, len(self._rows)
        with self._lock:
            if self._written and sample.t <= self._rows[(self._written - 1) % size, 0]:
                self._written = 0
            row = self._rows[self._written % size]
            row[0] = sample.t
            row[1 : n + 1], row[n + 1 : 2 * n + 1], row[2 * n + 1 :] = sample.q, sample.dq, sample.tau
            self._written += 1

    def recording(self, seconds: float) -> Recording | None:
        """The last so many seconds; None if there are not even two samples."""
        size = len(self._rows)
        with self._lock:
            rows: NDArray = self._rows[np.arange(max(0, self._written - size), self._written) % size]
        rows = rows[rows[:, 0] > rows[-1, 0] - seconds] if len(rows) else rows
        if len(rows) < 2:
            return None
        n = self.n
        return Recording(rows[:, 0], rows[:, 1 : n + 1], rows[:, n + 1 : 2 * n + 1], rows[:, 2 * n + 1 :])
