"""Named arrays as a table: what Parquet, NPZ, HDF5 and MATLAB hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.errors import RecordingError
from armload.recording.dates import nanoseconds_of
from armload.recording.header import is_time

_EXACT = 2.0**53  # below which a double tells whole numbers apart
WIDEST = 64  # elements a row; a longer one is no list of joints but an image, or lies across


class Column(NamedTuple):
    """One array that is read when it is needed: numbers (N,) or, where width says so, (N, width); or dates (N,).

    elements: names of the width elements of a row; None: they are counted.
    """

    width: int | None
    load: Callable[[], NDArray]
    dates: bool = False
    elements: Sequence[str] | None = None

    @classmethod
    def of(cls, array: NDArray) -> Column:
        """An array (N,) or (N, width) that is in memory."""
        return cls(array.shape[1] if array.ndim == 2 else None, lambda: array, array.dtype.kind == "M")


class ArrayTable:
    """Arrays by name (`table.Table`); elements of a list-valued one are columns `name[0]`, … or `name/joint`.

    A list of times, of one element, is the time itself.

    Args:
        columns: the arrays that could be columns.
        where: the file.
        first: number of the first row, of a piece of a table.
    """

    def __init__(self, columns: Mapping[str, Column], where: str, first: int = 0) -> None:
        self.where, self._first = where, first
        self.notes: Sequence[str] = ()
        self._columns = columns
        self._elements: list[tuple[str, int | None]] = []
        for name, column in columns.items():
            counted = column.width is not None and not (column.width == 1 and is_time(name))
            self._elements += [(name, k) for k in (range(column.width or 0) if counted else (None,))]
        self.names: Sequence[str] = [_called(name, k, columns[name].elements) for name, k in self._elements]
        self.dates: Sequence[int] = [k for k, (name, _) in enumerate(self._elements) if columns[name].dates]
        self._load = cache(lambda name: columns[name].load())

    def numbers(self, places: Sequence[int]) -> NDArray[np.float64]:
        """The columns at these places (N, k); dates as nanoseconds since 1970."""
        found = [self._column(place) for place in places]
        lengths = {len(column): self.names[place] for place, column in zip(places, found, strict=True)}
        if len(lengths) > 1:
            (one, name), (other, second) = list(lengths.items())[:2]
            raise RecordingError(
                f"{self.where}: {name} has {one} rows and {second} {other}: expected the same number in all columns"
            )
        return np.column_stack(found).astype(float)

    def whole_numbers(self, place: int) -> NDArray[np.int64] | None:
        """A column of whole numbers (N,), exactly; None: it holds others."""
        column = self._column(place)
        if column.dtype.kind == "f" and not np.all((np.abs(column) < _EXACT) & (column == np.rint(column))):
            return None
        return column.astype(np.int64)

    def text(self, place: int) -> str | None:
        """The one text that a column holds in all rows."""
        name, element = self._elements[place]
        values = self._load(name)
        texts = {str(text) for text in (values if element is None else values[:, element])}
        return texts.pop() if values.dtype.kind in "UO" and len(texts) == 1 else None

    def row_name(self, row: int) -> str:
        """The row, the first being 0."""
        return f"row {self._first + row}"

    def _column(self, place: int) -> NDArray:
        name, element = self._elements[place]
        array = self._load(name)
        array = array[:, 0] if element is None and array.ndim == 2 else array
        if array.dtype.kind == "M":
            array = nanoseconds_of(array, f"{self.where}: column {name}")
        if array.dtype.kind not in "iuf":
            held = "text" if array.dtype.kind in "USO" else array.dtype
            raise RecordingError(f"{self.where}: column {name} holds {held}: expected numbers")
        return array if element is None else array[:, element]


def _called(name: str, element: int | None, elements: Sequence[str] | None) -> str:
    if element is None:
        return name
    return f"{name}[{element}]" if elements is None else f"{name}/{elements[element]}"
