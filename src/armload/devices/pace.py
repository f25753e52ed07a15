"""The clock of a source that could be faster: samples at their own times, at a multiple of them, or at once."""

from __future__ import annotations

import threading
import time

from armload.errors import SourceError


class Pace:
    """Lets a sample pass when its time has come on the clock of the wall.

    What comes late is caught up: nothing is left out, and the clock does not drift from the samples' own.

    Args:
        speed: seconds of samples per second of the wall; 1: real time; None: as fast as possible.

    Attributes:
        due: when the last sample was to pass, on the monotonic clock [s]; None before the first, or without a clock.

    Raises:
        SourceError: the speed is not a positive number.
    """

    def __init__(self, speed: float | None) -> None:
        if speed is not None and not 0.0 < speed < float("inf"):
            raise SourceError(
                f"the speed is {speed}: expected a positive number, 1 for real time, or None for no clock"
            )
        self.speed = speed
        self.due: float | None = None
        self._stop = threading.Event()
        self._start: tuple[float, float] | None = None

    def wait(self, t: float) -> bool:
        """Block until the sample at t [s] is due; False: stopped."""
        if self._start is None:
            self._start = (time.monotonic(), t)
        if self.speed is not None:
            began, first = self._start
            self.due = began + (t - first) / self.speed
            ahead = self.due - time.monotonic()
            if ahead > 0:
                self._stop.wait(ahead)
        return not self._stop.is_set()

    def stop(self) -> None:
        """End all waiting, now and from now on."""
        self._stop.set()
