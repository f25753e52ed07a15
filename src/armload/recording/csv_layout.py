"""How a text file of numbers is laid out: its header line and its separator.

Read from the header and the first row below it. Comment lines in front (`#`, `%`) are passed over, unless the last of
them is the header itself, as NumPy's `savetxt` and `rostopic echo -p` write it.
"""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from armload.errors import RecordingError

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,5})?")
_SEPARATORS = ("\t", ";", ",", " ")  # a space parts only what nothing else does
_EXPECTED = "expected the header, such as t,q1..qn,dq1..dqn,tau1..taun before the data"


@dataclass(frozen=True)
class Layout:
    """The header and the signs of a text file.

    names: of the columns; one without a name is called as pandas calls it, `Unnamed: 0`.
    first: line of the file with the first row, counted from 1.
    separator: between cells; a space stands for any number of them.
    """

    names: tuple[str, ...]
    first: int
    separator: str

    def cells(self, line: str) -> list[str]:
        """The cells of one line.

        Raises:
            csv.Error: its quotes make no sense.
        """
        return cells_of(line, self.separator)


def layout_of(lines: Sequence[str], where: str) -> Layout:
    """The layout of a file's lines.

    Raises:
        RecordingError: there is no header, or it and the first row are separated differently.
    """
    header = 0
    while header < len(lines) and (not lines[header].strip() or lines[header].lstrip().startswith(("#", "%"))):
        header += 1
    comments = [k for k in range(header) if lines[k].strip()]
    if comments and (header == len(lines) or _numeric(lines[header])):
        header = comments[-1]
    if header == len(lines):
        raise RecordingError(f"{where} has no header: expected a line that names the columns, then rows of numbers")
    text = lines[header].strip(" \r\n")
    if header in comments and text.startswith("#"):
        text = text.lstrip("# ")
    rows = (line for line in lines[header + 1 :] if line.strip())
    row = next(rows, "").strip(" \r\n")
    if header not in comments and _numeric(text):
        raise RecordingError(f"{where}, line {header + 1} holds numbers: {_EXPECTED}")
    try:
        separator = _separator(text, row)
        names = [name.strip() for name in cells_of(text, separator)]
    except csv.Error as error:
        raise RecordingError(f"{where}, line {header + 1}: the header cannot be read ({error}): {_EXPECTED}") from None
    named = tuple(name or f"Unnamed: {k}" for k, name in enumerate(names))
    return Layout(named, header + 2, separator)


def _numeric(line: str) -> bool:
    """Whether a line is a row of numbers rather than of names: it begins with one."""
    cells = re.split(r"[,;\t ]", line.strip().lstrip('"'), maxsplit=1)
    return NUMBER.fullmatch(cells[0].strip('"')) is not None


def _separator(header: str, row: str) -> str:
    """The one that parts the header and the first row into the same number of cells; else the header's own."""
    parts: dict[str, int] = {}
    for separator in _SEPARATORS:
        with contextlib.suppress(csv.Error):
            parts[separator] = len(cells_of(header, separator))
            if parts[separator] > 1 and row and len(cells_of(row, separator)) == parts[separator]:
                return separator
    return next((separator for separator in _SEPARATORS if parts.get(separator, 1) > 1), ",")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of one line; a space stands for any number of them.

    >>> cells_of('"time"  q_0 "q_1"', " ")
    ['time', 'q_0', 'q_1']
    """
    if separator == " ":
        line = re.sub(r"\s+", " ", line.strip())
    return next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True), [""])
