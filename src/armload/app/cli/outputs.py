"""What a command writes: never over what it reads, and only where it can be written, both asked before it begins."""

from __future__ import annotations

import argparse
import glob
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from armload.app.cli.arguments import OutputFile, OutputFolder, built_in_arms
from armload.errors import UsageError

# options whose text names no file, even where a file is called the same
_NO_FILES = {"action", "apply", "arm_of", "cluster", "effort_key", "format", "frame", "grip", "host", "kind", "mqtt"}
_NO_FILES |= {"command", "name", "publish", "sampler", "split", "study", "tare_topic", "to", "topic", "until"}
_NO_FILES |= {"methods", "populations", "webhook", "world"}
_BUILT_IN = {"franka-hand", "loadings", "none", "nothing", "rated", "sim", "taie2024", "test"}
_POSITIONAL = {"log", "logs", "motion", "path", "paths", "result", "source", "sources"}
_OF_FOLDERS = ("metadata.yaml", "provenance.json")  # of a ROS 2 bag, and of a data set, beside their logs
_META = "meta"  # of a LeRobot data set: all that is said of its episodes
_WRITES = 15.0  # [s] another command is waited for that writes the same file: megabytes, on a busy disk


class ChangedError(UsageError):
    """A file that is to be replaced is another one than was read."""


class _Input(NamedTuple):
    """A file or folder that a command reads, and how the command line names it."""

    path: Path
    said: str


def check_outputs(options: argparse.Namespace, *more: tuple[str, OutputFile]) -> None:
    """See that nothing is written over what the command reads, and that all it writes can be written.

    Args:
        options: of a command; what it writes are its `OutputFile`s and `OutputFolder`s, what it reads is any other text
            that names a file or folder.
        more: what it writes beside these: the option that they follow from, and the file.

    Raises:
        UsageError: an output is an input, too, or another output, or cannot be written.
    """
    given = [(_option(key), value) for key, value in vars(options).items() if isinstance(value, OutputFile)]
    outputs, inputs = [*given, *more], None
    folders = [value for value in vars(options).values() if isinstance(value, OutputFolder)]
    for k, (option, out) in enumerate(outputs):
        if any(_same(out, other) for other in (*folders, *(other for _, other in outputs[:k]))):
            raise UsageError(f"{option} {out} is written by another option, too: name another file")
        if os.path.exists(out) and not _is_stream(out):
            inputs = list(_inputs(options)) if inputs is None else inputs
            if found := next((one for one in inputs if _reads(one.path, Path(out))), None):
                which = f"it is part of {found.said}" if found.path.is_dir() else found.said
                raise UsageError(f"{option} {out} would replace what this command reads ({which}): name another file")
    for option, out in outputs:
        check_output(option, out)
    for key, value in vars(options).items():
        if isinstance(value, OutputFolder):
            check_output(_option(key), value)


def check_page(out: str) -> None:
    """See that a page is named as one; what is no plain file, such as /dev/stdout, has any name.

    Raises:
        UsageError: it has another ending.
    """
    if Path(out).suffix.lower() not in (".html", ".htm") and not _is_stream(out):
        raise UsageError(f"--out {out} is to be a page of HTML: expected a name that ends in .html")


def check_motion_file(out: str) -> None:
    """See that a motion's file is named as one; what is no plain file, such as /dev/stdout, has any name.

    Raises:
        UsageError: it has another ending.
    """
    if Path(out).suffix.lower() != ".json" and not _is_stream(out):
        raise UsageError(
            f"--out {out} is to be a motion: expected a name that ends in .json; `motion export` makes others of it"
        )


def check_output(option: str, path: str) -> None:
    """See that a file, or a folder with what is to come into it, can be written.

    Raises:
        UsageError: it cannot; it says why.
    """
    what = "folder" if isinstance(path, OutputFolder) else "file"
    try:
        reason = _hinders(path)
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise UsageError(f"{option} {path} cannot be written: {reason}; name a {what} where you can write")


def contents_of(path: str) -> bytes | None:
    """What tells a file's contents from any others: their SHA-256; None: it is not there, or no regular file."""
    import hashlib

    from armload.runtime.regular import check_regular

    try:
        check_regular(path)
        return hashlib.sha256(Path(path).read_bytes()).digest()
    except OSError:
        return None


