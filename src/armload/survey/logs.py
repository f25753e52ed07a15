"""Which logs there are: files, folders, globs, lists and object stores become units of work, each known by its content.

What lies behind a path is asked of `os.path`, to which a path that cannot be asked (no access, a name too long, a loop
of links) is not there: its row says why. `Path` would raise, and end the survey.

A unit is what is answered at a time and what an interruption loses at most: a log file, a ROS 2 bag's folder, or an
episode of a LeRobot data set.
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from armload.errors import ArmloadError, UsageError
from armload.recording import (
    LOG_SUFFIXES,
    PACKED_SUFFIXES,
    data_set_columns,
    data_set_episodes,
    is_data_set,
    is_log,
    is_part_of_bag,
    log_in,
)
from armload.recording.bag_parts import PART_SUFFIXES
from armload.survey.content import episode_hash, file_hash, is_special
from armload.survey.remarks import may_be_log, of_passed
from armload.survey.stores import WILD, is_url, logs_in, stamp_of


@dataclass(frozen=True)
class Log:
    """A unit of work.

    name: path or URL, as it was found. arm: whose log it is; empty: nobody's.
    episode: of a data set; None: whatever the file holds.
    files: whose content the answer depends on; of a URL none. columns: what a data set says of its columns elsewhere.
    """

    name: str
    arm: str = ""
    episode: int | None = None
    files: tuple[Path, ...] = ()
    columns: str = ""

    @property
    def remote(self) -> bool:
        """Whether it is in an object store."""
        return is_url(self.name)

    @property
    def there(self) -> bool:
        """Whether any of its files is there; of an object nobody knows before it is fetched."""
        return self.remote or self.episode is not None or any(os.path.exists(file) for file in self.files)

    def stamp(self) -> str:
        """What changes with the content and is known without reading it: sizes and times, or the store's own key.

        Raises:
            OSError: a file or an object is not there, or its store does not answer.
        """
        if self.remote:
            return stamp_of(self.name)
        seen = [(str(file), (about := file.stat()).st_size, about.st_mtime_ns) for file in self.files]
        return hashlib.sha256((repr(seen) + self.columns).encode()).hexdigest()

    def content(self) -> str:
        """SHA-256 of the content, of an episode's rows; of an object the store's own key, which changes with it.

        Raises:
            OSError: a file cannot be read.
        """
        if self.remote:
            return self.stamp()
        of = self.episode
        parts = [file_hash(file) if of is None else episode_hash(file, of) for file in self.files]
        return hashlib.sha256("".join([*parts, self.columns]).encode()).hexdigest()

    @property
    def packed(self) -> bool:
        """Whether it is a packed file on this machine."""
        return not self.remote and len(self.files) == 1 and self.files[0].suffix.lower() in PACKED_SUFFIXES

    def unpacked(self) -> str:
        """Of a packed log, the `content` that it has unpacked.

        Raises:
            RecordingError: it cannot be unpacked. OSError: a file cannot be read.
        """
        with log_in(self.files[0]) as plain:
            return hashlib.sha256(file_hash(plain).encode()).hexdigest()


def cells_of(table: str | Path) -> Path:
    """The folder of a survey's cells, beside its table."""
    table = Path(table)
    return table.with_name(f"{table.name}.cells")


def find_logs(
    paths: Sequence[str], arm_of: str | None = None, without: Sequence[Path] = (), passed: set[str] | None = None
) -> list[Log]:
    """All logs behind some paths, each once, by name.

    Args:
        paths: files; folders, searched to their bottom for files with the suffix of a log; globs (`**` too); URLs with
            globs; and `@LIST`, a file with one of these on each line. What is named itself is a log whatever its name.
        arm_of: a regular expression searched in a log's path: its first group names the arm; a log that it does not
            fit has none. None: the folder that the log lies in; a ROS 2 bag lies in that of its folder.
        without: files and folders that are passed over, as the survey's own. In folders, the tables of other surveys
            are, too.
        passed: gets the names of files in folders that are passed over, and may be logs (`may_be_log`).

    Raises:
        UsageError: nothing was found, a list cannot be read, or an expression is none, has no group or fits no log.
    """
    pattern = _expression(arm_of)
    hidden = {os.path.realpath(path) for path in without}
    found: dict[tuple[str, int | None], Log] = {}
    passed = set() if passed is None else passed
    for path in _expanded(paths, passed):
        for log in _units(path, hidden, passed):
            found.setdefault((log.name, log.episode), replace(log, arm=_arm(log.name, pattern)))
    passed -= {name for name, _ in found}  # one may have been named itself
    if not found:
        expected = f"expected files with the suffix {', '.join(LOG_SUFFIXES)}, or data sets"
        also = f"; {of_passed(sorted(passed))}" if passed else ""
        raise UsageError(f"no log in {', '.join(paths)}: {expected}{also}")
    if not any(log.arm for log in found.values()):
        raise UsageError(f"--arm-of {arm_of!r} names no arm in {next(iter(found.values())).name}, nor in any other log")
    return [found[key] for key in sorted(found, key=lambda key: (key[0], -1 if key[1] is None else key[1]))]


