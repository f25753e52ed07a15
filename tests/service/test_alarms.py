"""Alarms: one for each episode, told to a receiver that may be away."""

import contextlib
import json
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from armload.errors import UsageError
from armload.service import Alarms, Webhook
from armload.service import webhook as webhook_module
from armload.service.alarms import CLEARED_AFTER, RAISED_AFTER


def answer(mass=1.0, com=(0.0, 0.0, 0.05), **more):
    known = {"known": True, "unknown": None, "why": None, "held": True, "determined": [True] * 10}
    return {**known, "mass": mass, "com": list(com), **more}


UNKNOWN = {"known": False, "unknown": "changing", "why": "", "mass": 9.0, "com": None}


def told(alarms, said, seconds, start, step=0.1):
    """Alarms while the same is said for so long, and when that ends."""
    steps = round(seconds / step)
    return [a for k in range(steps) for a in alarms.look(said, start + k * step)], start + steps * step


def test_an_episode_raises_once_and_clears_once():
    alarms, now, seen = Alarms("a", rating=3.0), 0.0, []
    for _ in range(2):
        for mass, seconds in ((3.5, 2.0), (1.0, CLEARED_AFTER + 1.0)):
            found, now = told(alarms, answer(mass), seconds, now)
            seen += [(a.kind, a.raised) for a in found]
    assert seen == [("over_rating", True), ("over_rating", False)] * 2


def test_a_source_that_comes_again_is_said_to_whatever_is_unknown_then():
    alarms, now, seen = Alarms("a"), 0.0, []
    lost = {**UNKNOWN, "unknown": "source lost", "why": "gone"}
    for said in (lost, {**UNKNOWN, "why": "the payload is changing"}):
        found, now = told(alarms, said, CLEARED_AFTER + 1.0, now)
        seen += [(a.kind, a.raised, a.text) for a in found]
    assert seen == [("source_lost", True, "gone"), ("source_lost", False, "samples come again")]


@pytest.mark.parametrize(
    ("rated", "text"),
    [(0.02, "0.0243 kg are held, 0.02 kg"), (3.0, "3.64 kg are held, 3 kg"), (150.0, "182.1 kg are held, 150 kg")],
)
def test_too_large_a_mass_is_said_to_the_digits_that_are_known_of_an_arm_of_that_rating(rated, text):
    (alarm,) = told(Alarms("a", rating=rated), answer(1.2137 * rated), 1.0, 0.0)[0]
    assert alarm.text == f"{text} are allowed"


def test_a_limit_that_is_grazed_gives_one_alarm():
    alarms, now, seen = Alarms("a", rating=3.0), 0.0, []
    for k in range(20):
        found, now = told(alarms, answer(3.1 if k % 2 == 0 else 2.9), 1.0, now)
        seen += found
    assert [a.raised for a in seen] == [True]


def test_what_lasts_shorter_than_the_hysteresis_is_no_alarm():
    alarms = Alarms("a", rating=3.0)
    found, now = told(alarms, answer(3.5), 0.9 * RAISED_AFTER, 0.0)
    assert found == []
    assert told(alarms, answer(1.0), 3.0, now)[0] == []


def test_an_unknown_answer_neither_raises_nor_clears_a_mass():
    alarms = Alarms("a", rating=3.0)
    assert told(alarms, UNKNOWN, 60.0, 0.0)[0] == []
    told(alarms, answer(3.5), 2.0, 60.0)
    assert alarms.raised == {"over_rating"}
    assert told(alarms, UNKNOWN, 60.0, 62.0)[0] == []
    assert alarms.raised == {"over_rating"}


def test_what_lasted_before_an_unknown_time_does_not_count_after_it():
    alarms, now = Alarms("a", rating=3.0), 0.0
    for mass, lasts in ((3.5, RAISED_AFTER), (1.0, CLEARED_AFTER)):
        for said, seconds in ((answer(mass), 0.9 * lasts), (UNKNOWN, 60.0), (answer(mass), 0.9 * lasts)):
            found, now = told(alarms, said, seconds, now)
            assert found == []
        found, now = told(alarms, answer(mass), lasts, now)
        assert len(found) == 1


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        (answer(com=(0.0, 0.3, 0.4)), "com_out_of_range"),
        (answer(arm_changed="another arm"), "arm_changed"),
        ({**UNKNOWN, "unknown": "samples implausible", "why": "tau of joint 2 has the wrong sign"}, "arm_changed"),
        ({**UNKNOWN, "unknown": "source lost", "why": "gone"}, "source_lost"),
        ({**UNKNOWN, "unknown": "silent", "why": "gone"}, "source_lost"),
    ],
)
def test_each_kind_is_told_with_what_it_rests_on(said, kind):
    (alarm,) = told(Alarms("a", rating=3.0, com_range=0.4), said, 2.0, 0.0)[0]
    assert (alarm.kind, alarm.raised) == (kind, True)
    assert alarm.text
    if kind == "com_out_of_range":
        assert (alarm.value, alarm.limit) == (pytest.approx(0.5), 0.4)


def test_a_centre_of_mass_of_nothing_is_no_alarm():
    far = answer(mass=0.01, com=(5.0, 0.0, 0.0), held=False)
    assert told(Alarms("a", com_range=0.1), far, 5.0, 0.0)[0] == []


