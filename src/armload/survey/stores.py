"""Logs in object stores and behind web servers, through fsspec: which there are, and what tells their content."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from armload.errors import ArmloadError, UsageError, one_line
from armload.recording import is_log
from armload.survey.remarks import may_be_log

WILD = re.compile(r"[*?\[]")  # what makes a path a pattern
_URL = re.compile(r"[a-z][a-z0-9+.-]*://")
_VALIDATORS = ("ETag", "Content-MD5", "Digest", "Last-Modified")  # of a file behind HTTP: all that fsspec keeps


def is_url(path: str) -> bool:
    """Whether a path names an object store, as fsspec understands it."""
    return _URL.match(path) is not None


def filesystem(url: str) -> tuple[Any, str]:
    """fsspec's file system of a URL, and the path in it.

    Raises:
        UsageError: fsspec, or what it needs for this kind of store, is not installed.
        OSError: the store cannot be used.
    """
    with _asked(url):
        try:
            from fsspec.core import url_to_fs  # type: ignore[import-not-found]

            return url_to_fs(url)
        except ImportError as error:
            raise UsageError(
                f"{url}: object stores are read through fsspec, and {error.name or 'a package of the store'} is "
                "missing: pip install fsspec, and the store's package (aiohttp of a web server, s3fs, gcsfs, adlfs)"
            ) from None
        except ValueError as error:
            raise UsageError(f"{url}: {error}") from None


def stamp_of(url: str) -> str:
    """What changes with an object's content and is known without reading it: the store's own key.

    Raises:
        OSError: it is not there, or its store does not answer.
    """
    fs, path = filesystem(url)
    is_web = "http" in ((fs.protocol,) if isinstance(fs.protocol, str) else fs.protocol)
    with _asked(url):
        return _of_web(fs, path) if is_web else str(fs.ukey(path))


def _of_web(fs: Any, url: str) -> str:
    """What a web server says of a file's content (RFC 9110, 8.8), as fsspec takes it to stay for ever (`ukey`).

    From a server that says nothing, the file is read.
    """
    about = fs.info(url)
    if validators := {name: about[name] for name in _VALIDATORS if about.get(name)}:
        return hashlib.sha256(repr((url, about["size"], validators)).encode()).hexdigest()
    with fs.open(url, block_size=0) as stream:  # as it comes: such a server may know no ranges
        return hashlib.file_digest(stream, "sha256").hexdigest()


def logs_in(url: str, passed: set[str]) -> Iterator[str]:
    """The URLs of the logs that a URL names: itself, what fits its pattern, or what is below it as a folder.

    passed: as of `find_logs`.

    Raises:
        OSError: the store cannot be asked what fits a pattern.
    """
    fs, inside = filesystem(url)
    there = [inside]
    if WILD.search(inside):
        with _asked(url):
            there = fs.glob(inside)
    elif not is_log(inside):  # to ask a web server whether it is a folder fetches it
        with suppress(Exception):  # of the store's package: the row of what is named will say why
            there = fs.find(inside) if fs.isdir(inside) else there
    for one in there:
        if one == inside or is_log(one):
            yield fs.unstrip_protocol(one)
        elif may_be_log(one):
            passed.add(fs.unstrip_protocol(one))


@contextmanager
def _asked(url: str) -> Iterator[None]:
    """Within the block a store is asked; what its package raises, as of a login that fails, is an OSError."""
    try:
        yield
    except (OSError, ArmloadError):
        raise
    except Exception as error:
        raise OSError(f"{url}: {type(error).__name__}: {one_line(error)}") from None
