"""Logs as NumPy archives, such as one with the arrays t (N,), q, dq, tau (N, n); never with pickled objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.recording.aliases import QUANTITIES
from armload.recording.array_table import WIDEST, ArrayTable, Column
from armload.recording.column_spec import ColumnSpec
from armload.recording.recording import CHANNELS, Recording
from armload.recording.table import read_table

_ARRAYS = ("t", *QUANTITIES)
_LABELS = ("channel", "joint_names")


def read_npz(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read an NPZ log; see `read_recording` for what it raises."""
    try:
        # opened here, because numpy leaves a file open that it cannot read
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise RecordingError(f"{where} holds one bare array: expected an archive with t, q, dq and tau")
            arrays = {name: archive[name] for name in archive.files}
    except RecordingError:
        raise
    except Exception as error:  # a damaged archive can fail anywhere between zip, zlib and the array header
        raise RecordingError(f"{where} is not a NumPy archive that can be read: {one_line(error)[:160]}") from None
    if arrays.keys() >= set(_ARRAYS) and spec in (None, ColumnSpec()):
        _check_shapes(arrays, where)
    channel = str(arrays.get("channel", "measured"))
    if channel not in CHANNELS:
        raise RecordingError(f"{where}: channel is {channel[:24]!r}: expected one of {', '.join(CHANNELS)}")
    joints = tuple(str(name) for name in np.ravel(arrays["joint_names"])) if "joint_names" in arrays else None
    columns = {
        name: Column(array.shape[1] if array.ndim == 2 else None, lambda array=array: array, array.dtype.kind == "M")
        for name, array in arrays.items()
        if name not in _LABELS and (array.ndim == 1 or (array.ndim == 2 and 0 < array.shape[1] <= WIDEST))
    }
    log = read_table(ArrayTable(columns, where), where, arm, spec or ColumnSpec(), channel=channel)
    return log if joints is None or len(joints) != log.n else replace(log, joint_names=joints)


def write_npz(path: Path, recording: Recording) -> None:
    """Write an NPZ log; channel and joint names go along as arrays of text."""
    arrays: dict[str, Any] = {name: getattr(recording, name) for name in _ARRAYS}
    arrays["channel"] = np.array(recording.channel)
    if recording.joint_names is not None:
        arrays["joint_names"] = np.array(recording.joint_names)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _check_shapes(arrays: dict[str, NDArray], where: str) -> None:
    """Refuse arrays t, q, dq, tau that do not fit each other, by their shapes."""
    for name in _ARRAYS:
        if arrays[name].dtype.kind not in "iuf":
            raise RecordingError(f"{where}: array {name} holds {arrays[name].dtype}: expected real numbers")
    t, q = arrays["t"], arrays["q"]
    if t.ndim != 1 or q.ndim != 2 or 0 in q.shape[1:]:
        raise RecordingError(f"{where}: t has shape {t.shape} and q {q.shape}: expected (N,) and (N, n)")
    for name in QUANTITIES:
        if arrays[name].shape != (len(t), q.shape[1]):
            turned = "; transpose it" if arrays[name].shape[::-1] == (len(t), q.shape[1]) else ""
            raise RecordingError(
                f"{where}: {name} has shape {arrays[name].shape}: expected {(len(t), q.shape[1])}, one row per "
                f"time{turned}"
            )
