"""Rows of a log, some at a time, as recordings that follow each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.recording.columns import RowCheck, check_count, column_names, recording_of
from armload.recording.recording import Recording


class Chunks:
    """Makes a recording of every table of rows, each as soon as it is known that more follow.

    Args:
        where: the log. channel: what its torque is. labels: how to call its columns in a message.
    """

    def __init__(self, where: str, channel: str = "measured", labels: Sequence[str] | None = None) -> None:
        self._where, self._channel, self._labels = where, channel, labels
        self._check: RowCheck | None = None
        self._held: NDArray[np.float64] | None = None
        self._about: dict[str, Any] = {}

    def take(
        self, table: NDArray[np.float64], row_name: Callable[[int], str], joint_names: Any = None, epoch: float = 0.0
    ) -> Iterator[Recording]:
        """The next rows (N, 1 + 3n); gives the recording of those before, if there is one.

        Raises:
            RecordingError: a row is not valid.
        """
        if self._check is None:
            self._check = RowCheck(self._where, self._labels or column_names((table.shape[1] - 1) // 3))
        good = self._check.rows(table, row_name)
        self._about = {"joint_names": joint_names, "epoch": epoch}
        if self._held is None or len(self._held) < 2 or len(good) < 2:
            self._held = good.copy() if self._held is None else np.vstack([self._held, good])
            return
        yield self._recording()
        self._held = good

    def last(self, notes: tuple[str, ...] = ()) -> Recording:
        """The recording of the last rows, with the notes on all.

        Raises:
            RecordingError: there were fewer than two rows.
        """
        check = self._check or RowCheck(self._where, ())
        check_count(0 if self._held is None else len(self._held), check, self._where)
        return replace(self._recording(), notes=(*notes, *check.notes))

    def _recording(self) -> Recording:
        assert self._held is not None
        about = (self._about["joint_names"], (), self._about["epoch"])
        return recording_of(self._held, self._where, self._channel, *about)
