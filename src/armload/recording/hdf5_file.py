"""Logs in HDF5, as ALOHA and DROID write them: arrays of position, velocity, torque in groups, often without times."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.extras import install
from armload.recording.array_table import WIDEST, ArrayTable, Column
from armload.recording.column_spec import ColumnSpec
from armload.recording.recording import Recording
from armload.recording.table import read_table


def read_hdf5(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read an HDF5 log; see `read_recording` for what it raises."""
    try:
        import h5py  # type: ignore[import-not-found]
    except ImportError:
        raise RecordingError(f"{where}: HDF5 is read through h5py, which is missing: {install('h5py')}") from None
    columns: dict[str, Column] = {}

    def add(name: str, data: Any) -> None:
        if isinstance(data, h5py.Dataset) and data.dtype.kind in "iuf" and data.ndim in (1, 2):
            width = data.shape[1] if data.ndim == 2 else None
            if width is None or 0 < width <= WIDEST:
                columns[name] = Column(width, lambda: data[()])

    try:
        with h5py.File(path, "r") as file:
            file.visititems(add)
            return read_table(ArrayTable(columns, where), where, arm, spec or ColumnSpec())
    except RecordingError:
        raise
    except Exception as error:  # a damaged file can fail anywhere between the superblock and the chunks
        raise RecordingError(f"{where} is not an HDF5 file that can be read: {one_line(error)[:160]}") from None
