"""Lines that a thread of its own writes: who reads them slowly, or not at all, loses the oldest and delays nobody."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Line = TypeVar("Line")


class Aside(Generic[Line]):
    """Writes in order what it is given.

    Args:
        write: writes one line, and may take as long as it likes. most: lines that wait; then the oldest give way.
    """

    def __init__(self, write: Callable[[Line], None], most: int = 1000) -> None:
        self._write = write
        self._lines: queue.Queue[tuple[Line] | None] = queue.Queue(most)  # None ends it
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, line: Line) -> None:
        """Take a line; returns at once."""
        self._put((line,))

    def close(self, seconds: float) -> None:
        """Give what waits so many seconds more [s], and end."""
        self._put(None)
        self._thread.join(seconds)

    def _put(self, entry: tuple[Line] | None) -> None:
        while True:
            try:
                return self._lines.put_nowait(entry)
            except queue.Full:
                try:
                    self._lines.get_nowait()
                except queue.Empty:
                    continue

    def _run(self) -> None:
        while (entry := self._lines.get()) is not None:
            self._write(*entry)
