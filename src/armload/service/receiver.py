"""What receivers of alarms have in common: why none is taken, and that some are dropped, is logged, and no secret."""

from __future__ import annotations

import logging
import re
import ssl
import urllib.error

from armload.errors import one_line

KEPT = 1000  # messages that wait for a receiver: an hour of alarms every four seconds
_USER = re.compile(r"(?<=//).*@", re.DOTALL)  # of an address: a name, perhaps a password with any character in it


class Health:
    """Whether a receiver takes alarms.

    >>> health = Health("the webhook")
    >>> health.tell("answered 503"), health.failed
    (None, 'answered 503')

    Args:
        what: it is, as log lines begin.

    Attributes:
        failed: why the last trial failed; None: it did not. dropped: alarms that it will never get.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self.failed: str | None = None
        self.dropped = 0
        self._unsaid = 0  # dropped since it took alarms last

    def tell(self, failed: str | None) -> None:
        """How the last trial went, which is logged where the one before went otherwise."""
        if failed == self.failed:
            return
        self.failed, unsaid = failed, self._unsaid
        said = failed or "takes alarms again"
        if failed is None and unsaid:
            said, self._unsaid = f"{said}; {unsaid} {'was' if unsaid == 1 else 'were'} dropped", 0
        self._log(said)

    def drop(self, why: str | None = None) -> None:
        """An alarm is dropped; how many were is logged once the receiver takes alarms again.

        Args:
            why: logged with the first of them; None: that is told already.
        """
        self.dropped, self._unsaid = self.dropped + 1, self._unsaid + 1
        if self._unsaid == 1 and why is not None:
            self._log(f"does not get all alarms: {why}")

    def _log(self, said: str) -> None:
        logging.getLogger("armload").warning("%s %s", self._what, said)


def unreachable(error: Exception) -> str:
    """Why a receiver cannot be reached, for a log line; with what to do where its certificate is refused.

    >>> unreachable(ConnectionRefusedError(111, "Connection refused"))
    'Connection refused'
    """
    if isinstance(error, urllib.error.URLError) and isinstance(error.reason, Exception):
        error = error.reason
    if isinstance(error, ssl.SSLCertVerificationError):
        return (
            f"its certificate is refused ({error.verify_message.rstrip('.')}): it needs one for its name, of an issuer "
            "that this machine trusts (SSL_CERT_FILE names a file of them)"
        )
    return (error.strerror if isinstance(error, OSError) else None) or one_line(error)


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
