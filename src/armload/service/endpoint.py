"""Answers over HTTP: the newest of each arm, all of them, and a stream of lines; nothing can be changed through it."""

from __future__ import annotations

import contextlib
import hmac
import io
import json
import queue
import select
import socket
import sys
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from armload.errors import UsageError
from armload.service.access import is_loopback
from armload.service.in_time import InTime

if TYPE_CHECKING:
    from armload.service.service import Service

_MOST = 32  # connections at once: a page and some scripts, not a crowd
_STREAMS = 24  # of them, which stay: whoever asks /health gets in beside them
_FULL = b"HTTP/1.0 503 Service Unavailable\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n%s"
_TOO_MANY = b'{"error": "too many connections at once: try again"}\n'
_PATIENCE = 10.0  # [s] a client may take to send its request, or to take a line
_LOOK = 1.0  # [s] without a line after which a stream looks whether its client is still there


class Endpoint:
    """A small server in threads of its own.

    | address | answer |
    |---|---|
    | `/arms` | the newest answers of all arms, by name |
    | `/arms/NAME` | one of them |
    | `/health` | 200 if all arms are known, else 503, with the reasons |
    | `/stream`, `/stream/NAME` | lines of JSON, as on standard output, until the client goes; 503 beyond 24 at once |

    Args:
        service: what to ask. host, port: 0: a free one. token: a request must bring `Authorization: Bearer TOKEN`.
            None: none is needed, and then only requests to a name of this machine are answered, so that no web page can
            have its visitor's browser ask.

    Raises:
        UsageError: there is no such interface, or the port cannot be had.
    """

    def __init__(self, service: Service, host: str, port: int, token: str | None = None) -> None:
        handler = type("Handler", (_Handler,), {"service": service, "token": token})
        where = f"[{host}]" if ":" in host else host  # an address of IPv6, as it stands in a URL
        try:
            self._server = (_Server6 if ":" in host else _Server)((host, port), handler)
        except OSError as error:
            raise UsageError(
                f"the endpoint cannot listen at {where}:{port}: {error.strerror}; name another host or port"
            ) from None
        self.url = f"http://{where}:{self._server.server_address[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.2,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, *arguments: Any) -> None:
        self._free, self.streams = threading.Semaphore(_MOST), threading.Semaphore(_STREAMS)
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        if not self._free.acquire(blocking=False):
            with contextlib.suppress(OSError):  # without waiting for what it asks, or for its taking the answer
                request.setblocking(False)
                request.send(_FULL % (len(_TOO_MANY), _TOO_MANY))
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes is no error; anything else is shown."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Server6(_Server):
    address_family = socket.AF_INET6


class _Handler(BaseHTTPRequestHandler):
    service: Service
    token: str | None
    timeout = patience = _PATIENCE

    def setup(self) -> None:
        super().setup()
        self.rfile.close()  # which waits so long for each byte
        self.rfile = io.BufferedReader(InTime(self.connection, self.patience))

    def parse_request(self) -> bool:
        """Read what follows the first line; from then on each line that is sent has its own time."""
        try:
            return super().parse_request()
        finally:
            self.connection.settimeout(self.timeout)

    def do_GET(self) -> None:
        try:
            path, host = urlsplit(self.path).path, urlsplit(f"//{self.headers.get('Host', '')}").hostname
        except ValueError:
            self._answer(400, {"error": "expected an address and a header Host that can be read"})
            return
        if not self._allowed(host):
            return
        parts = [unquote(part) for part in path.split("/") if part]
        names = self.service.names
        if len(parts) == 2 and parts[0] in ("arms", "stream") and parts[1] not in names:
            self._answer(404, {"error": f"there is no arm {parts[1]!r}: expected one of {', '.join(names)}"})
        elif parts == ["arms"]:
            self._answer(200, {name: self.service.answer(name) for name in names})
        elif len(parts) == 2 and parts[0] == "arms":
            self._answer(200, self.service.answer(parts[1]))
        elif parts == ["health"]:
            unknown = {name: self.service.answer(name) for name in names}
            unknown = {name: said["why"] for name, said in unknown.items() if not said["known"]}
            self._answer(503 if unknown else 200, {"well": not unknown, "unknown": unknown})
        elif parts[:1] == ["stream"] and len(parts) <= 2:
            self._stream_if_free(parts[1] if len(parts) == 2 else None)
        else:
            self._answer(404, {"error": "expected /arms, /arms/NAME, /health, /stream or /stream/NAME"})

    do_HEAD = do_GET  # the same without what it says, as who watches over services asks

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """A request that is none, or of a kind that changes something."""
        self.close_connection = True
        self._answer(code, {"error": "expected GET or HEAD" if code == 501 else message or explain or "no request"})

    def _allowed(self, host: str | None) -> bool:
        if self.token is not None:
            scheme, _, given = self.headers.get("Authorization", "").partition(" ")  # RFC 9110, 11.1: in any case
            if scheme.lower() == "bearer" and hmac.compare_digest(given.strip().encode(), self.token.encode()):
                return True
            self._answer(401, {"error": "expected the header Authorization: Bearer TOKEN"})
            return False
        if host is not None and is_loopback(host):
            return True
        self._answer(403, {"error": "expected a request to 127.0.0.1 or localhost"})
        return False

    def _answer(self, code: int, value: Any) -> None:
        text = (json.dumps(value, allow_nan=False) + "\n").encode()
        self.send_response(code)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(text)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(text)

    def _stream_if_free(self, name: str | None) -> None:
        assert isinstance(self.server, _Server)
        if not self.server.streams.acquire(blocking=False):
            self._answer(503, {"error": f"{_STREAMS} streams are open already: close one, or ask /arms"})
            return
        try:
            self._stream(name)
        finally:
            self.server.streams.release()

    def _stream(self, name: str | None) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "application/x-ndjson")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if self.command == "HEAD":
            return
        lines: queue.Queue[dict[str, Any]] = queue.Queue(100)
        with self.service.heard_by(_into(lines, name)):
            while True:
                try:
                    line = lines.get(timeout=_LOOK)
                except queue.Empty:
                    if self._left():
                        return
                    continue
                self.wfile.write((json.dumps(line, allow_nan=False) + "\n").encode())
                self.wfile.flush()

    def _left(self) -> bool:
        """Whether the client has closed the connection; what else it has sent is dropped."""
        return bool(select.select([self.connection], [], [], 0.0)[0]) and not self.connection.recv(4096)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged."""


def _into(lines: queue.Queue[dict[str, Any]], name: str | None) -> Callable[[dict[str, Any]], None]:
    """Puts an arm's lines, or all, into a queue; where its reader is too slow, the oldest gives way."""

    def put(line: dict[str, Any]) -> None:
        if name is not None and line.get("arm") != name:
            return None
        while True:
            try:
                return lines.put_nowait(line)
            except queue.Full:
                with contextlib.suppress(queue.Empty):
                    lines.get_nowait()

    return put
