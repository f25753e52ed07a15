"""What happened in a session: its log, changes of payload and warnings among the rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from armload.online import Event

_KEPT = 200  # [entries]
_AGAIN = 10.0  # [s] between two warnings of samples that cannot be used


@dataclass(frozen=True)
class Entry:
    """A line of the log: what happened, and when on the stream's clock [s]; `event`, if it was a change of payload.

    warning: something is wrong.
    """

    t: float
    text: str
    event: Event | None = None
    warning: bool = False


class SessionLog:
    """The last 200 entries.

    >>> log = SessionLog()
    >>> log.write(1.0, "method map")
    >>> [entry.text for entry in log]
    ['method map']

    Args:
        warn: called with each warning. record: called with each entry's text, and whether it is a warning.
    """

    def __init__(
        self, warn: Callable[[str], None] | None = None, record: Callable[[str, bool], None] | None = None
    ) -> None:
        self._entries: deque[Entry] = deque(maxlen=_KEPT)
        self._warn_too = warn or (lambda _: None)
        self._record = record or (lambda _, __: None)
        self._in_trouble = False  # whether unusable samples were reported
        self._warned = -float("inf")  # and when it last was, on the stream's clock

    def __iter__(self) -> Iterator[Entry]:
        return iter(list(self._entries))  # another thread may write meanwhile

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, k: int) -> Entry:
        return self._entries[k]

    def write(self, t: float, text: str) -> None:
        """Something happened at t [s]."""
        self._entries.append(Entry(t, text))
        self._record(text, False)

    def warn(self, t: float, text: str) -> None:
        """Something is wrong at t [s]."""
        self._entries.append(Entry(t, text, warning=True))
        self._record(text, True)
        self._warn_too(text)

    def write_event(self, event: Event) -> bool:
        """A change of payload; whether it is new: a better classification of the same event replaces the first."""
        entry = Entry(event.t, str(event), event)
        self._record(entry.text, False)
        for k, known in enumerate(self._entries):
            if known.event is not None and known.event.t == event.t:
                self._entries[k] = entry
                return False
        self._entries.append(entry)
        return True

    def report_trouble(self, t: float, trouble: str | None) -> None:
        """Report that samples cannot be used, and that they can again; at most every 10 s."""
        if trouble is None:
            if self._in_trouble:
                self._in_trouble = False
                self.write(t, "samples can be used again")
        elif not self._in_trouble and not 0.0 <= t - self._warned < _AGAIN:
            self._in_trouble, self._warned = True, t
            self.warn(t, trouble)
