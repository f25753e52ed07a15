"""What the page says beside the numbers: whether they can be used, what is waited for, how old answer and tare are."""

from __future__ import annotations

import time
from typing import NamedTuple

from armload.devices import Steadied
from armload.inertia import NAMES
from armload.online import OnlineEstimate
from armload.runtime.compiling import compiling
from armload.service.catching_up import CatchingUp
from armload.service.reconnecting import Reconnecting
from armload.service.session import Session
from armload.service.tare import Tare
from armload.service.unknown import Link, Unknown, Why, why_unknown

# reasons for which the last answer says nothing of the present: it is shown as what it was, with its age
_GONE = (Unknown.STARTING, Unknown.COMPILING, Unknown.SOURCE_LOST, Unknown.SILENT, Unknown.UNCONFIRMED)
_WAITS = {
    Unknown.STARTING: "the first sample",
    Unknown.COMPILING: "functions",
    Unknown.SOURCE_LOST: "the source",
    Unknown.SILENT: "samples",
    Unknown.BEHIND: "this machine, which is too busy",
    Unknown.UNUSABLE: "samples that can be used",
    Unknown.IMPLAUSIBLE: "samples that can come from this arm",
    Unknown.UNCONFIRMED: "motion",
    Unknown.CHANGING: "the payload to stay as it is",
    Unknown.CONTACT: "the contact to end",
}


class Status(NamedTuple):
    """How the newest answer is to be taken.

    why: the answer is not to be used; None: it is. waits: what would make it better; None: nothing is waited for.
    misfit: what does not fit the arm as it is known, and at which joint; None: nothing, as far as anybody can tell.
    age: of the answer [s]; None: there is none. tare: since when it rests on a tare, in words; None: it does not.
    gone: the answer says nothing of the present.
    """

    why: Why | None
    waits: str | None
    misfit: str | None
    age: float | None
    tare: str | None

    @property
    def gone(self) -> bool:
        """Whether the answer says nothing of the present."""
        return self.why is not None and self.why.reason in _GONE


class Watcher:
    """Looks at a session again and again: what has not changed since the last look has become older.

    Args:
        session: looked at.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._estimate: OnlineEstimate | None = None
        self._late = CatchingUp()
        self._answered = 0.0  # when the newest answer was first seen [s, monotonic]

    def look(self, now: float | None = None) -> Status:
        """How the newest answer is to be taken.

        Args:
            now: [s, monotonic]; None: now.
        """
        session, now = self._session, time.monotonic() if now is None else now
        estimate = session.estimate
        if estimate is not self._estimate:
            self._estimate, self._answered = estimate, now
        since = now - self._answered
        age = None if estimate is None else estimate.age + since
        if estimate is not None and compiling():  # samples may wait for that alone
            estimate = estimate.behind(estimate.lag + since)
        compiles = self._late.why(None if estimate is None else estimate.lag, now)
        why = why_unknown(estimate, _link(session, now), now, session.identifier.trouble, session.doubt, compiles)
        tare = None if session.tare is None else _tare_in_words(session.tare)
        return Status(why, waits_for(estimate, why), session.doubt or session.identifier.arm_changed, age, tare)


def _tare_in_words(tare: Tare) -> str:
    log, age = tare.recording, tare.age + time.monotonic() - tare.given
    if tare.taken:
        return f"taken {in_words(age)} ago"
    if tare.age:
        return f"{log.source}, {in_words(age)} old"
    if log.date is not None:
        # of when what is shown is, nobody knows: a log that is replayed may be as old
        return f"{log.source}, recorded {in_words(max(time.time() - log.date - log.duration, 0.0))} ago"
    return f"{log.source}, which does not say when it was recorded"


def waits_for(estimate: OnlineEstimate | None, why: Why | None) -> str | None:
    """What would make the answer better, a few words; None: nothing is waited for."""
    if why is not None and why.reason is Unknown.SOURCE_ENDED:
        return None
    if why is not None and why.reason in _WAITS:
        return f"{_WAITS[why.reason]} ({why.text})"
    if estimate is None or (why is None and not estimate.held):
        return None
    missing = [name for name, known in zip(NAMES, estimate.determined, strict=True) if not known]
    if not missing:
        return None
    what = "all ten parameters are" if len(missing) == len(NAMES) else f"{', '.join(missing)}: "
    what = f"{what.removesuffix(': ')} undetermined"
    if not estimate.moving:
        return f"motion (the arm is not moving; {what})"
    return f"{'more' if why is not None else 'faster and wider'} motion ({what})"


def in_words(seconds: float) -> str:
    """A duration, no finer than anybody cares for.

    >>> [in_words(x) for x in (0.04, 3.21, 90.0, 600.0, 90000.0, 1e6)]
    ['0.0 s', '3.2 s', '90 s', '10 min', '25 h', '12 days']
    """
    for most, unit, size, digits in ((60.0, "s", 1.0, 1), (120.0, "s", 1.0, 0), (7200.0, "min", 60.0, 0)):
        if seconds < most:
            return f"{seconds / size:.{digits}f} {unit}"
    return f"{seconds / 3600:.0f} h" if seconds < 172800.0 else f"{seconds / 86400:.0f} days"


def _link(session: Session, now: float) -> Link:
    """The connection; a log or a simulator is there until it ends, and is never silent."""
    source = session.source.source if isinstance(session.source, Steadied) else session.source
    if session.error is not None:
        return Link("lost", str(session.error), 1, None, None)
    if isinstance(source, Reconnecting):
        return source.link()
    return Link("ended" if session.ended else "streaming", None, 1, None, now)
