"""The rows of a log, any part of them as often as it is asked for, in memory that does not grow with them.

Rows take a hundred times the memory of the samples that they are made of. Those of a short log are kept; of a long one
the lags' states before each block of samples are, and its rows are made anew from there: the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.recording import Recording, blocks
from armload.regression.rows import FilteredRegression, Rows

# [bytes] of rows that are kept: ten seconds of a seven-joint arm
_KEPT = 48e6


class _Block(NamedTuple):
    """The rows first … stop of a log, made of some of its samples, and the lags' state before these."""

    first: int
    stop: int
    samples: slice
    state: tuple[NDArray[np.float64], ...]


class RowsOfLog:
    """All rows of a log.

    Args:
        regression: makes them; it is at the log's beginning.
        recording: the log.

    Attributes:
        t, q, h, r: of all of them, as `Rows` has them; X is what takes the memory.
    """

    def __init__(self, regression: FilteredRegression, recording: Recording) -> None:
        self._regression, self._recording = regression, recording
        self._blocks: list[_Block] = []
        self._kept: dict[int, Rows] = {}
        self._last: tuple[int, Rows] | None = None  # parts that follow each other are of one block mostly
        made, first, size = [], 0, 0.0
        for samples in blocks(len(recording)):
            state = regression.state
            rows = self._made(samples)
            self._blocks.append(_Block(first, first + len(rows.t), samples, state))
            size += rows.X.nbytes
            if size <= _KEPT:
                self._kept[first] = rows
            else:
                self._kept.clear()  # most are made anew in any case
            made.append((rows.t, rows.q, rows.h, rows.r))
            first += len(rows.t)
        self.t, self.q, self.h, self.r = (np.concatenate(parts) for parts in zip(*made, strict=True))

    def between(self, start: int, stop: int) -> Iterator[Rows]:
        """The rows start … stop, in parts that end where blocks of samples do."""
        for block in self._blocks:
            if block.stop <= start or block.first >= stop:
                continue
            rows = self._of(block)
            part = slice(max(start - block.first, 0), min(stop, block.stop) - block.first)
            yield Rows(*(value[part] for value in rows))

    def _of(self, block: _Block) -> Rows:
        if (rows := self._kept.get(block.first)) is not None:
            return rows
        if self._last is None or self._last[0] != block.first:
            self._regression.state = block.state
            self._last = block.first, self._made(block.samples)
        return self._last[1]

    def _made(self, samples: slice) -> Rows:
        log = self._recording
        return self._regression.rows(log.t[samples], log.q[samples], log.dq[samples], log.tau[samples])
