"""A long recording that lies on disk: its samples are read when they are asked for, its times alone are in memory.

Whatever takes a `Recording` takes it. Of `q`, `dq` and `tau` a part is read by its rows, as `log.q[1000:2000]`; all of
one of them is made an array by NumPy (`np.asarray(log.q)`), with what that takes.
"""

from __future__ import annotations

import os
import tempfile
import weakref
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import RecordingError
from armload.recording.aliases import QUANTITIES
from armload.recording.recording import BLOCK, Recording
from armload.runtime.atomic import FULL


class _File:
    """A file without a name, which is gone with the last that refers to it, however the process ends."""

    def __init__(self, folder: str | Path | None) -> None:
        self.number, path = tempfile.mkstemp(prefix="armload-", dir=folder)
        os.unlink(path)
        self._folder = os.path.dirname(path)
        weakref.finalize(self, os.close, self.number)

    @contextmanager
    def writer(self) -> Iterator[IO[bytes]]:
        """What is written within comes to stand in the file.

        Raises:
            OSError: there is no room in the folder, which it names.
        """
        try:
            with open(self.number, "wb", closefd=False) as writer:
                yield writer
        except OSError as error:
            if error.errno not in FULL:
                raise
            raise OSError(error.errno, error.strerror, self._folder) from None

    def rows(self, start: int, stop: int, width: int) -> NDArray[np.float64]:
        """Some rows (stop − start, width), read and not mapped: a process's pages of a file count as its memory."""
        size = 8 * width
        return np.frombuffer(os.pread(self.number, size * (stop - start), size * start)).reshape(-1, width)


