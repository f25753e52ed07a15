"""What a survey says of its logs as a whole: files it passed over, logs that leave its table, bags, copies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

from armload.recording import NAMED_SUFFIXES, PACKED_SUFFIXES, is_log, is_part_of_bag

_MOST_NAMED = 3  # files in a sentence
# of spreadsheets, archives, and what other programs keep measured series in
_OTHERS = {
    *(".xlsx", ".xls", ".xlsm", ".xlsb", ".ods"),
    *(".tar", ".tgz", ".tbz2", ".txz", ".7z", ".rar"),
    *(".feather", ".arrow", ".orc", ".pq", ".pkl", ".pickle", ".jsonl", ".hdf", ".tdms", ".mf4"),
}
_UNFINISHED = {".active", ".part", ".partial", ".filepart", ".crdownload", ".tmp"}  # of a log that is being written


def may_be_log(path: str | Path) -> bool:
    """Whether a file that is no log by its name (`is_log`) may be one in a form that no folder is searched for.

    >>> [may_be_log(name) for name in ("a.xlsx", "a.bag.active", "month.tar.gz", "notes.md", "notes.md.gz")]
    [True, True, True, False, False]
    """
    name = PurePosixPath(path)
    suffix = name.suffix.lower()
    if suffix in PACKED_SUFFIXES:
        return PurePosixPath(name.stem).suffix.lower() in ("", ".tar", *NAMED_SUFFIXES)
    return suffix in _OTHERS or suffix in NAMED_SUFFIXES or (suffix in _UNFINISHED and is_log(name.stem))


def of_passed(names: Sequence[str]) -> str:
    """The sentence on files in folders that may be logs and were passed over; empty: there are none."""
    if not names:
        return ""
    kinds = Counter(PurePosixPath(name).suffix.lower() for name in names)
    which = ", ".join(f"{count} {suffix}" for suffix, count in sorted(kinds.items()))
    some = sorted(name for name in names if PurePosixPath(name).suffix.lower() not in NAMED_SUFFIXES) or sorted(names)
    read = [suffix for suffix in sorted(kinds) if suffix in (*NAMED_SUFFIXES, ".zip")]
    advice = []
    if len(read) < len(kinds):
        advice.append("save or unpack what is a log in a form that is read (docs/recordings.md)")
    if read:
        verb = "are" if len(read) > 1 else "is"
        advice.append(f"{', '.join(read)} {verb} read where a path or a glob names the file")
    files = "1 file that may be a log" if len(names) == 1 else f"{len(names)} files that may be logs"
    return f"passed over {files}, by their endings ({which}: {_some(some)}): {'; '.join(advice)}"


def of_left_out(out: Path, before: Collection[str], now: Collection[str]) -> str:
    """The sentence on logs of a table that is there which the one in its place will not hold; empty: there are none."""
    gone = sorted(set(before) - set(now))
    if not gone:
        return ""
    logs = "1 log that is" if len(gone) == 1 else f"{len(gone)} logs that are"
    return (
        f"{out} holds {logs} not among those of this survey ({_some(gone)}): the new table leaves them out; to have "
        "all in one table, name all of them (none is answered twice), else give another --out"
    )


def of_frames(out: Path, before: Collection[str], now: str) -> str:
    """The sentence on other frames that a table, in whose place a new one comes, is about; empty: there are none."""
    others = sorted(set(before) - {now})
    if not others:
        return ""
    return (
        f"{out} is about the frame {', '.join(others)}: the new table, about {now}, takes its place; to have both give "
        "another --out (what was answered is kept: with the same --frame again, no log is answered twice)"
    )


def of_bags(logs: Iterable[tuple[str, Sequence[Path]]]) -> str:
    """The sentence on logs (name, files) that are bags by the names of several files alone; empty: there are none."""
    parts = {
        name: sum(map(is_part_of_bag, files))
        for name, files in logs
        if all(file.name != "metadata.yaml" for file in files)
    }
    bags = [f"{name}: {count} files" for name, count in parts.items() if count > 1]
    if not bags:
        return ""
    folders = "1 folder is read as one log" if len(bags) == 1 else f"{len(bags)} folders are read as one log each"
    return (
        f"{folders}, as a ROS 2 bag that has lost its metadata.yaml ({_some(bags)}): where every file is a log of its "
        "own, name the files, such as FOLDER/*.mcap"
    )


def copies_among(contents: Iterable[tuple[str, int | None, str]]) -> dict[tuple[str, int | None], str]:
    """Which logs (name, episode, content) have the content of another one, the first by name, and of which."""
    first: dict[tuple[int | None, str], str] = {}
    copies: dict[tuple[str, int | None], str] = {}
    for name, episode, content in sorted(contents, key=lambda log: log[0]):
        original = first.setdefault((episode, content), name)
        if content and original != name:
            copies[name, episode] = original
    return copies


def of_copies(found: Mapping[tuple[str, int | None], str]) -> str:
    """The sentence on logs that are copies (`copies_among`); empty: there are none."""
    if not found:
        return ""
    copies: dict[tuple[str, str], list[int | None]] = {}
    for (name, episode), original in found.items():
        copies.setdefault((name, original), []).append(episode)
    count = len(found)
    logs = "1 log is a copy" if count == 1 else f"{count} logs are copies"
    some = _some([f"{_named(name, of)} of {original}" for (name, original), of in copies.items()])
    return f"{logs} of others, packed or not ({some}): each counts as a log of its own"


def _named(name: str, episodes: Sequence[int | None]) -> str:
    """A log, or so many episodes of a data set."""
    return name if episodes == [None] else f"{name} ({len(episodes)} episode{'s' * (len(episodes) > 1)})"


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:_MOST_NAMED]) + ", …" * (len(names) > _MOST_NAMED)
