"""An arm's process is started again, whatever it says and whatever keeps it from starting."""

import subprocess
import sys
import threading
import time
from itertools import pairwise

import pytest

from armload.service import ArmSettings, Service, ServiceSettings, service, spare
from armload.service.backoff import Backoff

PATIENCE = 30.0  # [s]
LINE = """json.dumps({"t": 1.0, "told": time.monotonic(), "known": True, "unknown": None, "why": None, "mass": 0.0,
    "com": None, "age": 0.0, "lag": 0.0})"""


@pytest.fixture
def noted():
    """What a service has said for its log."""
    return []


@pytest.fixture
def running(monkeypatch, noted):
    """A factory of services whose one arm's process is a program of so many lines; its n-th start may fail."""
    services = []

    def start(program, fails=()):
        starts = []

        def started():
            starts.append(time.monotonic())
            if len(starts) in fails:
                raise BlockingIOError(11, "Resource temporarily unavailable")
            command = [sys.executable, "-c", f"import json, os, sys, time\nsys.stdin.readline()\n{program}"]
            return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

        monkeypatch.setattr(spare, "_started", started)
        arm = ArmSettings(name="left", source="sim", robot="panda")
        services.append(Service(ServiceSettings((arm,), spare=False), noted.append))
        threading.Thread(target=services[-1].run, args=(PATIENCE,), daemon=True).start()
        return services[-1], starts

    yield start
    for each in services:
        each.close()


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_line_that_is_no_answer_is_passed_over(running):
    one, starts = running(f"print(1, flush=True)\nprint({LINE}, flush=True)\nsys.exit(3)")
    until(lambda: len(starts) >= 3)
    assert one.error is None


def test_an_arm_whose_process_cannot_be_started_for_once_is_started_again(running):
    one, starts = running("sys.exit(3)", fails=(2, 3))
    until(lambda: len(starts) >= 5)
    assert one.error is None


def test_what_an_arm_cannot_begin_with_ends_the_service_at_first_and_is_tried_again_later(running):
    refused = 'print(json.dumps({"error": "there is no tare"}), flush=True)'
    one, _ = running(refused)
    until(lambda: one.error is not None)
    assert one.error == "left: there is no tare"
    again, starts = running(refused, fails=(1,))
    until(lambda: len(starts) >= 4)
    assert again.error is None
    assert "there is no tare" in again.answer("left")["why"]


def test_what_keeps_an_arm_from_starting_again_is_said_once_as_long_as_it_stays_the_same(running, noted, monkeypatch):
    monkeypatch.setattr(service, "Backoff", lambda: Backoff(0.01, 0.01))
    one, starts = running('print(json.dumps({"error": "there is no tare"}), flush=True)', fails=(1,))
    until(lambda: len(starts) >= 6)
    assert [note for note in noted if "no tare" in note] == [
        "left: its process cannot begin: there is no tare; it is started again in 0.0 s"
    ]
    assert "there is no tare" in one.answer("left")["why"]


@pytest.mark.full  # some seconds
def test_a_process_that_is_started_again_may_take_as_long_as_the_first_until_its_first_line(running, monkeypatch):
    monkeypatch.setattr(service, "HUNG", 0.3)
    _, starts = running(f"time.sleep(1.0)\nprint({LINE}, flush=True)\nsys.exit(3)")
    until(lambda: len(starts) >= 4)
    assert all(b - a > 0.9 for a, b in pairwise(starts))  # none was ended before it spoke


@pytest.mark.full  # some seconds
def test_why_a_source_is_lost_stands_once_in_the_log_and_in_its_alarm(running, noted):
    lost = f"""line = {{**{LINE.removeprefix("json.dumps(").removesuffix(")")}, "connection": "lost"}}
print(json.dumps({{"note": "sim was lost: gone; it is opened again in 0.1 s"}}), flush=True)
while True:
    why = {{"known": False, "unknown": "source lost", "why": "sim was lost: gone", "told": time.monotonic()}}
    print(json.dumps({{**line, **why}}), flush=True)
    time.sleep(0.05)"""
    one, _ = running(lost)
    heard = []
    with one.heard_by(heard.append):
        until(lambda: any("alarm" in each for each in heard))
    assert [each["text"] for each in heard if "alarm" in each] == ["sim was lost: gone"]
    until(lambda: len(noted) >= 2)
    assert noted == ["left: sim was lost: gone; it is opened again in 0.1 s", "left: source_lost raised"]


def test_a_process_that_hangs_is_ended_once_and_the_one_after_it_again(noted, monkeypatch):
    class Hung:
        def __init__(self):
            self.kills = 0

        def kill(self):
            self.kills += 1  # and it takes its time to go

    arm = ArmSettings(name="left", source="sim", robot="panda")
    supervisor, first, second = Service(ServiceSettings(arms=[arm]), note=noted.append), Hung(), Hung()
    monkeypatch.setitem(supervisor._heard, "left", time.monotonic() - 1000.0)
    for process in (first, first, first, second, second):
        supervisor.processes["left"] = process
        supervisor._look()
    supervisor.processes.clear()
    assert (first.kills, second.kills) == (1, 1)
    assert len([note for note in noted if "is ended" in note]) == 2
