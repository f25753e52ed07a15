"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STREAMS = re.compile(r"/proc/|/dev/(fd/|std(in|out|err)$)")  # open already, even where a plain file is behind it


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary file that takes the place of `path` when the block ends well, and vanishes when it does not.

    Whoever looks sees the old file or the new one, never a half-written one, even if the program is killed or the
    machine stops: the bytes reach the disk before the rename. A link stays a link: what it points to is replaced. What
    is no plain file (a pipe, a device, /dev/stdout) stays, too: the bytes are written into it when the block has ended
    well.

    Raises:
        OSError: the folder does not exist or cannot be written; it names `path`, not the temporary file.
    """
    path = Path(path)
    stream = is_stream(path)
    target = path if stream else Path(os.path.realpath(path))
    beside = {} if stream else {"prefix": f".{target.name}.", "dir": target.parent}
    try:
        handle, name = tempfile.mkstemp(suffix=path.suffix, **beside)
    except OSError as error:
        raise _named(error, path) from None
    os.close(handle)
    temporary = Path(name)
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
    except OSError as error:
        if error.filename != name:
            raise
        raise _named(error, path) from None
    finally:
        temporary.unlink(missing_ok=True)


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
