"""From one log to its rows. Whatever is wrong with the log is said in a row: a survey never stops at one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from threadpoolctl import threadpool_limits

from armload.errors import ArmloadError, EpisodesError, RecordingError, one_line
from armload.identification import identify
from armload.runtime.atomic import FULL
from armload.runtime.version import __version__
from armload.survey.content import NO_FILE, is_special
from armload.survey.logs import Log
from armload.survey.rows import SEPARATOR, UNUSABLE, answered, unusable
from armload.survey.settings import Settings
from armload.survey.sliding import slides_of_parts
from armload.survey.stores import filesystem


def answer_log(log: Log, settings: Settings, key: str, stamp: str, content: str) -> dict[str, Any]:
    """The cell of a log: its rows, and what is known of its content (`Log.stamp`, `Log.content`)."""
    about = {"log": log.name, "arm": log.arm, "episode": log.episode, "version": __version__, "key": key}
    with threadpool_limits(limits=1):  # sums of several threads have another order: the same numbers on any machine
        try:
            rows = _rows(log, settings, about)
        except _Unread as error:
            return _anew(unusable(str(error), about))
    if stamp and len(rows) == 1 and rows[0]["status"] == UNUSABLE and not _stayed(log, stamp):
        return _anew(rows[0])
    told = {"stamp": stamp, "content": content, "unpacked": _unpacked(log, content)}
    return {"rows": rows, "frame": settings.arm().frame} | told


def lost_log(log: Log, key: str) -> dict[str, Any]:
    """The cell of a log whose worker ended again and again; it is tried anew next time."""
    about = {"log": log.name, "arm": log.arm, "episode": log.episode, "version": __version__, "key": key}
    reason = f"{log.name}: the process that worked on it was killed each time: too little memory for so large a log?"
    return _anew(unusable(reason, about))


class _Unread(RecordingError):
    """A log that could not be fetched or held just now, which says nothing of its content."""


def _unpacked(log: Log, content: str) -> str:
    """What tells copies of a log, packed or not; its content where it cannot be unpacked."""
    try:
        return log.unpacked() if content and log.packed else content
    except (ArmloadError, OSError):
        return content


def _stayed(log: Log, stamp: str) -> bool:
    """Whether a log is there still, and as it was."""
    try:
        return log.stamp() == stamp
    except (OSError, ValueError):
        return False


def _anew(row: dict[str, Any]) -> dict[str, Any]:
    """The cell of a log that is tried again next time: no key is this one."""
    return {"rows": [row], "key": "", "stamp": "", "content": ""}


def _rows(log: Log, settings: Settings, about: dict[str, Any]) -> list[dict[str, Any]]:
    if not log.arm:
        return [unusable(f"{log.name}: --arm-of names no arm in its path", about)]
    try:
        with on_this_machine(log) as path:
            try:
                return _of_one(log, settings, path, about)
            except EpisodesError as error:
                of_each = []
                for episode in error.episodes:
                    of_each += _of_episode(log, settings, path, about | {"episode": episode})
                return of_each
    except _Unread:
        raise
    except MemoryError:
        why = "too little memory for it: the next run of the survey tries it again; give that fewer processes (--jobs)"
        raise _Unread(f"{log.name}: {why}") from None
    except Exception as error:
        if _of_machine(error):
            raise _Unread(f"{_reason(error)}: the next run of the survey tries it again") from None
        return [unusable(_reason(error), about)]


def _of_episode(log: Log, settings: Settings, path: Path, about: dict[str, Any]) -> list[dict[str, Any]]:
    try:
        return _of_one(log, settings, path, about)
    except MemoryError:  # of the whole log
        raise
    except Exception as error:
        if _of_machine(error):
            raise
        return [unusable(_reason(error), about)]


def _of_one(log: Log, settings: Settings, path: Path, about: dict[str, Any]) -> list[dict[str, Any]]:
    recording = settings.recording(log, path, about["episode"])
    about = about | {"date": recording.date}
    arm, tare, profile = settings.arm(), settings.tare_of(log.arm), settings.profile_of(log.arm)
    try:
        found = identify(
            recording,
            arm,
            tare=tare,
            profile=profile,
            tool=settings.mounted(),
            method=settings.method,
        )
    except ArmloadError as error:
        return [unusable(str(error), about)]
    known = (None, None) if found.another else (tare, profile)
    rows, lacking = answered(found, about, slides_of_parts(found, recording, arm, *known)), settings.lacking(log.arm)
    for row in rows:
        row["notes"] = SEPARATOR.join(filter(None, [*lacking, row["notes"]]))
    return rows


def _of_machine(error: BaseException | None) -> bool:
    """Whether the system could not do something just now, which says nothing of the log; it has a number for each."""
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None:
            return True
        error = error.__context__
    return False


def _reason(error: Exception) -> str:
    if isinstance(error, ArmloadError):
        return str(error)
    if isinstance(error, OSError) and error.errno in FULL:
        why = f"{error.filename or 'the disk'} has no room for its samples: {error.strerror}"
        return f"{why}; free some there, or name another folder with TMPDIR"
    if isinstance(error, OSError):
        return f"{error.filename or 'the log'} cannot be read: {error.strerror or one_line(error)}"
    return f"{type(error).__name__}: {one_line(error)}; this is a bug in armload: identify the log alone to see where"


@contextmanager
def on_this_machine(log: Log) -> Iterator[Path]:
    """The log as a path on this machine; an object is fetched, and removed afterwards.

    Raises:
        RecordingError: it is no regular file, or its store does not give it.
    """
    if not log.remote:
        if special := next((file for file in log.files if is_special(file)), None):
            raise RecordingError(f"{special} cannot be read: {NO_FILE}")
        yield Path(log.name)
        return
    fs, path = filesystem(log.name)
    with tempfile.TemporaryDirectory() as folder:
        local = Path(folder) / PurePosixPath(path).name
        try:
            fs.get_file(path, str(local))
        except Exception as error:  # each store's package has its own
            why = f"{type(error).__name__}: {one_line(error)}"
            raise _Unread(f"{log.name} cannot be fetched ({why}): the next run of the survey tries it again") from None
        yield local
