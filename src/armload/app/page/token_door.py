"""Who may open a page: whoever brings the token, in the address once and then in a cookie; without one, this machine.

viser asks nobody who they are. So it listens to this machine alone, and this stands before it: it reads the first
request of each connection, and hands the connection on only if it may pass. Nothing is encrypted.

Without a token there is still somebody to keep out: any page of the web that is open on this machine may have its
browser connect to 127.0.0.1. So a request must ask for a name of this machine, and come from a page of the same one.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import threading
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from urllib.parse import SplitResult, parse_qs, quote, unquote, urlsplit

from armload.errors import UsageError
from armload.service.access import is_loopback

_PATIENCE = 10.0  # [s] for a request's head
_MOST = 64  # connections at once: a page takes a few for each who looks on
_PORTS = 100  # tried one after another
_CHUNK = 1 << 16  # [bytes]


class TokenDoor:
    """A door before a server of this machine, in a thread of its own.

    `http://HOST:PORT/?token=TOKEN` lets a browser in: it answers with a cookie, which no script can read and no other
    site can have sent along, and sends the browser on to `/`. A request without either is answered 401. Where no token
    is asked for, a request for another machine's name, or from another page, is answered 403.

    Args:
        host: the interface to listen on. port: if it is taken, the next free one; 0: any.
        behind: port of the server, on 127.0.0.1. token: of ASCII; None: for a host of this machine alone.

    Attributes:
        port: that it listens on.

    Raises:
        UsageError: there is no such interface, or no port is free.
    """

    def __init__(self, host: str, port: int, behind: int, token: str | None) -> None:
        self._behind, self._token = behind, None if token is None else token.encode("ascii")
        self._tasks: set[asyncio.Task] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="token door", daemon=True)
        self._thread.start()
        try:
            self._server = asyncio.run_coroutine_threadsafe(self._listen(host, port), self._loop).result()
        except OSError as error:
            self._stop()
            raise UsageError(f"no page can be served at {host!r}: {error.strerror or error}; try 127.0.0.1") from None
        self.port = self._server.sockets[0].getsockname()[1]

    def close(self) -> None:
        """Listen no more, and end what is open."""
        asyncio.run_coroutine_threadsafe(self._end(), self._loop).result()
        self._stop()

    def _stop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _listen(self, host: str, port: int) -> asyncio.Server:
        last = port if port == 0 else min(port + _PORTS, 65535)
        for one in range(port, last):
            with contextlib.suppress(OSError):
                return await asyncio.start_server(self._answer, host, one)
        return await asyncio.start_server(self._answer, host, last)

    async def _end(self) -> None:
        self._server.close()
        others = self._tasks - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        gone = (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError)  # or it speaks no HTTP
        ended = asyncio.CancelledError  # by `_end`; what is cancelled is logged with a traceback up to Python 3.11
        try:
            with contextlib.suppress(*gone, ended):
                if len(self._tasks) <= _MOST:
                    await self._let_in(reader, writer)
        finally:
            self._tasks.discard(task)
            await _closed(writer)

    async def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _PATIENCE)
        answer = _of_this_machine(head) if self._token is None else self._of_the_token(head, self._token)
        if answer is not None:
            writer.write(answer)
            return
        to, through = await asyncio.open_connection("127.0.0.1", self._behind)
        try:
            through.write(head)
            await asyncio.gather(_copy(reader, through), _copy(to, writer))
        finally:
            await _closed(through)

    def _of_the_token(self, head: bytes, token: bytes) -> bytes | None:
        """The answer to a request that is not handed on; None: it brings the cookie."""
        target, headers = _read(head)
        brought = parse_qs(_split(target).query).get("token", [""])[0]
        if _same(brought, token):
            cookie = f"{self._cookie}={quote(brought, safe='')}; Path=/; HttpOnly; SameSite=Lax"
            return _response(HTTPStatus.SEE_OTHER, "", f"Location: /\r\nSet-Cookie: {cookie}\r\n")
        if any(_same(unquote(cookie), token) for cookie in _cookies(headers, self._cookie)):
            return None
        return _response(HTTPStatus.UNAUTHORIZED, "This page asks for the address with ?token=…\n")

    @property
    def _cookie(self) -> str:
        return f"armload_{self.port}"  # a browser sends a machine's cookies to all of its ports


def _of_this_machine(head: bytes) -> bytes | None:
    """The answer to a request that is not handed on; None: it is for this machine, and from its own page or none."""
    _, headers = _read(head)
    asked = headers.get("host", [""])
    if len(asked) != 1 or not is_loopback(
        _split(f"//{asked[0]}").hostname or ""
    ):  # a name that leads here may be anyone's
        said = "This page is at 127.0.0.1 and localhost; for another name give armload live a --token-file.\n"
        return _response(HTTPStatus.FORBIDDEN, said)
    if any(_split(origin).netloc.lower() != asked[0].lower() for origin in headers.get("origin", ())):
        return _response(HTTPStatus.FORBIDDEN, "This page answers no other page.\n")
    return None


def _same(brought: str, token: bytes) -> bool:
    return hmac.compare_digest(brought.encode("utf-8", "replace"), token)


def _read(head: bytes) -> tuple[str, dict[str, list[str]]]:
    """What a request asks for, and its headers, by their names in small letters."""
    first, *lines = head.decode("latin-1").split("\r\n")
    headers: dict[str, list[str]] = {}
    for line in lines:
        name, _, value = line.partition(":")
        headers.setdefault(name.strip().lower(), []).append(value.strip())
    return [*first.split(" "), ""][1], headers


def _cookies(headers: dict[str, list[str]], name: str) -> list[str]:
    found: list[str] = []
    for value in headers.get("cookie", ()):
        with contextlib.suppress(CookieError):
            found += [morsel.value for key, morsel in SimpleCookie(value).items() if key == name]
    return found


def _split(address: str) -> SplitResult:
    """The parts of an address; of none, none."""
    try:
        return urlsplit(address)
    except ValueError:
        return urlsplit("")


def _response(status: HTTPStatus, text: str, more: str = "") -> bytes:
    body = text.encode()
    head = f"HTTP/1.1 {status.value} {status.phrase}\r\n{more}Content-Type: text/plain; charset=utf-8\r\n"
    return f"{head}Content-Length: {len(body)}\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n".encode() + body


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """All that comes, until its end; a reader that is slow slows whoever sends."""
    while chunk := await reader.read(_CHUNK):
        writer.write(chunk)
        await writer.drain()
    await _closed(writer)


async def _closed(writer: asyncio.StreamWriter) -> None:
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()
