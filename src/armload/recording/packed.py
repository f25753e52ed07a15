"""Logs that a program has packed (.gz, .bz2, .xz, .zip), unpacked for as long as they are read."""

from __future__ import annotations

import bz2
import gzip
import lzma
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from armload.errors import RecordingError
from armload.runtime.atomic import FULL

_STREAMS = {".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open}
_ZIP = ".zip"
UNPACKED = (*_STREAMS, _ZIP)
# ended too early, damaged, with a password, or packed in a way that Python does not know
_FLAWS = (EOFError, OSError, zlib.error, lzma.LZMAError, zipfile.BadZipFile, RuntimeError, NotImplementedError)


def form_of(path: Path, forms: Collection[str]) -> str:
    """The suffix by which the form of a log is known: of run.csv.gz it is .csv, of a ZIP that of the one log in it.

    Args:
        forms: the suffixes of logs.
    """
    suffix = path.suffix.lower()
    if suffix in _STREAMS:
        return path.with_suffix("").suffix.lower()
    if suffix == _ZIP and path.is_file():
        try:
            with zipfile.ZipFile(path) as archive:
                return PurePosixPath(_only_log(archive, path, forms)).suffix.lower()
        except (*_FLAWS, RecordingError):
            return suffix
    return suffix


@contextmanager
def unpacked(path: Path, forms: Collection[str]) -> Iterator[Path]:
    """The file itself, or, of a packed one, what was in it: a copy in the system's folder for temporary files.

    Args:
        forms: the suffixes of logs; what else is packed stays as it is, for its reader to refuse.

    Raises:
        RecordingError: it is damaged, or an archive of several logs, or of none, or there is no room for what is in it.
    """
    suffix = path.suffix.lower()
    if suffix not in UNPACKED or not path.is_file() or (suffix != _ZIP and form_of(path, forms) not in forms):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="armload-") as folder:
        try:
            copy = _unpack(path, suffix, Path(folder), forms)
        except _FLAWS as error:
            if isinstance(error, OSError) and error.errno in FULL:
                where = Path(folder).parent
                advice = "free some room there, or name another folder with TMPDIR"
                raise RecordingError(f"{path} cannot be unpacked into {where}: {error.strerror}; {advice}") from error
            what = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise RecordingError(f"{path} cannot be unpacked: {what}; unpack by hand what is whole of it") from None
        yield copy


def _unpack(path: Path, suffix: str, folder: Path, forms: Collection[str]) -> Path:
    if suffix != _ZIP:
        with _STREAMS[suffix](path, "rb") as file:
            return _copied(file, folder / path.with_suffix("").name)
    with zipfile.ZipFile(path) as archive:
        name = _only_log(archive, path, forms)
        with archive.open(name) as file:
            return _copied(file, folder / PurePosixPath(name).name)


def _copied(file: IO[bytes], to: Path) -> Path:
    with to.open("wb") as copy:
        shutil.copyfileobj(file, copy)
    return to


def _only_log(archive: zipfile.ZipFile, path: Path, forms: Collection[str]) -> str:
    names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
    logs = [name for name in names if PurePosixPath(name).suffix.lower() in forms]
    if len(logs) != 1:
        found = f"{len(logs)} logs ({logs[0]}, {logs[1]}{', …' * (len(logs) > 2)})" if logs else "no log"
        raise RecordingError(f"{path} holds {found}: expected one log; unpack it first")
    return logs[0]
