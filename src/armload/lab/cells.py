"""Cells: measurements that are never made twice, one JSON file each.

A cell carries its `name` and a `key` made of everything its numbers depend on; one whose key is still right is not
measured again. So what takes hours may stop at any time, on any machine, and go on.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from armload.errors import DatasetError
from armload.runtime.atomic import replacing


def key_of(*parts: Any) -> str:
    """SHA-256 of anything that JSON can hold.

    >>> key_of({"a": 1, "b": 2}) == key_of({"b": 2, "a": 1}) != key_of({"a": 1})
    True
    """
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def load_cells(folder: str | Path, damaged: list[Path] | None = None) -> dict[str, dict[str, Any]]:
    """The finished cells in a folder, by name.

    Args:
        damaged: gets the files that are not cells, which are passed over; None: there must be none.

    Raises:
        DatasetError: a file that is not a cell, where `damaged` is None.
    """
    cells = {}
    for path in sorted(Path(folder).glob("*.json")):
        if path.name.startswith("."):  # cut off
            continue
        if (cell := _read(path)) is not None:
            cells[cell["name"]] = cell
        elif damaged is not None:
            damaged.append(path)
        else:
            raise DatasetError(f"{path} is not a cell: delete it, and it will be measured again")
    return cells


def of_damaged(files: Sequence[Path]) -> str:
    """The sentence on files that are passed over because they are not cells."""
    count = "1 file is" if len(files) == 1 else f"{len(files)} files are"
    return f"{count} no whole cell ({files[0]}{', …' * (len(files) > 1)}): what is missing is measured again"


def finished_cell(folder: str | Path, name: str, key: str) -> dict[str, Any] | None:
    """The cell of a name if its file is there, whole and with that key, whoever measured it; None otherwise."""
    path = Path(folder) / f"{name}.json"
    cell = _read(path) if path.is_file() else None
    return cell if cell is not None and cell.get("key") == key else None


def save_cell(folder: str | Path, cell: dict[str, Any], indent: int | None = 1) -> Path:
    """Write a finished cell; the file appears whole or not at all.

    Args:
        indent: of the JSON; None: all on one line.
    """
    path = Path(folder) / f"{cell['name']}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(cell, indent=indent, allow_nan=False) + "\n", encoding="utf-8")
    return path


def _read(path: Path) -> dict[str, Any] | None:
    """The cell in a file; None: it is damaged, or another file."""
    try:
        cell = json.loads(path.read_text(encoding="utf-8"))
        return cell if isinstance(cell["name"], str) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None
