"""How a text file of numbers is laid out: its header line and its separator.

Read from the header and the first row below it. Comment lines in front (`#`, `%`) are passed over, unless the last of
them is the header itself, as NumPy's `savetxt` and `rostopic echo -p` write it; so is a first line `sep=;`, which tells
Excel the separator. Columns without a header are called by their numbers, the first being 1; those of
`ros2 topic echo --csv /joint_states` are known by what is in them.
"""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from armload.errors import RecordingError
from armload.recording.column_spec import ColumnSpec

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,5})?")
_SEPARATORS = ("\t", ";", ",", " ")  # a space parts only what nothing else does
_FOR_EXCEL = re.compile(r'"?sep=."?', re.IGNORECASE)  # the first line of files that are to be opened there
_EXPECTED = "expected the header, such as t,q1..qn,dq1..dqn,tau1..taun before the data"
_JOINTS = 7  # of an example
_STAMP = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")


@dataclass(frozen=True)
class Layout:
    """The header and the signs of a text file.

    names: of the columns; one without a name is called as pandas calls it, `Unnamed: 0`.
    first: line of the file with the first row, counted from 1.
    separator: between cells; a space stands for any number of them.
    nameless: whether there is no header, and the names are the columns' numbers.
    """

    names: tuple[str, ...]
    first: int
    separator: str
    nameless: bool = False

    def cells(self, line: str) -> list[str]:
        """The cells of one line.

        Raises:
            csv.Error: its quotes make no sense.
        """
        return cells_of(line, self.separator)


def layout_of(lines: Sequence[str], where: str) -> Layout:
    """The layout of a file's lines.

    Raises:
        RecordingError: there is nothing but comments, or a header that cannot be read.
    """
    first = begin = 1 if lines and _FOR_EXCEL.fullmatch(lines[0].strip(" \r\n")) else 0
    while first < len(lines) and (not lines[first].strip() or lines[first].lstrip().startswith(("#", "%"))):
        first += 1
    comments = [k for k in range(begin, first) if lines[k].strip()]
    if first == len(lines) and not comments:
        raise RecordingError(f"{where} has no header: expected a line that names the columns, then rows of numbers")
    if first < len(lines) and not _numeric(lines[first]):
        return _headed(lines, first, where)
    if comments:
        headed = _headed(lines, comments[-1], where, "#")
        if first == len(lines) or len(headed.names) == len(_cells(lines[first], headed.separator)):
            return headed
    row = lines[first].strip(" \r\n")
    separator = _separator(row, row)
    cells = _cells(row, separator)
    echoed = _echoed(cells)
    return Layout(echoed or tuple(str(k + 1) for k in range(len(cells))), first + 1, separator, nameless=not echoed)


def check_named(layout: Layout, spec: ColumnSpec, n: int | None, where: str) -> None:
    """Refuse a file without a header of which nobody says what its columns are; n: joints, where they are known."""
    if layout.nameless and not any(getattr(spec, key) for key in ("q", "dq", "tau")):
        n = n or _JOINTS
        ranges = ",".join(f"{key}={{{2 + k * n}..{1 + (k + 1) * n}}}" for k, key in enumerate(("q", "dq", "tau")))
        raise RecordingError(
            f"{where}, line {layout.first} holds numbers: {_EXPECTED}; or name its {len(layout.names)} columns by "
            f'their numbers, such as --columns "t=1,{ranges}"'
        )


def _echoed(cells: Sequence[str]) -> tuple[str, ...]:
    """The columns of a row of `ros2 topic echo --csv` of a JointState; (): it is none.

    It writes the fields of each message in their order: a stamp in two parts, the frame, and four arrays of n.
    """
    n = (len(cells) - len(_STAMP)) // 4
    names, numbers = cells[len(_STAMP) : len(_STAMP) + n], [*cells[:2], *cells[len(_STAMP) + n :]]
    if n < 1 or len(cells) != len(_STAMP) + 4 * n or not all(map(NUMBER.fullmatch, numbers)):
        return ()
    if any(not name or NUMBER.fullmatch(name) for name in names):
        return ()
    return (*_STAMP, *(f"{field}{k}" for field in ("name", "position", "velocity", "effort") for k in range(n)))


def _headed(lines: Sequence[str], header: int, where: str, sign: str = "") -> Layout:
    """The layout under a header line, which may begin with the `sign` of a comment."""
    text = lines[header].strip(" \r\n")
    if sign and text.startswith(sign):
        text = text.lstrip(f"{sign} ")
    row = next((line for line in lines[header + 1 :] if line.strip()), "").strip(" \r\n")
    try:
        separator = _separator(text, row)
        names = [name.strip() for name in cells_of(text, separator)]
    except csv.Error as error:
        raise RecordingError(f"{where}, line {header + 1}: the header cannot be read ({error}): {_EXPECTED}") from None
    return Layout(tuple(name or f"Unnamed: {k}" for k, name in enumerate(names)), header + 2, separator)


def _cells(line: str, separator: str) -> list[str]:
    with contextlib.suppress(csv.Error):
        return cells_of(line.strip(" \r\n"), separator)
    return []


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
