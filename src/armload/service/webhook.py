"""Alarms to a web address: one JSON object for each, tried again until it is taken, and nobody waits for it."""

from __future__ import annotations

import io
import json
import re
import socket
import threading
import urllib.error
import urllib.request
from collections import deque
from collections.abc import Mapping
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import Any
from urllib.parse import urlsplit

from armload.errors import UsageError
from armload.service.backoff import Backoff
from armload.service.in_time import InTime
from armload.service.receiver import KEPT, Health, is_host, unreachable, without_user

_ANSWERED = 5.0  # [s] a receiver may take
_LONGEST = 60.0  # [s] between two trials
_WAIT_AT_END = 2.0  # [s] that `close` gives to what still waits
_ADDRESS = re.compile(r"[!-~]+")  # what a request's first line can hold
_NAME = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")  # of a header: RFC 9110, 5.6.2
_VALUE = re.compile(r"[\t -~\xa0-\xff]*")  # RFC 9110, 5.5: a line break in it would begin another header
_OF_THE_POST = ("content-length", "host", "transfer-encoding")  # headers that say how the message itself is sent


class _NotFollowed(urllib.request.HTTPRedirectHandler):
    """A post that is followed elsewhere arrives there as a request without a message, and with our headers."""

    def redirect_request(self, *_: Any) -> None:
        """Follow none: the answer is the status itself."""


class _Answer(HTTPResponse):
    """An answer that has come within `_ANSWERED`, not each of its bytes."""

    def __init__(self, sock: socket.socket, *arguments: Any, **named: Any) -> None:
        super().__init__(sock, *arguments, **named)
        self.fp.close()
        self.fp = io.BufferedReader(InTime(sock, _ANSWERED))


class _Connection(HTTPConnection):
    response_class = _Answer


class _ConnectionWithTls(HTTPSConnection):
    response_class = _Answer


class _InTimeHandler(urllib.request.HTTPHandler):
    def http_open(self, request: urllib.request.Request) -> Any:
        return self.do_open(_Connection, request)


class _InTimeHandlerWithTls(urllib.request.HTTPSHandler):
    def https_open(self, request: urllib.request.Request) -> Any:
        return self.do_open(_ConnectionWithTls, request)


_OPENER = urllib.request.build_opener(_NotFollowed, _InTimeHandler, _InTimeHandlerWithTls)


class Webhook:
    """Posts messages in their order from a thread of its own.

    What is not taken (an error, a status of 300 or more, no answer within 5 s) is posted again after 1, 2, 4, … 60 s.
    A status of 400 to 499 but 408 and 429 means that this message will never be taken: it is dropped. Why messages are
    not taken is logged when it changes.

    Args:
        url: http:// or https://. headers: sent with each message, as `Authorization`.

    Attributes:
        sent: messages. health: whether the last was taken.

    Raises:
        UsageError: the address is none, or a header cannot be sent.
    """

    def __init__(self, url: str, headers: Mapping[str, str] | None = None) -> None:
        check_webhook(url, headers or {})
        self.url, self._headers = url, {"Content-Type": "application/json", **(headers or {})}
        self.sent, self.health = 0, Health("the webhook")
        self._waiting: deque[bytes] = deque()
        self._there, self._gone = threading.Condition(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="armload-webhook", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Messages that were given up."""
        return self.health.dropped

    def post(self, message: Mapping[str, Any]) -> None:
        """Take a message to be sent; returns at once."""
        with self._there:
            if len(self._waiting) >= KEPT:
                self._waiting.popleft()
                self.health.drop(f"{KEPT} wait, the oldest are dropped")
            self._waiting.append(json.dumps(message, allow_nan=False).encode())
            self._there.notify()

    def close(self) -> None:
        """Give what waits two more seconds, and end."""
        with self._there:
            self._gone.set()
            self._there.notify()
        self._thread.join(_WAIT_AT_END)

    def _run(self) -> None:
        backoff = Backoff(1.0, _LONGEST)
        while True:
            with self._there:
                self._there.wait_for(lambda: self._waiting or self._gone.is_set())
                if not self._waiting:
                    return
                message = self._waiting[0]
            taken = self._taken(message)
            if taken is None:
                if self._gone.wait(backoff.failed(0.0)):
                    return
                continue
            backoff = Backoff(1.0, _LONGEST)
            self.sent += taken
            with self._there:
                if self._waiting and self._waiting[0] is message:
                    self._waiting.popleft()

    def _taken(self, message: bytes) -> bool | None:
        """Whether it was taken; None: try again."""
        request = urllib.request.Request(self.url, message, self._headers, method="POST")
        try:
            with _OPENER.open(request, timeout=_ANSWERED):
                taken, failed = True, None
        except urllib.error.HTTPError as error:
            error.close()
            taken = False if 400 <= error.code < 500 and error.code not in (408, 429) else None
            failed = f"answered {error.code}" + (": what it answers so is dropped" if taken is False else "")
            if 300 <= error.code < 400:
                failed += ", that it is elsewhere: give the address it is at"
        except (OSError, ValueError, HTTPException) as error:
            taken, failed = None, f"did not answer: {unreachable(error)}"
        self.health.tell(failed)
        if taken is False:
            self.health.drop()
        return taken


def check_webhook(url: str, headers: Mapping[str, str]) -> None:
    """See that messages can be posted to an address at all: what cannot be sent would be tried for ever.

    Raises:
        UsageError: no post can be sent to it, or with these headers.
    """
    shown = without_user(url)
    said = f"the webhook is {shown!r}: expected an address such as https://HOST:PORT/PATH"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise UsageError(f"{said}, with a port from 1 to 65535") from None
    if parts.scheme not in ("http", "https") or not parts.hostname or not is_host(parts.hostname):
        raise UsageError(said)
    if port == 0:
        raise UsageError(f"{said}, with a port from 1 to 65535")
    if not _ADDRESS.fullmatch(url):
        raise UsageError(f"{said}, of ASCII without blanks (a blank is %20)")
    if "@" in parts.netloc:
        raise UsageError(f"the webhook is {shown!r}, with a user in it: give a header Authorization instead")
    for name, value in headers.items():  # whose value is not shown: it may be a secret
        if not _NAME.fullmatch(name) or name.lower() in _OF_THE_POST:
            raise UsageError(f"the webhook has a header {name!r}: expected a name such as Authorization")
        if not isinstance(value, str):
            raise UsageError(f"the webhook's header {name} is a {type(value).__name__}: expected a text")
        if not _VALUE.fullmatch(value):
            raise UsageError(
                f"the webhook's header {name} has a line break or another character that no header can hold: "
                "expected one line of ASCII"
            )
