"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STREAMS = re.compile(r"/proc/|/dev/(fd/|std(in|out|err)$)")  # open already, even where a plain file is behind it
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # of a write for which there is no room, and which names no file
_AGAIN = 0.05  # [s] between two looks at a lock
_WRITERS = 8  # of one file at once, each with a name of its own; there is no limit, but more have names by chance


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary file that takes the place of `path` when the block ends well, and vanishes when it does not.

    Whoever looks sees the old file or the new one, never a half-written one, even if the program is killed or the
    machine stops: the bytes reach the disk before the rename. What a killed program leaves beside it is taken again by
    the next that writes the same file (`clear_left_over` removes it before). A link stays a link: what it points to is
    replaced. What is no plain file (a pipe, a device, /dev/stdout) stays, too: the bytes are written into it when the
    block has ended well.

    Raises:
        OSError: the folder does not exist or cannot be written; it names `path`, not the temporary file.
    """
    path = Path(path)
    stream = is_stream(path)
    target = path if stream else Path(os.path.realpath(path))
    try:
        handle, temporary = _anywhere(path.suffix) if stream else _beside(target, path.suffix)
    except OSError as error:
        raise _named(error, path) from None
    left = True
    try:
        yield temporary
        if stream:
            with temporary.open("rb") as whole, target.open("ab") as into:  # "wb" would cut what is said on stdout
                shutil.copyfileobj(whole, into)
        else:
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(target)
            left = False  # and the name is free for others
    except OSError as error:
        if error.filename != str(temporary) and not (error.filename is None and error.errno in FULL):
            raise
        raise _named(error, path) from None
    finally:
        if left:
            temporary.unlink(missing_ok=True)
        os.close(handle)  # after that: until then nobody else takes it


def clear_left_over(path: str | Path) -> None:
    """Remove what programs that were killed while they wrote `path` have left beside it; not what one writes now."""
    path = Path(path)
    target = Path(os.path.realpath(path))
    for k in range(_WRITERS):
        part = _part(target, k, path.suffix)
        with contextlib.suppress(OSError):  # there is none, somebody writes it, or it cannot be removed
            handle = os.open(part, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if _is(handle, part):
                    part.unlink()
            finally:
                os.close(handle)


@contextmanager
def kept_alone(path: str | Path, patience: float) -> Iterator[None]:
    """Within, no other process is in such a block for the same file, which need not exist.

    A file beside it is locked; the kernel lets go of the lock however its owner ends. Where no such file can be made or
    locked (no such folder, read-only, no locks there), nothing is asked.

    Args:
        patience: [s] another process is waited for.

    Raises:
        BlockingIOError: it is still there; its text is a sentence.
    """
    path = Path(path)
    lock = path.with_name(f".{path.name}.lock")
    handle = _locked(lock, path, patience)
    try:
        yield
    finally:
        if handle is not None:
            lock.unlink(missing_ok=True)
            os.close(handle)


def _locked(lock: Path, path: Path, patience: float) -> int | None:
    until = time.monotonic() + patience
    while True:
        try:
            handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        except OSError:
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is(handle, lock):
                return handle
            # else whoever held it has just removed it: look again
        except BlockingIOError:
            if time.monotonic() > until:
                os.close(handle)
                raise BlockingIOError(
                    f"another process keeps {path}: is the same one running twice? Stop one, or give it another folder"
                ) from None
            time.sleep(_AGAIN)
        except OSError:  # a file system without locks
            lock.unlink(missing_ok=True)
            os.close(handle)
            return None
        os.close(handle)


def _part(target: Path, k: int, suffix: str) -> Path:
    """What a file is written into; k: while others write the same one."""
    return target.with_name(f".{target.name}.part{k}{suffix}")


def _beside(target: Path, suffix: str) -> tuple[int, Path]:
    """An empty file beside the target that nobody else writes, locked as long as its descriptor is open.

    The kernel lets go of the lock when its owner ends, however it does: so what was left by a kill is known.
    """
    k = 0
    while k < _WRITERS:
        part = _part(target, k, suffix)
        try:
            handle = os.open(part, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError:  # another user's, or no file
            k += 1
            continue
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is(handle, part):
                if os.fstat(handle).st_uid == os.geteuid():  # another user's would keep its owner
                    os.ftruncate(handle, 0)
                    return handle, part
                k += 1
            # else whoever held it has just finished, and it is the target by now: look again
        except BlockingIOError:
            k += 1
        except OSError:  # a file system without locks, where nobody else can have it either
            part.unlink(missing_ok=True)
            os.close(handle)
            break
        os.close(handle)
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=suffix, dir=target.parent)
    return handle, Path(name)


def _anywhere(suffix: str) -> tuple[int, Path]:
    handle, name = tempfile.mkstemp(suffix=suffix)
    return handle, Path(name)


def _is(handle: int, path: Path) -> bool:
    """Whether an open file still has this name."""
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(handle), os.stat(path))
    return False


def is_stream(path: Path) -> bool:
    """Whether there is something to write into that must not be replaced by a file."""
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        path.stat()
    except FileNotFoundError:
        return False
    except OSError as error:
        raise _named(error, path) from None
    return not path.is_file() or _STREAMS.match(os.path.abspath(path)) is not None


def _named(error: OSError, path: Path) -> OSError:
    """The error as one of the file that was wanted, not of the temporary one."""
    return OSError(error.errno, error.strerror or str(error), str(path))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