@contextmanager
def replacing_unchanged(option: str, path: str, before: bytes | None) -> Iterator[None]:
    """Within, a file that is to be replaced is as it was when it was read, and no other command is in such a block.

    Raises:
        UsageError: another program has changed it meanwhile, or is writing it and does not end.
    """
    from armload.runtime.atomic import kept_alone  # with tempfile: only for who writes

    with ExitStack() as stack:
        try:
            stack.enter_context(kept_alone(os.path.realpath(path), _WRITES))
        except BlockingIOError:
            raise UsageError(f"{option} {path} is being written by another program: ask once more") from None
        if contents_of(path) != before:
            raise ChangedError(
                f"{option} {path} was changed by another program meanwhile: it is left so; ask once more"
            )
        yield


def _hinders(path: str) -> str:
    """Why a file cannot be written, or a folder not be made and filled; "" where nothing hinders.

    Raises:
        OSError: its folder takes no file.
    """
    import tempfile

    folder = Path(os.path.realpath(path))
    if isinstance(path, OutputFolder):
        while not folder.exists() and folder != folder.parent:  # it is made, with those above it
            folder = folder.parent
        if not folder.is_dir():
            return f"{folder} is no folder"
    elif os.path.isdir(path):
        return "it is a folder"
    elif _is_stream(path):
        return "" if os.access(path, os.W_OK) else "permission denied"
    elif not (folder := folder.parent).is_dir():  # of what a link points to, which is replaced, not the link
        return f"there is no folder {Path(path).parent}"
    with tempfile.TemporaryFile(dir=folder):  # by asking: what a mode promises, a mount may refuse
        return ""


def _option(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def _is_stream(path: str) -> bool:
    from armload.runtime.atomic import is_stream  # with tempfile: only for who writes

    try:
        return is_stream(Path(path))
    except OSError:  # a folder, or what cannot be looked at
        return False


def _same(one: str, other: str) -> bool:
    if os.path.exists(one) and os.path.exists(other):
        return not _is_stream(one) and os.path.samefile(one, other)
    return os.path.realpath(one) == os.path.realpath(other)


def _reads(path: Path, out: Path) -> bool:
    """Whether a file that is there is an input, or part of a folder that is one: a log in it, or what describes it.

    Whatever else lies in a folder, such as an earlier report or the table of a survey, is not read.
    """
    if not path.is_dir():
        return path.samefile(out)
    inside = Path(os.path.realpath(out)), Path(os.path.realpath(path))
    if not inside[0].is_relative_to(inside[1]):
        return False
    from armload.recording import is_log
    from armload.survey.logs import of_survey

    parts = inside[0].relative_to(inside[1]).parts
    return (is_log(out) and not of_survey(out)) or out.name in _OF_FOLDERS or _META in parts[:-1]


def _inputs(options: argparse.Namespace) -> Iterator[_Input]:
    words = _BUILT_IN | set(built_in_arms())
    for key, value in vars(options).items():
        for text in value if isinstance(value, list) else [value]:
            if isinstance(text, str) and not isinstance(text, OutputFile | OutputFolder) and key not in _NO_FILES:
                said = text if key in _POSITIONAL else f"{_option(key)} {text}"
                for path in () if text in words else _named(text):
                    yield _Input(path, said)


def _named(text: str, lists: tuple[str, ...] = ()) -> Iterator[Path]:
    """The files and folders behind a text: itself, those of a glob or of all arms ({arm}), the lines of an @list."""
    if text.startswith("@"):
        if os.path.isfile(text[1:]) and text not in lists:
            yield Path(text[1:])
            with suppress(OSError, UnicodeDecodeError):  # the command will say so
                for line in Path(text[1:]).read_text(encoding="utf-8-sig").splitlines():
                    yield from () if line.startswith("#") else _named(line.strip(), (*lists, text))
        return
    text = text.removeprefix("file://")
    if os.path.exists(text):
        yield Path(text)
    elif glob.has_magic(text) or "{arm}" in text:
        yield from map(Path, glob.glob(text.replace("{arm}", "*"), recursive=True))
