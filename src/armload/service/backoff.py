"""How long to wait before what has failed is tried again."""

from __future__ import annotations

FIRST, MOST = (
    0.1,
    5.0,
)  # [s] waits double from one to the other: a robot that restarts needs a minute, a reader a second
# [s] after which what runs counts as sound: longer than what fails at once again takes to start
SOUND = 10.0


class Backoff:
    """Waits of 0.1, 0.2, 0.4, … 5, 5, … s; from the start again after 10 s without a failure.

    >>> backoff = Backoff()
    >>> [backoff.failed(0.0) for _ in range(8)]
    [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]
    >>> backoff.failed(lasted=60.0)
    0.1

    Args:
        first, most: the shortest and the longest wait [s].
    """

    def __init__(self, first: float = FIRST, most: float = MOST) -> None:
        self._first, self._most, self._failures = first, most, 0

    def failed(self, lasted: float) -> float:
        """The wait after a failure [s], given for how long it had been well before [s]."""
        self._failures = 1 if lasted >= SOUND else self._failures + 1
        return min(self._first * 2.0 ** min(self._failures - 1, 60), self._most)
