"""What receivers of alarms have in common: why none is taken is logged when it changes, and no secret with it."""

from __future__ import annotations

import logging
import re

_USER = re.compile(r"(?<=//).*@", re.DOTALL)  # of an address: a name, perhaps a password with any character in it


class Health:
    """Whether a receiver takes alarms.

    >>> health = Health("the webhook")
    >>> health.tell("answered 503"), health.failed
    (None, 'answered 503')

    Args:
        what: it is, as log lines begin.

    Attributes:
        failed: why the last trial failed; None: it did not.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self.failed: str | None = None

    def tell(self, failed: str | None) -> None:
        """How the last trial went, which is logged where the one before went otherwise."""
        if failed != self.failed:
            self.failed = failed
            logging.getLogger("armload").warning("%s %s", self._what, failed or "takes alarms again")


def without_user(url: str) -> str:
    """An address for a message: who logs in, and with what, is nobody's business.

    >>> without_user("mqtts://me:secret@host:8883/cell")
    'mqtts://…@host:8883/cell'
    """
    return _USER.sub("…@", url)


def is_host(name: str) -> bool:
    """Whether a name can be looked up at all: what cannot would end the thread that sends, or be tried for ever.

    >>> is_host("cell.example"), is_host("cell..example")
    (True, False)
    """
    try:
        name.encode("idna")  # as the look-up does
    except UnicodeError:
        return False
    return True
