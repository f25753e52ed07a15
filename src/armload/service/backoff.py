"""How long to wait before what has failed is tried again, and how often to say why."""

from __future__ import annotations

FIRST, MOST = (
    0.1,
    5.0,
)  # [s] waits double from one to the other: a robot that restarts needs a minute, a reader a second
# [s] after which what runs counts as sound: longer than what fails at once again takes to start
SOUND = 10.0
# [s] between two words of a reason that stays: a robot that is off over the weekend is tried twelve times a minute
REMINDED = 600.0


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


class Reasons:
    """Which of the reasons for which something fails again and again are to be said.

    A reason that stays is said as often as the wait grows, and then every ten minutes.

    >>> reasons = Reasons()
    >>> [reasons.due("it is off", wait, now) for wait, now in ((2.5, 0.0), (5.0, 2.5), (5.0, 7.5), (5.0, 603.0))]
    [True, True, False, True]
    """

    def __init__(self) -> None:
        self._said: tuple[str, float] | None = None  # the last reason, and the wait then
        self._at = 0.0  # when it was said [s]

    def due(self, why: str, wait: float, now: float) -> bool:
        """Whether a reason is to be said now, which then counts as said.

        Args:
            why: the reason. wait: until it is tried again [s]. now: [s, monotonic].
        """
        if self._said == (why, wait) and now - self._at < REMINDED:
            return False
        self._said, self._at = (why, wait), now
        return True
