"""Logs as MATLAB files, of any version: arrays of numbers, alone or in structs; never MATLAB's own objects.

Versions 4 to 7 are read by SciPy, which runs nothing that they hold; 7.3 is HDF5, with the dimensions of each array in
reverse and the class of each in an attribute. A field of a struct is called `run/q`, as in HDF5, one of a struct array
`run[0]/q`, the first being 0; `q` alone where no other struct has one.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.recording.aliases import CURRENTS, DESIRED, EXTERNAL, TIMES, WORDS
from armload.recording.array_table import WIDEST, ArrayTable, Column
from armload.recording.column_spec import ColumnSpec
from armload.recording.hdf5_file import h5py_for
from armload.recording.header import words_of
from armload.recording.recording import Recording
from armload.recording.table import read_table
from armload.runtime.extras import install

_HDF5, _USER_BLOCK = b"\x89HDF\r\n\x1a\n", 512  # how it begins, after so many bytes of MATLAB's own header
_CLASS = "MATLAB_class"
_TELLING = frozenset(WORDS) | CURRENTS | DESIRED | EXTERNAL  # words that are not left out of a name
_HOLDERS = ("/signals/values", "/values", "/data")  # fields that Simulink and others keep the numbers of a signal in
_NUMBERS = ("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))


def read_mat(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read a MATLAB log; see `read_recording` for what it raises."""
    with path.open("rb") as file:
        in_hdf5 = _HDF5 in file.read(_USER_BLOCK + len(_HDF5))
    held = _of_7_3(path, where) if in_hdf5 else _of_4_to_7(path, where)
    arrays = _called({name: array for name, value in held.items() if (array := _upright(value)) is not None})
    columns = {name: Column.of(array) for name, array in arrays.items()}
    try:
        return read_table(ArrayTable(columns, where), where, arm, spec or ColumnSpec())
    except RecordingError as error:
        objects = [name for name, value in held.items() if value is None]
        if not objects:
            raise
        raise RecordingError(
            f"{error}; {', '.join(objects)[:80]}: an object of MATLAB's own (table, timetable, timeseries, …), which "
            "other programs cannot read; save plain arrays, or write it as CSV (writetable, writetimetable)"
        ) from None


def _of_4_to_7(path: Path, where: str) -> dict[str, NDArray | None]:
    """What a file of an earlier version holds: arrays by name; None: an object."""
    try:
        from scipy.io import loadmat
        from scipy.io.matlab import MatlabFunction, MatlabOpaque
    except ImportError:
        how = install("scipy", "matlab")
        raise RecordingError(f"{where}: MATLAB files are read through SciPy, which is missing: {how}") from None

    def flat(value: Any, name: str) -> Iterator[tuple[str, NDArray | None]]:
        if isinstance(value, dict):
            for key, inner in value.items():
                yield from flat(inner, f"{name}/{key}" if name else key)
        elif isinstance(value, MatlabOpaque | MatlabFunction):
            yield name, None
        elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
            for k, inner in enumerate(np.ravel(np.asarray(value, dtype=object))):
                yield from flat(inner, f"{name}[{k}]")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
            yield name, value

    try:
        with warnings.catch_warnings():  # of what is passed over
            warnings.simplefilter("ignore")
            held = loadmat(path, simplify_cells=True)
        nameless = held.pop("None", None)  # SciPy's name of an object that has none in the file; it says its own
        objects = {} if nameless is None else {str(nameless[0][0].decode()): None}
    except Exception as error:  # a damaged file can fail anywhere between its header and zlib
        raise RecordingError(f"{where} is not a MATLAB file that can be read: {one_line(error)[:160]}") from None
    named = {name: value for name, value in held.items() if not name.startswith("__")}
    return dict(flat(named, "")) | objects


def _of_7_3(path: Path, where: str) -> dict[str, NDArray | None]:
    """What a file of version 7.3 holds."""
    h5py = h5py_for(where)
    held: dict[str, NDArray | None] = {}

    def add(name: str, data: Any) -> None:
        if name.startswith("#"):  # what cells and objects refer to
            return
        kind = data.attrs.get(_CLASS, b"struct")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if "MATLAB_object_decode" in data.attrs:
            held[name] = None
        elif isinstance(data, h5py.Dataset) and kind in _NUMBERS and not data.attrs.get("MATLAB_empty"):
            held[name] = data[()].T

    try:
        with h5py.File(path, "r") as file:
            file.visititems(add)
    except Exception as error:
        raise RecordingError(f"{where} is not a MATLAB file that can be read: {one_line(error)[:160]}") from None
    return held


def _upright(array: NDArray | None) -> NDArray | None:
    """An array with a row for each time (N,) or (N, n), whichever way it lies; None: it can be no column."""
    if array is None:
        return None
    array = np.squeeze(array)
    if array.ndim == 2 and array.shape[0] <= WIDEST < array.shape[1]:
        array = array.T
    wide = array.ndim == 2 and not 0 < array.shape[1] <= WIDEST
    return None if wide or array.ndim not in (1, 2) or not array.size else array


def _called(arrays: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """The arrays by the ends of their names, as far as they tell them apart; of equal clocks the first."""
    clocks: list[NDArray] = []
    kept: dict[str, NDArray] = {}
    for name, array in arrays.items():
        if name.rpartition("/")[2].lower() in TIMES:
            if any(np.array_equal(array, clock) for clock in clocks):
                continue
            clocks.append(array)
        kept[name] = array
    count = Counter(end for name in kept for end, _ in _ends(name))
    short = {name: _end(name, count) for name in kept}
    return {short[name]: array for name, array in kept.items()} if len(set(short.values())) == len(kept) else kept


def _end(name: str, count: Mapping[str, int]) -> str:
    """A name without the structs that it is in, unless they say something, or another name ends so too."""
    for end, left_out in _ends(name):
        if count[end] == 1 and _TELLING.isdisjoint(words_of(left_out)):
            return end
    return _bare(name)


def _ends(name: str) -> Iterator[tuple[str, str]]:
    """The ends of a name, the shortest first, each with what is left out in front of it."""
    parts = _bare(name).split("/")
    return (("/".join(parts[k:]), " ".join(parts[:k])) for k in range(len(parts) - 1, -1, -1))


def _bare(name: str) -> str:
    """A name without the field that holds the numbers."""
    for holder in _HOLDERS:
        if name.lower().endswith(holder):
            return name[: -len(holder)]
    return name
