"""A survey: every log answered once, kept as it is finished, and all of them in one table.

Beside the table lies a folder of cells (`armload.lab.cells`), one for each log, with the key of all that its rows
depend on. A log whose key is still right is not answered again, so that a survey may be stopped in any way and go on,
and grows with its logs.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armload.errors import UsageError
from armload.identification.choice import choose
from armload.identification.methods import METHODS
from armload.lab.cells import load_cells, of_damaged
from armload.lab.experiment import Task, run_tasks
from armload.survey.answering import answer_log, lost_log
from armload.survey.logs import Log, cells_of, find_logs
from armload.survey.remarks import copies_among, of_bags, of_copies, of_frames, of_left_out, of_passed
from armload.survey.rows import UNUSABLE, as_copy
from armload.survey.settings import Settings
from armload.survey.table_file import check_suffix, logs_in_table, require_form, whole, write_rows

_MOST_NAMED = 5  # arms in a sentence: each row has the note of its own
_MISSING = "missing"  # content of a file that cannot be read


@dataclass(frozen=True)
class Survey:
    """What a survey found: rows, sorted by log, episode and time; how many logs, how many of them answered anew.

    passed: files in folders that may be logs, in forms that folders are not searched for.
    """

    rows: list[dict[str, Any]]
    logs: int
    anew: int
    passed: tuple[str, ...] = ()

    @property
    def unusable(self) -> int:
        """Rows of logs, or episodes, that cannot be answered."""
        return sum(row["status"] == UNUSABLE for row in self.rows)


def survey(
    paths: Sequence[str],
    settings: Settings,
    out: str | Path,
    *,
    arm_of: str | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    say: Callable[[str], None] = lambda _: None,
) -> Survey:
    """Answer every log behind some paths, and write one table.

    Args:
        paths, arm_of: as of `find_logs`.
        settings: what is asked of every log.
        out: the table, .parquet, .csv or .json. What is finished is kept beside it (`cells_of`).
        jobs: processes; None: as many as there are cores. cluster: as of `armload.lab.engine.engine`.
        progress: called as progress(done, total) after every log. say: called with what is being done.

    Raises:
        UsageError: no log was found, something that is named for all logs is not there, or `out`, or what stands where
            its cells are kept, is there and is not of a survey.
        ArmloadError: the arm or the method is unknown, or a profile, a tool or a model cannot be read.
        OSError: the table or a cell cannot be written.
        ModuleNotFoundError: what writes the table is not installed; no log is read.
    """
    out, jobs = check_suffix(out), jobs or os.cpu_count() or 1
    require_form(out)
    if (folder := cells_of(out)).exists() and not folder.is_dir():
        raise UsageError(
            f"{folder} is there and is no folder: expected none, or that of a survey, which keeps there what is "
            "answered; move it away, or give another --out"
        )
    named = [Path(p) for p in (settings.tool, settings.tare, settings.profile) if p is not None]
    earlier = _earlier(out)
    logs = find_logs(paths, arm_of, without=[out, folder, *named], passed=(passed := set()))
    if tares := settings.tares_of({log.arm for log in logs} - {""}):  # they may lie among the logs
        logs = find_logs(paths, arm_of, without=[out, folder, *named, *tares], passed=(passed := set()))
    n = settings.arm().n
    # what all logs of an arm would fail of is said before the first is answered
    arms = sorted({log.arm for log in logs} - {""})
    for arm in arms:
        settings.profile_of(arm)
    for what in ("tare", "profile"):
        if without := settings.arms_without(what, arms):
            of = ", ".join(without[:_MOST_NAMED]) + ", …" * (len(without) > _MOST_NAMED)
            say(f"no --{what} {getattr(settings, what)} of {len(without)} of {len(arms)} arms ({of}): answered without")
    left_out = of_left_out(out, {name for name, _ in earlier}, {whole(log.name) for log in logs})
    for remark in (of_passed(sorted(passed)), of_bags((log.name, log.files) for log in logs), left_out):
        if remark:
            say(remark)
    settings.mounted()
    _check_method(settings)
    count = "1 log" if len(logs) == 1 else f"{len(logs)} logs"
    before = load_cells(folder, damaged := [])
    if damaged:
        say(of_damaged(damaged))
    keys, frame = {key for _, key in earlier}, str(settings.arm().frame)
    frames = {cell.get("frame", frame) for cell in before.values() if cell.get("key") in keys}
    if remark := of_frames(out, frames, frame):
        say(remark)
    # what was answered once may be away for a while: its row says so
    if not any(log.there or _name(log, settings) in before for log in logs):
        raise UsageError(f"{', '.join(paths)}: no such file or folder: expected logs, folders, globs or URLs")
    say(f"{count}: asking which have changed")
    with ThreadPoolExecutor(jobs) as pool:
        tasks = list(pool.map(lambda log: _task(log, settings, before.get(_name(log, settings))), logs))
    fresh = {t.name for t in tasks if before.get(t.name, {}).get("key") != t.keys[t.name]}
    say(f"{count}, {len(fresh)} of them new or changed")
    cells = run_tasks(
        [task for task in tasks if task.name in fresh],
        folder,
        jobs=min(jobs, max(len(fresh), 1)),
        cluster=cluster,
        progress=progress,
        lost=_lost,
    )
    of_each = [cells.get(task.name) or before[task.name] for task in tasks]
    answered = [(log, cell) for log, cell in zip(logs, of_each, strict=True) if cell["rows"][0]["status"] != UNUSABLE]
    # a cell of an earlier version knows its content as it is packed only
    copies = copies_among((log.name, log.episode, cell.get("unpacked", cell["content"])) for log, cell in answered)
    if remark := of_copies(copies):
        say(remark)
    rows = [as_copy(row, copies.get((row["log"], row["episode"]))) for cell in of_each for row in cell["rows"]]
    rows.sort(key=lambda row: (row["log"], -1 if row["episode"] is None else row["episode"], row.get("part") or 0))
    write_rows(out, rows, n)
    return Survey(rows, len(logs), len(fresh), tuple(sorted(passed)))


def _earlier(out: Path) -> set[tuple[str, str]]:
    """The logs of the table that will be replaced, with the keys of their rows.

    Raises:
        UsageError: what is there is no table of a survey, but a log, say.
    """
    if not out.is_file() or not out.stat().st_size:
        return set()
    logs = logs_in_table(out)
    if logs is None and not cells_of(out).is_dir():
        raise UsageError(
            f"--out {out} is there, and is no table of a survey: a table would take its place; give another name"
        )
    return logs or set()


def _check_method(settings: Settings) -> None:
    """See that the method is one that logs can be asked with: whether it fits an arm's tare, each row will say."""
    known = METHODS.get(settings.method or "")
    if settings.method is not None and not (known is not None and known.needs == "tare" and settings.tare is not None):
        choose(settings.arm(), method=settings.method)


def _name(log: Log, settings: Settings) -> str:
    """Of a log's cell: what kind of file systems allow; it tells logs of one name apart, and two arms of a log."""
    text = f"{log.name}\n{log.episode}" + ("" if settings.frame is None else f"\n{settings.frame}")
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:24]  # a name on disk may be no UTF-8


def _task(log: Log, settings: Settings, before: dict[str, Any] | None) -> Task:
    try:
        stamp = log.stamp()
        same = before is not None and before.get("stamp") == stamp
        content = before["content"] if same and before is not None else log.content()
    except (OSError, ValueError):  # its row will say why
        stamp, content = "", _MISSING
    key, name = settings.key(log, content), _name(log, settings)
    return Task.of_one(name, key, answer_log, log, settings, key, stamp, content)


def _lost(task: Task) -> dict[str, dict[str, Any]]:
    log, key = task.parameters[1], task.parameters[3]
    return {task.name: lost_log(log, key)}
