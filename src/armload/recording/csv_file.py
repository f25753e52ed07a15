"""Logs as comma-separated text with the header t,q1..qn,dq1..dqn,tau1..taun.

A file without flaw is read at once (pyarrow). Any other is read again line by line, to say which line and column is
wrong, or to find that a person would have read it the same way (blank lines, quotes, a plus sign).

A last line that was cut off (no line end, and no row of numbers) is dropped with a note: that is how a log ends whose
writer was killed or whose machine lost its power.
"""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.columns import checked_recording, column_names, joint_count
from armload.recording.recording import Recording

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,5})?")
_BEGINS_A_NUMBER = re.compile(r"[+-]?[0-9]*\.?[0-9]*([eE][+-]?[0-9]*)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)


def read_csv(path: Path, where: str, arm: Arm | None = None) -> Recording:
    """Read a CSV log; see `read_recording` for what it raises."""
    data, notes = _without_torn_end(path.read_bytes(), where)
    text = _text(data, where)
    names = _header(text, where)
    n = joint_count(names, where, arm)
    order = [names.index(name) for name in column_names(n)]
    joints = None if arm is None else arm.joint_names
    table = _read_fast(data, names)
    if table is not None:
        table = np.ascontiguousarray(table[:, order])
        if len(table) > 1 and np.isfinite(table).all() and np.all(np.diff(table[:, 0]) > 0):
            return checked_recording(table, where, lambda k: f"line {k + 2}", joint_names=joints, notes=notes)
    table, lines = _read_slowly(text, names, where)
    return checked_recording(table[:, order], where, lambda k: f"line {lines[k]}", joint_names=joints, notes=notes)


def write_csv(path: Path, recording: Recording) -> None:
    """Write a CSV log; each number as the shortest text that reads back as the same double (up to 17 digits)."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    table = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])
    names = column_names(recording.n)
    arrays = [pa.array(column) for column in table.T]
    with path.open("wb") as file:
        file.write((",".join(names) + "\n").encode())  # Arrow would put the names in quotes
        options = arrow_csv.WriteOptions(include_header=False, quoting_style="none")
        arrow_csv.write_csv(pa.Table.from_arrays(arrays, names=names), file, options)


def _without_torn_end(data: bytes, where: str) -> tuple[bytes, tuple[str, ...]]:
    """The file without a last line that was cut off, and a note if there was one."""
    whole = data.rstrip(b"\0")  # a file system may have promised blocks that it never wrote
    end = max(whole.rfind(b"\n"), whole.rfind(b"\r")) + 1
    columns = re.split(rb"[\r\n]", whole, maxsplit=1)[0].count(b",") + 1
    *cells, last = (cell.strip().decode("latin-1") for cell in whole[end:].split(b","))
    complete = len(cells) + 1 == columns and _NUMBER.fullmatch(last) and whole == data
    begins_a_row = len(cells) < columns and all(map(_NUMBER.fullmatch, cells)) and _BEGINS_A_NUMBER.fullmatch(last)
    if end == 0 or complete or not begins_a_row or (not whole[end:].strip() and whole == data):
        return data, ()
    return whole[:end], (f"{where}: dropped the last line, which was cut off: {len(data) - end} bytes",)


def _text(data: bytes, where: str) -> str:
    if not data.strip():
        raise RecordingError(f"{where} is empty: expected a header line and one line per sample")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RecordingError(
            f"{where}, line {line}: byte 0x{data[error.start]:02x} is not text: expected a CSV file in UTF-8; the file "
            "is binary, damaged or in another encoding"
        ) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise RecordingError(f"{where}, line {line}: the file holds zero bytes: expected text; it is binary or damaged")
    return text


def _header(text: str, where: str) -> list[str]:
    """The names in the header line."""
    header = re.split(r"\r\n|\r|\n", text, maxsplit=1)[0]
    try:
        cells = next(csv.reader([header], strict=True), [])
    except csv.Error as error:
        raise RecordingError(f"{where}, line 1: the header cannot be read ({error}): expected t,q1,…") from None
    names = [cell.strip() for cell in cells]
    if not any(names):
        raise RecordingError(f"{where}, line 1 is blank: expected the header t,q1..qn,dq1..dqn,tau1..taun")
    if all(_NUMBER.fullmatch(name) for name in names):
        raise RecordingError(
            f"{where}, line 1 holds numbers: expected the header t,q1..qn,dq1..dqn,tau1..taun before the data"
        )
    if names[0].startswith("#"):
        raise RecordingError(
            f"{where}, line 1 begins with '#': expected the header t,q1..qn,dq1..dqn,tau1..taun; remove the '#', or "
            "the line if it is a comment"
        )
    if len(names) == 1:
        for separator, called in ((";", "semicolons"), ("\t", "tabs"), (" ", "spaces")):
            if separator in names[0]:
                raise RecordingError(f"{where}, line 1: the columns are separated by {called}: expected commas")
    return names


def _read_fast(data: bytes, names: list[str]) -> NDArray[np.float64] | None:
    """The table in the file's own column order, or None if anything at all is unusual."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    try:
        table = arrow_csv.read_csv(
            pa.BufferReader(data.rstrip()),  # blank lines at the end are no reason to read slowly
            # parallel blocks cost more than they gain below some 10 MB, and one thread is one order of events
            read_options=arrow_csv.ReadOptions(column_names=names, skip_rows=1, use_threads=len(data) > 10_000_000),
            parse_options=arrow_csv.ParseOptions(ignore_empty_lines=False),
            convert_options=arrow_csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.float64()), null_values=[], quoted_strings_can_be_null=False
            ),
        )
    except (pa.ArrowException, ValueError):
        return None
    if any(column.null_count for column in table.columns):
        return None
    return np.column_stack([column.to_numpy() for column in table.columns])


def _read_slowly(text: str, names: list[str], where: str) -> tuple[NDArray[np.float64], list[int]]:
    """The table, in the file's own column order, and the file's line number of each row.

    Raises:
        RecordingError: the first line that is no row of numbers.
    """
    rows: list[list[float]] = []
    lines: list[int] = []
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            line = reader.line_num
            if line == 1 or not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(names):
                last = " (the last line: the file may be cut off)" if line > text.rstrip().count("\n") else ""
                raise RecordingError(
                    f"{where}, line {line} has {len(cells)} cells{last}: expected {len(names)}, as the header has"
                )
            rows.append([_number(cell.strip(), name, line, where) for cell, name in zip(cells, names, strict=True)])
            lines.append(line)
    except csv.Error as error:
        raise RecordingError(f"{where}, line {reader.line_num} cannot be read as CSV: {error}") from None
    return np.array(rows, dtype=float).reshape(len(rows), len(names)), lines


def _number(cell: str, name: str, line: int, where: str) -> float:
    if _NUMBER.fullmatch(cell) or _NOT_FINITE.fullmatch(cell):
        return float(cell)
    if not cell:
        raise RecordingError(f"{where}, line {line}: {name} is empty: expected a number")
    shown = cell if len(cell) <= 24 else cell[:24] + "…"
    raise RecordingError(f"{where}, line {line}: {name} is {shown!r}: expected a number with a decimal point")