def _expression(arm_of: str | None) -> re.Pattern[str] | None:
    if arm_of is None:
        return None
    try:
        pattern = re.compile(arm_of)
    except re.error as error:
        raise UsageError(f"--arm-of {arm_of!r} is no regular expression: {error}") from None
    if pattern.groups < 1:
        raise UsageError(f"--arm-of {arm_of!r} has no group: expected one that names the arm, such as 'cell-([0-9]+)'")
    return pattern


def _arm(name: str, pattern: re.Pattern[str] | None) -> str:
    if pattern is None:
        whole = PurePosixPath(name).parent if _in_bag(name) else PurePosixPath(name)
        return whole.parent.name or Path(os.path.realpath(whole)).parent.name or "/"
    match = pattern.search(name)
    return "" if match is None else match[1] or ""


def _in_bag(name: str) -> bool:
    """Whether this is a file of a ROS 2 bag's folder."""
    path = Path(name)
    return is_part_of_bag(path) or (
        path.suffix.lower() in PART_SUFFIXES and os.path.isfile(path.parent / "metadata.yaml")
    )


def _is_bag(folder: Path, inside: Sequence[Path]) -> bool:
    """Whether this is the folder of a ROS 2 bag: by its metadata or, where these are lost, the names of its files."""
    if os.path.isfile(folder / "metadata.yaml"):
        return True
    logs = [path for path in inside if not path.name.startswith(".") and (os.path.isdir(path) or is_log(path))]
    return bool(logs) and all(is_part_of_bag(path) and os.path.isfile(path) for path in logs)


def _expanded(paths: Sequence[str], passed: set[str], within: tuple[str, ...] = ()) -> Iterator[str]:
    """The paths that are meant; `within`: the lists that they stand in, one in the other. passed: as of `find_logs`."""
    for path in paths:
        if path.startswith("@"):
            here = Path(path[1:])
            if (real := os.path.realpath(here)) in within:
                raise UsageError(f"the list {here} names itself, directly or through another list: leave that line out")
            yield from _expanded(_lines(here), passed, (*within, real))
        elif is_url(path):
            yield from logs_in(path, passed)
        elif WILD.search(path) and not os.path.exists(path):
            yield from sorted(glob.glob(path, recursive=True))
        else:
            yield path


def _lines(file: Path) -> list[str]:
    """What a list names, without comments (#); a mark of the byte order, which Windows writes, is not in the first."""
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"the list {file} cannot be read: {error}") from None
    if "\0" in text:
        raise UsageError(f"the list {file} holds bytes of zero, as of find -print0: expected one path on each line")
    lines = [line.strip() for line in text.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def _units(path: str, hidden: set[str], passed: set[str]) -> Iterator[Log]:
    """Every unit behind a path, of no arm yet; links to folders come last, so that logs are found where they lie.

    hidden: real paths that are passed over (`Path.resolve` raises of a loop of links); a folder is one from then on.
    passed: as of `find_logs`.
    """
    ways = [path]
    for way in ways:
        yield from _units_of(way, hidden, passed, ways)


def _units_of(path: str, hidden: set[str], passed: set[str], links: list[str]) -> Iterator[Log]:
    """As `_units`, without what links in it lead to, if these are folders: they are added to `links`."""
    here = Path(path)
    if is_url(path):
        yield Log(path)
    elif not os.path.isdir(here) or (inside := _inside(here)) is None:
        yield Log(path, files=(here,))
    elif is_data_set(here):
        yield from _episodes(here)
    elif _is_bag(here, inside):
        yield Log(str(here), files=tuple(file for file in inside if os.path.isfile(file)))
    elif (real := os.path.realpath(here)) not in hidden:
        hidden.add(real)
        for inner in inside:
            if inner.name.startswith(".") or os.path.realpath(inner) in hidden or of_survey(inner):
                continue
            is_folder = os.path.isdir(inner)
            if is_folder and os.path.islink(inner):
                links.append(str(inner))
            elif is_folder or (is_log(inner) and not is_special(inner)):
                yield from _units_of(str(inner), hidden, passed, links)
            elif os.path.isfile(inner) and may_be_log(inner):
                passed.add(str(inner))


def _inside(folder: Path) -> list[Path] | None:
    """What lies in a folder, by name; None: it is not ours to read, or gone, and its row will say so."""
    try:
        return sorted(folder.iterdir()) if os.access(folder, os.X_OK) else None
    except OSError:
        return None


def of_survey(path: Path) -> bool:
    """Whether this is the table of a survey, or its folder of cells (`cells_of`)."""
    table = path.with_suffix("") if path.suffix == ".cells" else path
    return os.path.isfile(table) and os.path.isdir(cells_of(table))


def _episodes(folder: Path) -> Iterator[Log]:
    """Each episode by its own rows and columns: meta/info.json also counts episodes, and changes with each new one."""
    try:
        episodes, columns = data_set_episodes(folder), data_set_columns(folder)
    except ArmloadError:  # its one row will say why
        yield Log(str(folder), files=(folder / "meta" / "info.json",))
        return
    for episode, file in episodes.items():
        yield Log(str(folder), "", episode, (file,), columns)
