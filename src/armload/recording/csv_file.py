"""Logs as text: comma-separated, or by semicolons, tabs or spaces, with decimal points or commas.

A file without flaw is read at once (NumPy). Any other is read again line by line, to say which line and column is
wrong, or to find that a person would have read it the same way (blank lines, quotes, a plus sign).

A last line that was cut off (no line end, and no row of numbers) is dropped with a note: that is how a log ends whose
writer was killed or whose machine lost its power.
"""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.column_spec import ColumnSpec
from armload.recording.columns import column_names
from armload.recording.csv_layout import NUMBER, check_named, layout_of
from armload.recording.dates import EXPECTED, nanoseconds
from armload.recording.header import is_time
from armload.recording.recording import Recording
from armload.recording.table import NotInPieces, read_table, table_chunks
from armload.recording.text_lines import lines_of, refuse_zeros

_BEGINS_A_NUMBER = re.compile(r"[+-]?[0-9]*\.?[0-9]*([eE][+-]?[0-9]*)?")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]{1,5})?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}|[1-8][0-9]{18}")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)


def read_csv(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read a text log; see `read_recording` for what it raises."""
    spec, table = spec or ColumnSpec(), _Csv(path.read_bytes(), where)
    check_named(table.layout, spec, None if arm is None else arm.n, where)
    return read_table(table, where, arm, spec)


def csv_chunks(path: Path, where: str, arm: Arm | None, spec: ColumnSpec, size: int) -> Iterator[Recording]:
    """A text log, `size` bytes at a time; see `table_chunks` for what it raises."""
    return table_chunks(_pieces(path, where, size), where, arm, spec)


def _pieces(path: Path, where: str, size: int) -> Iterator[_Piece]:
    """The header with each of the blocks of lines that follow it."""
    with path.open("rb") as file:
        now, header, first = _to_line_end(file, size), b"", 0
        while now:
            following = _to_line_end(file, size)
            if following and len(following) < size:  # the last lines are judged beside those before them
                now, following = now + following, b""
            piece = _Piece(header + now, where, first)
            if not header:
                lines = now.splitlines(keepends=True)
                header = b"".join(lines[: piece.layout.first - 1])
                first -= piece.layout.first - 1
            yield piece
            first += now.count(b"\n")
            now = following


def _to_line_end(file: BinaryIO, size: int) -> bytes:
    return (block + file.readline()) if (block := file.read(size)) else b""


def write_csv(path: Path, recording: Recording) -> None:
    """Write a CSV log; each number as the shortest text that reads back as the same double (up to 17 digits)."""
    table = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])
    with path.open("w", encoding="ascii", newline="") as file:
        file.write(",".join(column_names(recording.n)) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())


class _Csv:
    """A text file as a table (`table.Table`)."""

    def __init__(self, data: bytes, where: str) -> None:
        self.where = where
        lines = lines_of(data, where)
        self.layout = layout_of(lines, where)
        self.names: Sequence[str] = self.layout.names
        self.notes: list[str] = []
        self._body = lines[self.layout.first - 1 :]
        self._drop_torn_end(data)
        while self._body and not self._body[-1].strip():
            self._body.pop()
        first = next((line for line in self._body if line.strip()), "")
        self.dates: Sequence[int] = [
            k for k, cell in enumerate(self._first_cells(first)) if nanoseconds(cell) is not None
        ]
        self._rows: list[tuple[int, list[str]]] | None = None  # line and cells, once it was read line by line
        self._comma, self._point = 0, 0  # the first line with a decimal comma, and with a decimal point

    def numbers(self, places: Sequence[int]) -> NDArray[np.float64]:
        """The columns at these places (N, k); dates as nanoseconds since 1970."""
        table = self._fast(places)
        if table is not None and len(table) > 1 and np.isfinite(table).all():
            return table
        self._rows = rows = self._with_values(self._read_rows(), places)
        values = [[self._number(cells[place], place, line) for place in places] for line, cells in rows]
        if self._comma and self._point:
            raise RecordingError(
                f"{self.where}: line {self._comma} has decimal commas and line {self._point} decimal points: expected "
                "one of them; write the numbers without separators of thousands"
            )
        return np.array(values, dtype=float).reshape(len(values), len(places))

    def whole_numbers(self, place: int) -> NDArray[np.int64] | None:
        """A column of whole numbers (N,), exactly; None: they are not whole, or longer than 18 digits hold."""
        cells = self._column(place)
        if place in self.dates:
            stamps = [nanoseconds(cell) for cell in cells]
            return None if None in stamps else np.array(stamps, dtype=np.int64)
        if not all(map(_WHOLE.fullmatch, cells)):
            return None
        return np.array([int(cell) for cell in cells], dtype=np.int64)

    def text(self, place: int) -> str | None:
        """The one text that a column holds in all rows."""
        cells = set(self._column(place))
        text = cells.pop() if len(cells) == 1 else ""
        return None if not text or NUMBER.fullmatch(text) else text

    def row_name(self, row: int) -> str:
        """The line of the file, the first being 1."""
        return f"line {self.layout.first + row if self._rows is None else self._rows[row][0]}"

    def _column(self, place: int) -> list[str]:
        if self._rows is None and self._plain:
            separator = None if self.layout.separator == " " else self.layout.separator
            return [line.split(separator, place + 1)[place].strip() for line in self._body]
        return [cells[place] for _, cells in self._rows or self._read_rows()]

    @cached_property
    def _plain(self) -> bool:
        """Whether every line has the header's number of cells, and none has quotes."""
        separator, count = self.layout.separator, len(self.names)
        if any('"' in line for line in self._body):
            return False
        if separator == " ":
            return all(len(line.split()) == count for line in self._body)
        return all(line.count(separator) == count - 1 for line in self._body)

    def _fast(self, places: Sequence[int]) -> NDArray[np.float64] | None:
        """The columns, or None if anything at all is unusual."""
        if not self._body or not self._plain:
            return None
        separator = None if self.layout.separator == " " else self.layout.separator
        of_dates: Any = {place: _nanoseconds for place in self.dates if place in places}
        try:
            return np.loadtxt(
                self._body, delimiter=separator, comments=None, usecols=places, ndmin=2, converters=of_dates or None
            )
        except ValueError:
            pass
        if separator == "," or any("." in line for line in self._body):
            return None
        try:
            lines = [line.replace(",", ".") for line in self._body]
            return np.loadtxt(lines, delimiter=separator, comments=None, usecols=places, ndmin=2)
        except ValueError:
            return None

    def _read_rows(self) -> list[tuple[int, list[str]]]:
        """Line number and cells of each row.

        Raises:
            RecordingError: the first line that has not as many cells as the header.
        """
        rows = []
        for line, text in enumerate(self._body, start=self.layout.first):
            if not text.strip():
                continue
            try:
                cells = [cell.strip() for cell in self.layout.cells(text)]
            except csv.Error as error:
                raise RecordingError(f"{self.where}, line {line} cannot be read as CSV: {error}") from None
            if not any(cells):
                continue
            if len(cells) != len(self.names):
                at_end = line == self.layout.first + len(self._body) - 1
                last = " (the last line: the file may be cut off)" if at_end else ""
                raise RecordingError(
                    f"{self.where}, line {line} has {len(cells)} cells{last}: expected {len(self.names)}, as the "
                    "header has"
                )
            rows.append((line, cells))
        return rows

    def _with_values(self, rows: list[tuple[int, list[str]]], places: Sequence[int]) -> list[tuple[int, list[str]]]:
        """The rows without those that are empty but for the time: PlotJuggler writes a row for every topic's time."""
        kept = [row for row in rows if any(row[1][place] for place in places[1:])]
        if len(kept) < len(rows) and kept:
            self.notes.append(
                f"{self.where}: left out {len(rows) - len(kept)} row(s) without position, velocity and torque"
            )
            return kept
        return rows

    def _first_cells(self, line: str) -> list[str]:
        with contextlib.suppress(csv.Error):
            return self.layout.cells(line)
        return []

    def _number(self, cell: str, place: int, line: int) -> float:
        if place in self.dates and (stamp := nanoseconds(cell)) is not None:
            return float(stamp)
        if NUMBER.fullmatch(cell) or _NOT_FINITE.fullmatch(cell):
            self._point = self._point or ("." in cell) * line
            return float(cell)
        if self.layout.separator != "," and _DECIMAL_COMMA.fullmatch(cell):
            self._comma = self._comma or line
            return float(cell.replace(",", "."))
        if not cell:
            raise RecordingError(f"{self.where}, line {line}: {self.names[place]} is empty: expected a number")
        shown = cell if len(cell) <= 24 else cell[:24] + "…"
        expected = "a number with a decimal point"
        if place in self.dates:
            expected = "a date, as in the first row"
        elif ":" in cell or is_time(self.names[place]):
            expected = f"a number, or {EXPECTED}"
        raise RecordingError(f"{self.where}, line {line}: {self.names[place]} is {shown!r}: expected {expected}")

    def _drop_torn_end(self, data: bytes) -> None:
        """Leave out a last line that was cut off: no line end, and the beginning of a row like the one before it."""
        zeros = len(data) - len(data.rstrip(b"\0"))
        last = self._body[-1].rstrip("\0").strip() if self._body else ""
        if not self._body or (not last and not zeros):
            return
        comma = self.layout.separator != ","
        *cells, end = (
            cell.strip() for cell in last.split(None if self.layout.separator == " " else self.layout.separator)
        )
        like = next((line for line in reversed(self._body[:-1]) if line.strip()), "").split(self.layout.separator)
        texts = {k for k, cell in enumerate(like) if cell.strip() and not _is_number(cell.strip(), comma)}
        whole = len(cells) + 1 == len(self.names) and (len(cells) in texts or _is_number(end, comma)) and not zeros
        begun = len(cells) < len(self.names) and all(
            k in texts or _is_number(cell, comma) for k, cell in enumerate(cells)
        )
        end = end.replace(",", ".") if comma else end
        if not whole and begun and (len(cells) in texts or _BEGINS_A_NUMBER.fullmatch(end)):
            self._body.pop()
            cut = len(last.encode()) + zeros
            self.notes.append(f"{self.where}: dropped the last line, which was cut off: {cut} bytes")
        elif zeros:
            refuse_zeros(self.where, self.layout.first + len(self._body) - 1)


class _Piece(_Csv):
    """Some lines of a text file, under its header; `first`: lines of the data before them."""

    def __init__(self, data: bytes, where: str, first: int) -> None:
        if b"\r" in data.replace(b"\r\n", b""):
            raise NotInPieces(f"{where}: other line ends")
        super().__init__(data, where)
        self._earlier = first

    def numbers(self, places: Sequence[int]) -> NDArray[np.float64]:
        """The columns at these places (N, k), of lines without flaw."""
        table = self._fast(places)
        if table is None:
            raise NotInPieces(f"{self.where}: a line is not as the others")
        return table

    def row_name(self, row: int) -> str:
        """The line of the file, the first being 1."""
        return f"line {self.layout.first + self._earlier + row}"


def _nanoseconds(cell: str) -> float:
    stamp = nanoseconds(cell)
    if stamp is None:
        raise ValueError(cell)
    return float(stamp)


def _is_number(cell: str, comma: bool) -> bool:
    return NUMBER.fullmatch(cell) is not None or (comma and _DECIMAL_COMMA.fullmatch(cell) is not None)
