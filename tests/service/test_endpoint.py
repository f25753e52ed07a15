"""The endpoint: clients that go make room for others, and what no client should send is answered."""

import contextlib
import json
import socket
import threading
import time
import urllib.error
import urllib.request

import pytest

from armload.errors import UsageError
from armload.service import Endpoint
from armload.service.endpoint import _MOST, _STREAMS, _Handler


class Cell:
    """Two arms, of which "ended" says nothing any more and "right" all the time."""

    names = ("ended", "right")

    def __init__(self):
        self.listeners, self.gone = [], threading.Event()

    def answer(self, name):
        return {"arm": name, "known": True, "why": None}

    @contextlib.contextmanager
    def heard_by(self, listener):
        self.listeners.append(listener)
        try:
            yield
        finally:
            self.listeners.remove(listener)

    def speak(self):
        while not self.gone.wait(0.02):
            for listener in list(self.listeners):
                listener(self.answer("right"))


@pytest.fixture
def address():
    """Where the endpoint listens."""
    cell = Cell()
    endpoint, thread = Endpoint(cell, "127.0.0.1", 0), threading.Thread(target=cell.speak)
    thread.start()
    yield "127.0.0.1", int(endpoint.url.rpartition(":")[2])
    cell.gone.set()
    thread.join()
    endpoint.close()


def asked(address, path, host="localhost"):
    """A connection that has asked, and the first line of its answer."""
    connection = socket.create_connection(address, timeout=10.0)
    connection.sendall(f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
    return connection, connection.recv(4096).partition(b"\r\n")[0]


def test_clients_that_leave_the_stream_of_an_arm_that_ended_make_room_for_others(address):
    for _ in range(_STREAMS):
        connection, line = asked(address, "/stream/ended")
        connection.close()
        assert line.endswith(b"200 OK")
    end = time.monotonic() + 20.0
    while True:
        connection, line = asked(address, "/stream/ended")
        connection.close()
        if line.endswith(b"200 OK"):
            break
        assert time.monotonic() < end  # there is no room yet
        time.sleep(0.05)


def test_streams_that_stay_open_leave_room_for_who_asks_whether_all_is_well(address):
    with contextlib.ExitStack() as open_ones:
        for _ in range(_STREAMS):
            connection, line = asked(address, "/stream")
            open_ones.enter_context(connection)
            assert line.endswith(b"200 OK")
        for _ in range(3):  # and more are told why not
            connection, line = asked(address, "/stream/right")
            connection.close()
            assert line.endswith(b"503 Service Unavailable")
        with urllib.request.urlopen(f"http://127.0.0.1:{address[1]}/health", timeout=10.0) as response:
            assert json.loads(response.read())["well"]


def test_a_connection_too_many_is_told_so(address):
    with contextlib.ExitStack() as open_ones:
        for _ in range(_MOST):  # that ask for nothing
            open_ones.enter_context(socket.create_connection(address, timeout=10.0))
        with socket.create_connection(address, timeout=10.0) as connection:
            said = connection.makefile("rb").read()
    assert said.startswith(b"HTTP/1.0 503")
    assert "too many connections" in json.loads(said.partition(b"\r\n\r\n")[2])["error"]


@pytest.mark.skipif(not socket.has_ipv6, reason="this machine has no IPv6")
def test_an_address_of_ipv6_can_be_listened_at():
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("this machine has no loopback of IPv6")
    endpoint = Endpoint(Cell(), "::1", 0)
    try:
        assert endpoint.url.startswith("http://[::1]:")
        with urllib.request.urlopen(f"{endpoint.url}/arms/right", timeout=10.0) as answer:
            assert json.load(answer)["arm"] == "right"
    finally:
        endpoint.close()


def test_a_host_that_is_not_there_is_said_with_the_port():
    with pytest.raises(UsageError, match=r"cannot listen at 192\.0\.2\.1:0: .*; name another host or port"):
        Endpoint(Cell(), "192.0.2.1", 0, "sixteen characters")


def test_a_stream_of_one_arm_goes_on_though_it_is_silent_for_a_while(address):
    with asked(address, "/stream/ended")[0] as ended, asked(address, "/stream/right")[0] as right:
        ended.settimeout(2.5)
        with pytest.raises(TimeoutError):
            ended.recv(4096)  # neither a line of the other arm nor an end
        assert b'"right"' in right.recv(4096)


@pytest.mark.parametrize(("path", "host"), [("/health", "["), ("http://[/health", "localhost")])
def test_an_address_that_cannot_be_read_is_a_bad_request(address, path, host, capfd):
    connection, line = asked(address, path, host)
    connection.close()
    assert line.endswith(b"400 Bad Request")
    assert capfd.readouterr().err == ""


def request(endpoint_url, path, method="GET", headers=None):
    """Status, type and text of an answer."""
    asks = urllib.request.Request(f"{endpoint_url}{path}", method=method, headers=headers or {})
    try:
        with urllib.request.urlopen(asks, timeout=10.0) as response:
            return response.status, response.headers["Content-Type"], response.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers["Content-Type"], error.read()


def test_who_watches_over_services_may_ask_for_the_head_alone(address):
    url = f"http://127.0.0.1:{address[1]}"
    for path in ("/health", "/arms", "/stream/right"):
        assert request(url, path, "HEAD")[::2] == (200, b"")
    assert request(url, "/nothing", "HEAD")[::2] == (404, b"")


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_what_would_change_something_is_refused_in_json(address, method):
    status, kind, text = request(f"http://127.0.0.1:{address[1]}", "/arms", method)
    assert (status, kind) == (501, "application/json")
    assert json.loads(text) == {"error": "expected GET or HEAD"}


def test_a_request_that_is_none_is_refused_in_json(address):
    with socket.create_connection(address, timeout=10.0) as connection:
        connection.sendall(b"no request at all\r\n\r\n")
        assert b"error" in connection.makefile("rb").read()


@pytest.mark.parametrize(
    ("said", "status"),
    [("Bearer secret", 200), ("bearer secret", 200), ("Bearer  secret", 200), ("Basic secret", 401), ("secret", 401)],
)
def test_the_word_before_the_token_may_be_written_in_any_case(said, status):
    endpoint = Endpoint(Cell(), "127.0.0.1", 0, token="secret")
    try:
        assert request(endpoint.url, "/arms", headers={"Authorization": said})[0] == status
    finally:
        endpoint.close()


def hung_up(connection, end):
    """Whether who sends a byte from time to time is hung up on before `end`."""
    while time.monotonic() < end:
        try:
            connection.sendall(b"x")
            if connection.recv(1) == b"":
                return True
        except TimeoutError:  # nothing is said yet
            continue
        except ConnectionError:
            return True
    return False


def test_a_client_that_sends_its_request_byte_by_byte_is_hung_up_on(monkeypatch):
    monkeypatch.setattr(_Handler, "patience", 0.5)
    endpoint = Endpoint(Cell(), "127.0.0.1", 0)
    address = "127.0.0.1", int(endpoint.url.rpartition(":")[2])
    try:
        with socket.create_connection(address, timeout=0.05) as slow:
            slow.sendall(b"GET /health HTTP/1.1\r\nHost: localhost\r\nX: ")
            assert hung_up(slow, time.monotonic() + 10.0)
        with asked(address, "/stream/ended")[0] as still:
            still.settimeout(1.5)
            with pytest.raises(TimeoutError):  # who has asked is not hung up on
                still.recv(4096)
    finally:
        endpoint.close()
