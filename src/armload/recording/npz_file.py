"""Logs as NumPy archives, such as one with the arrays t (N,), q, dq, tau (N, n), or as one array; never pickled."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
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
from armload.recording.table import NotInPieces, read_table, table_chunks

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
        raise RecordingError(f"{where} is not a NumPy archive that can be read: {_reason(error)}") from None
    if arrays.keys() >= set(_ARRAYS) and spec in (None, ColumnSpec()):
        _check_shapes(arrays, where)
    channel = str(arrays.get("channel", "measured"))
    if channel not in CHANNELS:
        raise RecordingError(f"{where}: channel is {channel[:24]!r}: expected one of {', '.join(CHANNELS)}")
    joints = tuple(str(name) for name in np.ravel(arrays["joint_names"])) if "joint_names" in arrays else None
    columns = {
        name: Column.of(array)
        for name, array in arrays.items()
        if name not in _LABELS and (array.ndim == 1 or (array.ndim == 2 and 0 < array.shape[1] <= WIDEST))
    }
    log = read_table(ArrayTable(columns, where), where, arm, spec or ColumnSpec(), channel=channel)
    return log if joints is None or len(joints) != log.n else replace(log, joint_names=joints)


def read_npy(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read one array (N, k) of numbers, whose columns are called by their numbers, the first being 1, or with fields.

    See `read_recording` for what it raises.
    """
    try:
        array = np.load(path, allow_pickle=False)
    except Exception as error:
        raise RecordingError(f"{where} is not a NumPy array that can be read: {_reason(error)}") from None
    if array.dtype.names is not None and array.ndim == 1:
        columns = {name: array[name] for name in array.dtype.names}
    elif array.ndim == 2 and array.dtype.kind in "iuf":
        columns = {str(k + 1): array[:, k] for k in range(array.shape[1])}
    else:
        raise RecordingError(
            f"{where} holds an array of shape {array.shape} of {array.dtype}: expected (N, k) numbers, a row for each "
            "time, or (N,) with named fields"
        )
    table = ArrayTable({name: Column.of(column) for name, column in columns.items()}, where)
    return read_table(table, where, arm, spec or ColumnSpec())


def _reason(error: Exception) -> str:
    """What is wrong with an archive; NumPy's own advice, to allow pickled objects, runs whatever code is in them."""
    if "pickle" in str(error):
        return "it holds Python objects, or is none at all; expected arrays of numbers, as numpy.savez writes them"
    if isinstance(error, zipfile.BadZipFile | EOFError):
        return "it is damaged or was cut off; copy it again, or write it anew"
    return one_line(error)[:160]


def npz_chunks(path: Path, where: str, arm: Arm | None, spec: ColumnSpec, size: int) -> Iterator[Recording]:
    """An NPZ log, `size` rows at a time, each array unpacked as far as it is needed; see `table_chunks`."""
    with zipfile.ZipFile(path) as archive, ExitStack() as stack:
        labels: dict[str, NDArray] = {}
        arrays: dict[str, _Packed] = {}
        for member in archive.namelist():
            name, stream = member.removesuffix(".npy"), stack.enter_context(archive.open(member))
            if name in _LABELS:
                labels[name] = np.lib.format.read_array(stream, allow_pickle=False)
                continue
            packed = _Packed(stream, where)
            if len(packed.shape) in (1, 2) and 0 < packed.width <= WIDEST:
                arrays[name] = packed
        channel = str(labels.get("channel", "measured"))
        if channel not in CHANNELS:
            raise NotInPieces(f"{where}: an unknown channel")
        joints = tuple(str(name) for name in np.ravel(labels["joint_names"])) if "joint_names" in labels else None

        def pieces() -> Iterator[ArrayTable]:
            for k in range(0, max((packed.shape[0] for packed in arrays.values()), default=0), size):
                columns = {
                    name: Column(
                        packed.width if len(packed.shape) == 2 else None,
                        partial(packed.rows, k, size),
                        packed.dtype.kind == "M",
                    )
                    for name, packed in arrays.items()
                }
                yield ArrayTable(columns, where, k)

        for log in table_chunks(pieces(), where, arm, spec, channel):
            yield log if joints is None or len(joints) != log.n else replace(log, joint_names=joints)


class _Packed:
    """An array in an archive, read from its beginning on."""

    def __init__(self, stream: Any, where: str) -> None:
        version = np.lib.format.read_magic(stream)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        self.shape, fortran, self.dtype = header(stream)
        if fortran or self.dtype.hasobject or not self.shape:
            raise NotInPieces(f"{where}: an array that is not stored row by row")
        self.width = int(np.prod(self.shape[1:]))
        self._stream, self._begins = stream, stream.tell()

    def rows(self, first: int, count: int) -> NDArray:
        """Rows from the first on, later than those before."""
        row = self.width * self.dtype.itemsize
        count = max(min(count, self.shape[0] - first), 0)
        self._stream.seek(self._begins + first * row)
        return np.frombuffer(self._stream.read(count * row), self.dtype).reshape(count, *self.shape[1:])


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
        if arrays[name].dtype.kind not in ("iufM" if name == "t" else "iuf"):
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
