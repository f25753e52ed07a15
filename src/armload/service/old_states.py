"""The files of an arm's states: what they are called, and which of them nothing can go on from any more."""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from armload.errors import ArmloadError, IdentificationError, UsageError
from armload.runtime.atomic import clear_left_over, kept_alone

_DIGITS = 8  # of the digest of an arm's settings in the name of its state


def state_file(folder: str | Path, name: str, settings: Mapping[str, Any]) -> Path:
    """Of the arm that is called `name`: other settings have another file."""
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:_DIGITS]
    return Path(folder) / f"{name}-{digest}.npz"


def digest_of(key: str, path: Path) -> str:
    """What stands for a file, or for all files in a folder, as a bag of ROS 2 is one, in the name of a state: SHA-256.

    Args:
        key: the setting that names it.

    Raises:
        UsageError: it cannot be read.
    """
    try:
        return _digest(path)
    except OSError as error:
        raise UsageError(f"{key}: {error.filename or path} cannot be read: {error.strerror}") from None


def _digest(path: Path) -> str:
    if not path.is_dir():
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    files = sorted(file for file in path.rglob("*") if file.is_file())
    return hashlib.sha256("".join(f"{file.relative_to(path)} {_digest(file)} " for file in files).encode()).hexdigest()


def not_saved(path: Path, error: ArmloadError | OSError) -> str:
    """Why a state is not saved in `path`, and whether one that was saved before is still there."""
    why = error.strerror or str(error) if isinstance(error, OSError) else str(error)
    stays = "the one saved before stays" if os.path.isfile(path) else "none was saved there before"
    return f"the state cannot be saved in {path}: {why}; {stays}"


class OldStates:
    """States of the same arm with other settings, which are removed once they are too old to go on from.

    A file stays if it is no state, or does not say when it was saved, or is a link; and if another process keeps it,
    as of a second service with an arm of the same name.

    Args:
        own: the file of the arm's own state, which stays whatever it is; None: there is none.
        age: [s] beyond which nothing goes on from a state; also the time between two looks.
        said: called with a sentence for each that was removed.
    """

    def __init__(self, own: Path | None, age: float, said: Callable[[str], None]) -> None:
        self._own, self._age, self._said = own, age, said
        self._looked = -float("inf")

    def clear(self, now: float) -> None:
        """Remove them, unless that was done lately; now: [s, monotonic]."""
        if self._own is None or now - self._looked < self._age:
            return
        self._looked = now
        for path in sorted(set(_others(self._own))):
            with suppress(OSError), kept_alone(path, 0.0):  # else somebody keeps it, or it cannot be removed
                clear_left_over(path)
                if self._is_old(path):
                    path.unlink()
                    self._said(f"{path}, a state of other settings, is too old to go on from: removed")

    def _is_old(self, path: Path) -> bool:
        from armload.online.state import saved_at  # slow to load, and the supervisor needs only the names

        try:
            return not path.is_symlink() and time.time() - saved_at(path) > self._age
        except IdentificationError:
            return False


def _others(own: Path) -> Iterator[Path]:
    """States of the same arm, by their names, or by what lies beside one: a lock, a file that was half written."""
    name = re.escape(own.name[: -_DIGITS - len(own.suffix)])
    state = rf"({name}[0-9a-f]{{{_DIGITS}}}\.npz)"
    kinds = re.compile(rf"{state}|\.{state}\.(?:lock|part\d\.npz)")
    with suppress(OSError), os.scandir(own.parent) as entries:
        for entry in entries:
            if (found := kinds.fullmatch(entry.name)) and (other := found[1] or found[2]) != own.name:
                yield own.with_name(other)