class OnDisk:
    """Some rows and columns of a file of doubles, as far as an array is needed: length, shape, and parts of it."""

    def __init__(self, file: _File, width: int, columns: slice, rows: slice) -> None:
        self._file, self._width, self._columns, self._rows = file, width, columns, rows
        self.shape = (rows.stop - rows.start, columns.stop - columns.start)
        self.ndim, self.dtype = 2, np.dtype(float)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> NDArray[np.float64]:
        rows, *columns = index if isinstance(index, tuple) else (index,)
        if isinstance(rows, slice):
            start, stop, step = rows.indices(len(self))
            found = self._between(start, stop)[::step] if step > 0 else self._at(np.arange(start, stop, step))
            return found[:, *columns]
        rows = np.asarray(rows)
        rows = np.flatnonzero(rows) if rows.dtype == bool else rows.astype(np.intp)
        found = self._at(rows.ravel())
        return found[np.arange(rows.size).reshape(rows.shape), *columns]

    def _between(self, start: int, stop: int) -> NDArray[np.float64]:
        """Rows that follow each other, a block at a time."""
        out = np.empty((max(stop - start, 0), self.shape[1]))
        for part in blocks(len(out)):
            out[part] = self._read(start + part.start, start + part.stop)
        return out

    def _at(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Any rows (M,); those within one block are read at once.

        Raises:
            IndexError: there is no such row.
        """
        rows = np.where(rows < 0, rows + len(self), rows)
        if len(rows) and not (rows.min() >= 0 and rows.max() < len(self)):
            raise IndexError(f"rows {rows.min()} to {rows.max()} of {len(self)}")
        out = np.empty((len(rows), self.shape[1]))
        order = np.argsort(rows, kind="stable")
        edges = np.flatnonzero(np.diff(rows[order] // BLOCK)) + 1
        for of_block in np.split(order, edges) if len(rows) else []:
            first = int(rows[of_block[0]])
            out[of_block] = self._read(first, int(rows[of_block[-1]]) + 1)[rows[of_block] - first]
        return out

    def _read(self, start: int, stop: int) -> NDArray[np.float64]:
        first = self._rows.start
        return self._file.rows(first + start, first + stop, self._width)[:, self._columns]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[np.float64]:
        del copy  # it always is one
        return self[:].astype(dtype or float, copy=False)

    def within(self, rows: slice) -> OnDisk:
        """The same of fewer rows."""
        start = self._rows.start
        return OnDisk(self._file, self._width, self._columns, slice(start + rows.start, start + rows.stop))


@dataclass(frozen=True, eq=False, repr=False)
class SpooledRecording(Recording):
    """A `Recording` whose q, dq and tau are `OnDisk`; made by `spooled`, from samples that were checked."""

    def __post_init__(self) -> None:
        self.t.setflags(write=False)

    def select(self, rows: NDArray | slice) -> Recording:
        """The samples at the given rows: on disk where they follow each other, else in memory."""
        part = slice(*rows.indices(len(self))) if isinstance(rows, slice) else None
        if part is None or part.step != 1 or part.stop - part.start < 2:
            index = np.arange(len(self))[rows]
            if len(index) < 2 or np.any(np.diff(index) != 1):
                return self._in_memory(index)
            part = slice(int(index[0]), int(index[-1]) + 1)
        q, dq, tau = (getattr(self, name).within(part) for name in QUANTITIES)
        return replace(self, t=self.t[part], q=q, dq=dq, tau=tau)

    def with_velocities(self, parts: Iterable[NDArray[np.float64]]) -> Recording:
        """The same with other velocities, which lie on disk, too."""
        file = _File(None)
        with file.writer() as writer:
            for part in parts:
                writer.write(part.tobytes())
        dq: Any = OnDisk(file, self.n, slice(0, self.n), slice(0, len(self)))
        return replace(self, dq=dq)

    def _in_memory(self, index: NDArray) -> Recording:
        q, dq, tau = (getattr(self, name)[index] for name in QUANTITIES)
        return Recording(self.t[index], q, dq, tau, **_about(self))


def spooled(chunks: Iterable[Recording], where: str, folder: str | Path | None = None) -> Recording:
    """One recording from the chunks of a log.

    Args:
        chunks: of one log, each later than the one before (`recording_chunks`).
        where: what the recording is called (its `source`).
        folder: where its samples lie meanwhile, 24 bytes for each joint and sample; None: the system's own.

    Raises:
        RecordingError: there are no chunks. OSError: the folder, which it names, is full.
    """
    file, times, last = _File(folder), [], None
    with file.writer() as writer:
        for last in chunks:
            writer.write(np.hstack([last.q, last.dq, last.tau]).tobytes())
            times.append(last.t)
    if last is None:
        raise RecordingError(f"{where} holds no rows of data: expected at least 2, one per sample")
    t, n = np.concatenate(times), last.n
    on_disk: list[Any] = [OnDisk(file, 3 * n, slice(k * n, (k + 1) * n), slice(0, len(t))) for k in range(3)]
    q, dq, tau = on_disk
    return SpooledRecording(t, q, dq, tau, **{**_about(last), "source": where})


def _about(recording: Recording) -> dict[str, Any]:
    """What a recording says beside its samples."""
    return {name: value for name, value in vars(recording).items() if name not in ("t", *QUANTITIES)}


def blocks(count: int) -> Iterator[slice]:
    """The rows 0 … count in blocks: at the same places, however a log is held."""
    return (slice(k, min(k + BLOCK, count)) for k in range(0, count, BLOCK))


def parts_of(x: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """x (N, n) a block at a time, as it lies in memory or on disk."""
    return (x[rows] for rows in blocks(len(x)))


def largest(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[int]]:
    """The largest size of each column (n,), and the first rows that have it."""
    found, at, first = np.full(x.shape[1], -np.inf), [0] * x.shape[1], 0
    for part in parts_of(x):
        size = np.abs(part)
        rows = size.argmax(axis=0)
        for j, k in enumerate(rows.tolist()):
            if size[k, j] > found[j]:
                found[j], at[j] = size[k, j], first + k
        first += len(part)
    return found, at


def span(x: NDArray[np.float64], rows: slice | None = None) -> NDArray[np.float64]:
    """Largest less smallest of each column (n,), of some rows."""
    inside = slice(0, len(x)) if rows is None else rows
    parts = (slice(inside.start + r.start, inside.start + r.stop) for r in blocks(inside.stop - inside.start))
    low, high = zip(*((part.min(axis=0), part.max(axis=0)) for part in (x[r] for r in parts)), strict=True)
    return np.max(high, axis=0) - np.min(low, axis=0)
