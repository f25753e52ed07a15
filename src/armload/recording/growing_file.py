"""A new file that grows by whole pieces: whatever becomes of its writer, what is in it can be read."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from armload.errors import RecordingError

RECORDS = (".csv", ".mcap")  # what a log can be written as while it is measured


class GrowingFile:
    """A new file to which bytes are given whole or not at all, one system call each.

    Raises:
        RecordingError: there is such a file, or it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.size = path, 0
        self._file: int | None = None
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, 0o644)
        except FileExistsError:
            raise RecordingError(f"{path} exists: a record is never written over; choose another name") from None
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from None

    @property
    def open(self) -> bool:
        """Whether more can be written."""
        return self._file is not None

    def append(self, data: bytes) -> None:
        """Add bytes; the file is as it was before where that fails.

        Raises:
            RecordingError: it is closed, or they cannot be written.
        """
        if self._file is None:
            raise RecordingError(f"{self.path} is closed: nothing more can be kept in it")
        try:
            written = os.write(self._file, data)
            if written < len(data):
                os.ftruncate(self._file, self.size)
                raise RecordingError(f"{self.path} cannot grow beyond {self.size} bytes: the disk is full")
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be written: {error.strerror}") from None
        self.size += written

    def discard(self) -> None:
        """Remove it: it could not even be begun."""
        self.close()
        with contextlib.suppress(OSError):
            self.path.unlink()

    def close(self) -> None:
        """Nothing happens the second time."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
