"""What tells one content from another: SHA-256 of files, and of the rows of one episode in a file of several."""

from __future__ import annotations

import errno
import hashlib
import stat
from functools import lru_cache
from pathlib import Path
from threading import Lock

from armload.recording import digests_of_episodes

NO_FILE = "it is a pipe, a socket or a device: expected a regular file; copy what it gives into one"
_ONE = Lock()  # a file of many episodes is read once, not by as many threads as ask for one of them


def is_special(path: Path) -> bool:
    """Whether this is a pipe, a socket or a device, through links, too: to open one may wait for ever."""
    try:
        return _special(path.stat().st_mode)
    except OSError:  # a link to nothing: its row will say so
        return False


def _special(mode: int) -> bool:
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def file_hash(file: Path) -> str:
    """SHA-256 of a file, which is not hashed again while its size and time stay.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    return _hash(file, *_version(file))


def _version(file: Path) -> tuple[int, int]:
    """Size and time of a regular file."""
    about = file.stat()
    if _special(about.st_mode):
        raise OSError(errno.EINVAL, NO_FILE, str(file))
    return about.st_size, about.st_mtime_ns


@lru_cache(maxsize=4096)
def _hash(file: Path, _size: int, _time: int) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def episode_hash(file: Path, episode: int) -> str:
    """SHA-256 of the rows of an episode, whatever episodes are added to its file; else of the file.

    Raises:
        OSError: the file cannot be read, or is no regular file.
    """
    version = _version(file)
    with _ONE:
        found = _episodes(file, *version)
    return found.get(episode) or file_hash(file)


@lru_cache(maxsize=4096)
def _episodes(file: Path, _size: int, _time: int) -> dict[int, str]:
    try:
        return digests_of_episodes(file)
    except Exception:  # its row will say why: a damaged file can fail anywhere in the decoder
        return {}
