"""One runner for every experiment: what is not measured yet, over processes, each cell kept as soon as it is done.

An experiment is a list of tasks. A task measures one or more cells (`armload.lab.cells`), each with a key of everything
its numbers depend on; whatever has a file with the right key is not measured again, so that a run of hours may stop at
any time and go on anywhere.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from armload.errors import DatasetError
from armload.lab.cells import finished_cell, key_of, load_cells, of_damaged, save_cell
from armload.lab.engine import ATTEMPTS, engine
from armload.runtime.atomic import replacing
from armload.runtime.version import __version__, package_versions

Cells = dict[str, dict[str, Any]]  # by name


@dataclass(frozen=True)
class Task:
    """What one process measures at a time.

    name: shown to the user. keys: of its cells, by their names. measure: a function of a module, called as
    measure(names, *parameters) with the names of the cells that are missing; yields their numbers in that order, ready
    for JSON. unit: what its cells are called ("row"); their count is shown where a task may have several.
    """

    name: str
    keys: Mapping[str, str]
    measure: Callable[..., Iterable[dict[str, Any]]]
    parameters: tuple[Any, ...] = ()
    unit: str = ""

    @classmethod
    def of_one(cls, name: str, key: str, measure: Callable[..., dict[str, Any]], *parameters: Any) -> Task:
        """A task of a single cell: measure(*parameters) → its numbers."""
        return cls(name, {name: key}, _one, (measure, *parameters))

    def __str__(self) -> str:
        count = len(self.keys)
        return self.name + (f", {count} {self.unit}{'' if count == 1 else 's'}" if self.unit else "")


def run_tasks(
    tasks: Sequence[Task],
    folder: str | Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    until: float | None = None,
    say: Callable[[str], None] = lambda _: None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    lost: Callable[[Task], Cells] | None = None,
    part: str = "part",
    indent: int | None = None,
) -> Cells:
    """Measure what is not finished yet and return all finished cells of the tasks, by name.

    Args:
        tasks: in the order in which they are to be measured.
        folder: of the cells' files.
        jobs: processes; the numbers do not depend on it.
        cluster: a Dask cluster in place of them, as of `engine`; its workers see the files that tasks name.
        until: begin nothing after so many seconds.
        say: called with what is next. part: its word for a task.
        progress: called as progress(done, total) after every task.
        lost: makes the cells of a task whose process was killed `ATTEMPTS` times, by the system for want of memory,
            say; None: then the run ends with an error.
        indent: of the cells' JSON; None: each on one line.

    A file in the folder that is no whole cell counts as not measured, which is said.

    Raises:
        DatasetError: a task whose process was killed each time.
    """
    folder, started = Path(folder), time.monotonic()
    there = load_cells(folder, damaged := [])
    if damaged:
        say(of_damaged(damaged))
    keys = {name: key for task in tasks for name, key in task.keys.items()}
    cells = {name: there[name] for name, key in keys.items() if name in there and there[name].get("key") == key}
    lacking = [sum(name not in cells for name in task.keys) for task in tasks]
    waiting: dict[str, list[int]] = {}  # tasks by the cells that they lack
    for number, task in enumerate(tasks):
        for name in task.keys:
            if name not in cells:
                waiting.setdefault(name, []).append(number)
    finished = lacking.count(0)

    def unfinished() -> Iterator[Task]:
        for number, task in enumerate(tasks, start=1):
            missing = {name: key for name, key in task.keys.items() if name not in cells}
            if not missing:
                continue
            if until is not None and time.monotonic() - started > until:
                say(f"stopped before {part} {number} of {len(tasks)}: run it again to go on")
                return
            left = replace(task, keys=missing)
            say(f"{part} {number} of {len(tasks)}: {left}")
            yield left

    def keep(measured: Cells) -> None:
        nonlocal finished
        for cell in measured.values():  # where a worker's disk is not ours
            if finished_cell(folder, cell["name"], cell["key"]) is None:
                save_cell(folder, cell, indent)
        cells.update(measured)
        for name in measured:
            for number in waiting.pop(name, ()):
                lacking[number] -= 1
                finished += lacking[number] == 0
        progress(finished, len(tasks))

    with engine(jobs, cluster) as on:
        measured = partial(_measured, folder=folder, indent=indent)
        for task, found in on.each(measured, unfinished):
            if found is None:  # its process was killed each time
                if lost is None:
                    raise DatasetError(
                        f"{task}: the process that worked on it was killed {ATTEMPTS} times, by the system for want of "
                        "memory, say: expected it to end; run it with fewer --jobs"
                    )
                found = {name: {"name": name, "key": task.keys[name], **cell} for name, cell in lost(task).items()}
            keep(found)
    return {name: cells[name] for name in keys if name in cells}


def _measured(task: Task, folder: Path, indent: int | None) -> Cells:
    """The cells of a task; each is written where it was measured, whatever becomes of the others."""
    found = {name: finished_cell(folder, name, key) for name, key in task.keys.items()}  # by another run, meanwhile
    cells = {name: cell for name, cell in found.items() if cell is not None}
    missing = tuple(name for name in task.keys if name not in cells)
    if missing:
        for name, numbers in zip(missing, task.measure(missing, *task.parameters), strict=True):
            cell = {"name": name, "key": task.keys[name], **numbers}
            save_cell(folder, cell, indent)
            cells[name] = json.loads(json.dumps(cell))  # as another run would read it
    return cells


def _one(_: Sequence[str], measure: Callable[..., dict[str, Any]], *parameters: Any) -> Iterator[dict[str, Any]]:
    yield measure(*parameters)


# ---------------------------------------------------------------------- what a result rests on


def source_key(*paths: str | Path) -> str:
    """SHA-256 of the text of these files, folders with all their Python; of the whole package if none is named."""
    named = [Path(p) for p in paths] or [Path(__file__).resolve().parents[1]]
    files = [file for path in named for file in (sorted(path.rglob("*.py")) if path.is_dir() else [path])]
    return key_of(*((file.name, file.read_text(encoding="utf-8")) for file in files))


def provenance(command: str) -> dict[str, Any]:
    """What stands first in the file of a result: the command that repeats it, versions, the machine and its load."""
    return {
        "command": command,
        "version": __version__,
        "versions": {"python": platform.python_version(), **package_versions("numpy", "scipy", "pin", "mujoco")},
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "load": [round(x, 2) for x in os.getloadavg()],
    }


def listed(values: Any, digits: int = 7) -> Any:
    """Numbers of any shape as lists for JSON, to so many digits; None for what is not finite.

    >>> listed([[1.23456789, float("inf")]], 3)
    [[1.23, None]]
    """
    if np.ndim(values) > 0:
        return [listed(part, digits) for part in values]
    return float(f"{values:.{digits}g}") if np.isfinite(values) else None


def write_json(path: str | Path, content: Any, indent: int | None = 1) -> Path:
    """Write a result as JSON; the file appears whole or not at all, its folder is made.

    Args:
        indent: None: all on one line, without spaces.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    separators = (",", ":") if indent is None else None
    with replacing(path) as temporary:
        text = json.dumps(content, indent=indent, separators=separators, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    return path
