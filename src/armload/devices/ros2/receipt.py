"""How long a message has waited since the middleware took it in, whose stamp of that is by the time of day."""

from __future__ import annotations


class Receipt:
    """Waits by a clock that may be set meanwhile: what was received before is told by the clock as it was.

    >>> receipt, second = Receipt(), 1_000_000_000
    >>> receipt.waited(1000 * second, 1001 * second, 5 * second)
    1.0
    >>> receipt.waited(1001 * second, 4602 * second, 6 * second)  # the clock was set forward by an hour meanwhile
    1.0
    """

    def __init__(self) -> None:
        self._ahead: int | None = None  # of the monotonic clock [ns]

    def waited(self, received: int, wall: int, monotonic: int) -> float:
        """For how long a message has waited [s].

        Args:
            received: when it was taken in, since 1970 [ns]; 0: the middleware does not tell. wall, monotonic: the time
                by both clocks [ns].
        """
        if not received:
            return 0.0
        now = wall - received
        before = now if self._ahead is None else monotonic + self._ahead - received
        if before < 0 or now <= before:
            self._ahead = wall - monotonic
        return max(0, min(before, now)) / 1e9
