"""Logs in HDF5, as ALOHA and DROID write them: arrays of position, velocity, torque in groups, often without times."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.recording.array_table import WIDEST, ArrayTable, Column
from armload.recording.column_spec import ColumnSpec
from armload.recording.recording import Recording
from armload.recording.table import read_table, table_chunks
from armload.runtime.extras import install


def read_hdf5(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read an HDF5 log; see `read_recording` for what it raises."""
    h5py = h5py_for(where)
    try:
        with h5py.File(path, "r") as file:
            columns = {name: Column(width, lambda data=data: data[()]) for name, width, data in _arrays(h5py, file)}
            return read_table(ArrayTable(columns, where), where, arm, spec or ColumnSpec())
    except RecordingError:
        raise
    except Exception as error:  # a damaged file can fail anywhere between the superblock and the chunks
        raise RecordingError(f"{where} is not an HDF5 file that can be read: {one_line(error)[:160]}") from None


def hdf5_chunks(path: Path, where: str, arm: Arm | None, spec: ColumnSpec, size: int) -> Iterator[Recording]:
    """An HDF5 log, `size` rows at a time; see `table_chunks` for what it raises."""
    h5py = h5py_for(where)
    with h5py.File(path, "r") as file:
        arrays = _arrays(h5py, file)

        def pieces() -> Iterator[ArrayTable]:
            for k in range(0, max((len(data) for _, _, data in arrays), default=0), size):
                part = slice(k, k + size)
                columns = {name: Column(width, lambda d=data, p=part: d[p]) for name, width, data in arrays}
                yield ArrayTable(columns, where, k)

        yield from table_chunks(pieces(), where, arm, spec)


def h5py_for(where: str) -> Any:
    """The module that reads HDF5.

    Raises:
        RecordingError: it is not installed.
    """
    try:
        import h5py  # type: ignore[import-not-found]
    except ImportError:
        raise RecordingError(f"{where}: HDF5 is read through h5py, which is missing: {install('h5py')}") from None
    return h5py


def _arrays(h5py: Any, file: Any) -> list[tuple[str, int | None, Any]]:
    """Name, width and data of all arrays that could be columns."""
    found: list[tuple[str, int | None, Any]] = []

    def add(name: str, data: Any) -> None:
        if isinstance(data, h5py.Dataset) and data.dtype.kind in "iuf" and data.ndim in (1, 2):
            width = data.shape[1] if data.ndim == 2 else None
            if width is None or 0 < width <= WIDEST:
                found.append((name, width, data))

    file.visititems(add)
    return found
