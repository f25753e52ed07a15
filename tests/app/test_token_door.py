"""The door before a page: who may come in gets what is behind it, byte for byte; nobody else does."""

import contextlib
import http.client
import importlib.metadata
import socket
import threading
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import pytest

from armload.app.page.server import PageServer
from armload.app.page.token_door import TokenDoor
from armload.errors import UsageError

TOKEN = "of sixteen & more; =%+"
QUOTED = "of%20sixteen%20%26%20more%3B%20%3D%25%2B"
BODY = bytes(range(256)) * 4096


class Behind(BaseHTTPRequestHandler):
    """Sends a megabyte, and back what it was sent."""

    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(BODY)

    def do_POST(self):
        sent = self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(200)
        self.end_headers()
        self.wfile.write(sent[::-1])

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def door():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Behind)
    threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
    door = TokenDoor("127.0.0.1", 0, server.server_address[1], TOKEN)
    yield door
    door.close()
    server.shutdown()
    server.server_close()


def ask(door, path, cookie=None, method="GET", body=None):
    connection = http.client.HTTPConnection("127.0.0.1", door.port, timeout=10.0)
    try:
        connection.request(method, path, body, {} if cookie is None else {"Cookie": cookie})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def test_the_address_with_the_token_brings_a_cookie_that_opens_all_else(door):
    status, headers, _ = ask(door, f"/?token={QUOTED}")
    assert (status, headers["Location"]) == (303, "/")
    cookie, *flags = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Lax"} <= set(flags)
    assert ask(door, "/some/file", f"another=1; {cookie}")[::2] == (200, BODY)
    assert ask(door, "/", cookie, "POST", BODY)[::2] == (200, BODY[::-1])


@pytest.mark.parametrize(
    ("path", "cookie"),
    [
        ("/", None),
        ("/?token=", None),
        ("/?token=another", None),
        ("/", "armload_{port}=another"),
        ("/", "armload_1=" + QUOTED),
    ],
)
def test_without_the_token_nothing_behind_the_door_answers(door, path, cookie):
    status, _, said = ask(door, path, None if cookie is None else cookie.format(port=door.port))
    assert status == 401
    assert b"token" in said
    assert TOKEN.encode() not in said


@pytest.fixture(scope="module")
def open_door(door):
    """A door of this machine's own, before the same server."""
    other = TokenDoor("127.0.0.1", 0, door._behind, None)
    yield other
    other.close()


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "127.0.0.1:{port}"}, 200),
        ({"Host": "localhost:{port}"}, 200),
        ({"Host": "localhost:9000", "Origin": "http://localhost:9000"}, 200),  # through a tunnel
        ({"Host": "127.0.0.1:{port}", "Origin": "http://127.0.0.1:{port}"}, 200),
        ({"Host": "127.0.0.1:{port}", "Origin": "http://evil.example"}, 403),
        ({"Host": "127.0.0.1:{port}", "Origin": "http://127.0.0.1:1"}, 403),
        ({"Host": "127.0.0.1:{port}", "Origin": "null"}, 403),
        ({"Host": "evil.example:{port}", "Origin": "http://evil.example:{port}"}, 403),  # whose name leads here
        ({"Host": ""}, 403),
    ],
)
def test_on_this_machine_no_page_but_its_own_gets_in(open_door, headers, status):
    connection = http.client.HTTPConnection("127.0.0.1", open_door.port, timeout=10.0)
    try:
        connection.putrequest("GET", "/some/file", skip_host=True)
        for name, value in headers.items():
            connection.putheader(name, value.format(port=open_door.port))
        connection.endheaders()
        assert connection.getresponse().status == status
    finally:
        connection.close()


def handshake(port, target="/", **headers):
    """The status of an answer to a browser that asks for the page's websocket."""
    version = importlib.metadata.version("viser")
    lines = [f"GET {target} HTTP/1.1", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
    lines += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", f"Sec-WebSocket-Protocol: viser-v{version}"]
    lines += [f"{name}: {value}" for name, value in {"Host": f"127.0.0.1:{port}", **headers}.items()]
    with socket.create_connection(("127.0.0.1", port), timeout=30.0) as connection:
        connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return int(connection.recv(4096).split()[1])


@pytest.mark.parametrize(
    ("host", "token"), [("0.0.0.0", TOKEN), ("0.0.0.0", None), ("127.0.0.1", TOKEN), ("127.0.0.1", None)]
)
def test_the_websocket_of_a_page_has_the_same_door(host, token):
    pytest.importorskip("viser", reason="the page needs viser")
    server = PageServer(host, 0, "a page", token)
    try:
        address = urlsplit(server.url)
        port = address.port
        assert handshake(port, Origin="http://evil.example") in (401, 403)
        if host == "127.0.0.1" and token is None:
            assert not address.query
            assert handshake(port) == 101
            return
        assert handshake(port) == 401
        assert handshake(port, "/?token=another") == 401
        assert handshake(port, Cookie=f"armload_{port}=another") == 401
        brought = address.query.removeprefix("token=")
        assert token is None or brought == QUOTED
        assert handshake(port, Cookie=f"armload_{port}={brought}") == 101
    finally:
        server.stop()


def test_a_page_can_be_served_at_an_address_of_ipv6():
    pytest.importorskip("viser", reason="the page needs viser")
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("this machine has no loopback of IPv6")
    server = PageServer("::1", 0, "a page")
    try:
        assert server.url.startswith("http://[::1]:")
        with urllib.request.urlopen(server.url, timeout=30.0) as page:
            assert page.status == 200
    finally:
        server.stop()


def test_what_is_no_http_is_dropped(door):
    with socket.create_connection(("127.0.0.1", door.port), timeout=10.0) as connection:
        connection.sendall(b"\x00" * 100_000)
        connection.shutdown(socket.SHUT_WR)
        with contextlib.suppress(ConnectionResetError):
            assert connection.recv(1) == b""


def test_a_port_that_is_taken_is_followed_by_the_next_free_one(door):
    other = TokenDoor("127.0.0.1", door.port, 1, TOKEN)
    try:
        assert door.port < other.port <= door.port + 100
    finally:
        other.close()


def test_an_interface_that_is_not_there_is_refused():
    with pytest.raises(UsageError, match="no page can be served"):
        TokenDoor("203.0.113.7", 0, 1, TOKEN)


def test_a_door_that_closes_while_somebody_looks_on_says_nothing(caplog):
    with socket.create_server(("127.0.0.1", 0)) as behind:  # it takes requests, and lets them wait
        door = TokenDoor("127.0.0.1", 0, behind.getsockname()[1], None)
        with socket.create_connection(("127.0.0.1", door.port), timeout=10.0) as guest:
            guest.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            through, _ = behind.accept()
            with through:
                assert through.recv(100).startswith(b"GET")
                door.close()
    assert caplog.records == []
