"""A survey as a file: Parquet, CSV or JSON by its suffix, the same rows and columns in each."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from armload.errors import UsageError
from armload.runtime.atomic import replacing
from armload.runtime.extras import require
from armload.survey.rows import FLAG, NUMBER, TEXT, WHOLE, columns

SUFFIXES = (".parquet", ".csv", ".json")
_OF_SURVEY = {"log", "status", "reason"}  # columns that no log has
_JOINTS = "offset_"  # columns that tell how many joints there are


def check_suffix(path: str | Path) -> Path:
    """The path, if it names a form that can be written.

    Raises:
        UsageError: it does not.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: unsupported suffix {path.suffix!r}: expected {', '.join(SUFFIXES)}")
    return path


def require_form(path: Path) -> None:
    """See that what writes a table of this form is there, before the work that it is to hold begins.

    Raises:
        ModuleNotFoundError: pyarrow is not installed; the sentence says how to install it.
    """
    if path.suffix.lower() == ".parquet":
        require("pyarrow")


def write_rows(path: str | Path, rows: Sequence[dict[str, Any]], n: int) -> None:
    """Write rows of arms with n joints; the file appears whole or not at all, and equal rows make equal bytes.

    Raises:
        UsageError: unknown suffix. OSError: it cannot be written. ModuleNotFoundError: pyarrow is not installed.
    """
    path, kinds = check_suffix(path), columns(n)
    rows = [{name: whole(row.get(name)) for name in kinds} for row in rows]
    suffix = path.suffix.lower()
    with replacing(path) as temporary:
        if suffix == ".parquet":
            _write_parquet(temporary, rows, kinds)
        elif suffix == ".csv":
            with temporary.open("w", encoding="utf-8", newline="") as file:
                _write_csv(file, rows, kinds)
        else:
            temporary.write_text(json.dumps(rows, indent=0, allow_nan=False) + "\n", encoding="utf-8")


def read_rows(path: str | Path) -> tuple[list[dict[str, Any]], int]:
    """The rows of a survey, and how many joints its arms have.

    Raises:
        UsageError: there is no such file, or it is no survey. ModuleNotFoundError: pyarrow is not installed.
    """
    path = check_suffix(path)
    if not path.is_file():
        raise UsageError(f"{path} is not there: expected what `armload survey … --out {path.name}` writes")
    try:
        if path.suffix.lower() == ".parquet":
            from pyarrow import parquet

            rows = parquet.read_table(path, use_threads=False).to_pylist()
        elif path.suffix.lower() == ".csv":
            with path.open(encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file))
        else:
            rows = json.loads(path.read_text(encoding="utf-8"))
        if not rows:
            raise ValueError("it has no rows")
        n = sum(name.startswith(_JOINTS) for name in rows[0])
        kinds = columns(n)
        if not set(rows[0]) >= _OF_SURVEY:
            raise UsageError(
                f"{path} is no table of a survey, but a log or another table: expected what `armload survey` wrote"
            )
        if set(kinds) != set(rows[0]):
            raise ValueError("its columns are those of another version: run the survey again")
        if path.suffix.lower() == ".csv":
            rows = [{name: _read(row[name], kind) for name, kind in kinds.items()} for row in rows]
        return rows, n
    except (ModuleNotFoundError, UsageError):
        raise
    except Exception as error:  # a damaged file can fail anywhere in the decoder
        raise UsageError(
            f"{path} is no survey that can be read ({error}): expected what `armload survey` wrote"
        ) from None


def logs_in_table(path: Path) -> set[tuple[str, str]] | None:
    """The logs that a survey's table names, with the keys of their rows, of whatever version; None: no such table."""
    try:
        if path.suffix.lower() == ".parquet":
            from pyarrow import parquet

            names = set(parquet.read_schema(path).names)
            rows = parquet.read_table(path, columns=["log", "key"], use_threads=False).to_pylist()
        elif path.suffix.lower() == ".csv":
            with path.open(encoding="utf-8", newline="") as file:
                reader = csv.DictReader(file)
                names = set(reader.fieldnames or ())
                rows = [{"log": row["log"], "key": row.get("key", "")} for row in reader]
        else:
            rows = json.loads(path.read_text(encoding="utf-8"))
            names = set(rows[0])
        return {(row["log"], row.get("key", "")) for row in rows} if names >= _OF_SURVEY else None
    except ModuleNotFoundError:
        raise
    except Exception:  # a damaged file can fail anywhere in the decoder
        return None


def _write_parquet(path: Path, rows: Sequence[dict[str, Any]], kinds: dict[str, str]) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    types = {TEXT: pa.string(), WHOLE: pa.int64(), FLAG: pa.bool_(), NUMBER: pa.float64()}
    schema = pa.schema([(name, types[kind]) for name, kind in kinds.items()])
    made = [pa.array([row[name] for row in rows], types[kind]) for name, kind in kinds.items()]
    parquet.write_table(pa.Table.from_arrays(made, schema=schema), path, compression="zstd")


def _write_csv(file: TextIO, rows: Sequence[dict[str, Any]], kinds: dict[str, str]) -> None:
    """Lines that end as on Unix; a carriage return, which a file's name may have, would end one where it is bare."""
    plain = csv.writer(file, lineterminator="\n")
    quoted = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL)
    plain.writerow(kinds)
    for row in rows:
        cells = [_cell(row[name]) for name in kinds]
        (quoted if any("\r" in cell for cell in cells) else plain).writerow(cells)


def whole(value: Any) -> Any:
    """A value that every form can hold: a path whose bytes are no UTF-8 has them written out, as \\xff."""
    if isinstance(value, str):
        return value.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return value


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


def _read(cell: str, kind: str) -> Any:
    if kind == TEXT:
        return cell
    if cell == "":
        return None
    if kind == FLAG:
        return {"true": True, "false": False}[cell.lower()]  # a spreadsheet writes TRUE; what is neither is no flag
    return int(cell) if kind == WHOLE else float(cell)