@pytest.fixture
def receiver():
    """A real server that takes what it is sent after it has answered as told."""
    taken, codes = [], [503, 200]  # `taken` has "GET", too, which a receiver of alarms is never asked

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            code = codes.pop(0) if codes else 200
            if isinstance(code, bytes):
                self.wfile.write(code)
                return
            if code == 200:
                taken.append((json.loads(body), self.headers.get("Authorization")))
            self.send_response(code)
            if 300 <= code < 400:
                self.send_header("Location", "/elsewhere")
            self.end_headers()

        def do_GET(self):
            taken.append("GET")
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/alarms", taken, codes
        server.shutdown()
        thread.join()


def until(condition, seconds=10.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    assert condition()


def test_alarms_arrive_in_order_though_the_receiver_fails_first(receiver):
    url, taken, _ = receiver
    webhook = Webhook(url, {"Authorization": "Bearer x"})
    for k in range(3):
        webhook.post({"number": k})
    until(lambda: len(taken) == 3)
    webhook.close()
    assert taken == [({"number": k}, "Bearer x") for k in range(3)]


def test_a_message_that_will_never_be_taken_holds_up_no_other_and_is_said_to_be_dropped(receiver, caplog):
    url, taken, codes = receiver
    codes[:] = [400]
    webhook = Webhook(url)
    webhook.post({"number": 0})
    webhook.post({"number": 1})
    until(lambda: taken and webhook.sent == 1)
    webhook.close()
    assert [message["number"] for message, _ in taken] == [1]
    assert (webhook.sent, webhook.dropped) == (1, 1)
    dropped = "the webhook answered 400: what it answers so is dropped"
    assert caplog.messages == [dropped, "the webhook takes alarms again; 1 was dropped"]


@pytest.mark.parametrize("code", [301, 302, 303, 307, 308])
@pytest.mark.full  # some seconds
def test_a_receiver_that_has_moved_is_said_and_no_alarm_is_lost_to_it(receiver, caplog, code):
    url, taken, codes = receiver
    codes[:] = [code]
    webhook = Webhook(url, {"Authorization": "Bearer x"})
    webhook.post({"number": 0})
    until(lambda: webhook.sent == 1)
    webhook.close()
    assert taken == [({"number": 0}, "Bearer x")]
    said = f"the webhook answered {code}, that it is elsewhere: give the address it is at"
    assert caplog.messages == [said, "the webhook takes alarms again"]


def test_an_answer_that_is_no_http_is_said_and_alarms_go_on(receiver, caplog):
    url, taken, codes = receiver
    codes[:] = [b"garbage\r\n\r\n"]
    webhook = Webhook(url)
    webhook.post({"number": 0})
    until(lambda: webhook.sent == 1)
    webhook.close()
    assert [message["number"] for message, _ in taken] == [0]
    assert caplog.messages == ["the webhook did not answer: garbage", "the webhook takes alarms again"]


@contextlib.contextmanager
def dribbling():
    """A receiver that begins its first answer and never ends it, and then takes what comes; the second is whole."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        taken = []

        def serve():
            with contextlib.suppress(OSError):
                first, _ = server.accept()
                threading.Thread(target=dribble, args=(first,), daemon=True).start()
                second, _ = server.accept()
                with second:
                    taken.append(b"")
                    while not taken[0].endswith(b"}"):  # head and body may come one after the other
                        taken[0] += second.recv(65536)
                    second.sendall(b"HTTP/1.0 200 OK\r\nContent-Length: 0\r\n\r\n")

        def dribble(connection):
            with connection, contextlib.suppress(OSError):
                connection.sendall(b"HTTP/1.0 200 OK\r\nX: ")
                while True:
                    connection.sendall(b"x")
                    time.sleep(0.02)

        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{server.getsockname()[1]}/", taken


def test_a_receiver_that_answers_byte_by_byte_without_an_end_is_asked_again(monkeypatch, caplog):
    monkeypatch.setattr(webhook_module, "_ANSWERED", 0.3)
    with dribbling() as (url, taken):
        webhook = Webhook(url)
        webhook.post({"k": 7})
        until(lambda: webhook.sent == 1)
        webhook.close()
    assert b'{"k": 7}' in taken[0]
    assert "did not answer: timed out" in caplog.text


def test_what_waits_for_a_dead_receiver_is_bounded_and_what_is_dropped_is_said(caplog):
    webhook = Webhook("http://127.0.0.1:9/nobody")
    for k in range(3000):
        webhook.post({"number": k})
    assert webhook.dropped >= 1990
    webhook.close()
    said = "the webhook does not get all alarms: 1000 wait, the oldest are dropped"
    assert caplog.messages.count(said) == 1
    webhook.health.tell(None)
    assert caplog.messages[-1] == f"the webhook takes alarms again; {webhook.dropped} were dropped"


def test_an_address_that_is_none_is_refused():
    with pytest.raises(UsageError, match="expected an address"):
        Webhook("ftp://host/x")
    with pytest.raises(UsageError, match="expected an address"):
        Webhook("https://cell..host/x")
    with pytest.raises(UsageError, match=r"ftp://…@host/x") as said:
        Webhook("ftp://me:secret@host/x")
    assert "secret" not in str(said.value)


def test_a_header_that_is_no_text_is_refused():
    with pytest.raises(UsageError, match="header Authorization is a list: expected a text"):
        Webhook("https://host/x", {"Authorization": ["x"]})
