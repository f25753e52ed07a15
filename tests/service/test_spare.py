"""A process that is ready for the arm whose process ends next."""

import contextlib
import json
import os
import select
import signal
import time
from pathlib import Path

import pytest

from armload.devices import Detached, Reader
from armload.devices.reader import columns_of
from armload.payloads import test_payload
from armload.recording import write_recording
from armload.service import ArmSettings, Service, ServiceSettings
from armload.service.spare import Spare, order

PATIENCE = 120.0  # [s]


def until(condition, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return found


def gone(pid):
    path = Path(f"/proc/{pid}/stat")
    with contextlib.suppress(OSError):
        return " Z " in path.read_text()
    return True


@pytest.fixture
def log(panda, analytic_log, tmp_path):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, test_payload().parameters, duration=4.0))
    return path


def test_a_reader_that_was_started_ahead_serves_the_source_it_is_given(panda, log):
    ahead = Reader(columns_of(7))
    with Detached(str(log), panda, loop=True, reader=ahead) as source:
        assert source.process is ahead.process
        assert next(iter(source)).q.shape == (7,)
    other = Reader(columns_of(6))
    try:
        with Detached(str(log), panda, loop=True, reader=other) as source:
            assert source.process is not other.process
    finally:
        other.end(10.0)
        other.release()
    assert other.process.returncode == 0  # it ends without an order, and without an error


def test_a_spare_process_is_given_out_once_and_another_is_started_where_it_has_died(log):
    arm = ArmSettings(name="left", source=str(log), robot="panda", method="map", loop=True)
    spare, taken = Spare([arm]), []
    try:
        spare.prepare()
        ahead = spare._process
        spare.prepare()
        assert spare._process is ahead
        os.kill(ahead.pid, signal.SIGKILL)
        ahead.wait(PATIENCE)
        spare.prepare()
        assert spare._process.pid != ahead.pid
        ahead.communicate()
        ahead = spare._process
        taken.append(spare.take())
        assert taken[0] is ahead
        order(taken[0], {"arm": arm.to_dict(), "every": 0.1})
        assert select.select([taken[0].stdout], [], [], PATIENCE)[0]
        assert json.loads(taken[0].stdout.readline())["arm"] == "left"
        taken.append(spare.take())
        assert taken[1] is not ahead
    finally:
        spare.close()
        for process in taken:
            process.kill()
            process.communicate()


@pytest.mark.full
def test_the_spare_process_takes_over_from_one_that_is_killed_and_goes_on_from_its_state(log, tmp_path):
    arm = ArmSettings(
        name="left", source=str(log), robot="panda", method="map", loop=True, save=str(tmp_path / "state")
    )
    notes: list[str] = []
    service = Service(ServiceSettings((arm,)), notes.append)
    for thread in service._threads:
        thread.start()
    try:
        until(lambda: service.answer("left")["known"])
        service._spare.prepare()
        ahead = service._spare._process.pid
        os.kill(service.processes["left"].pid, signal.SIGKILL)
        until(lambda: service.answer("left")["restarts"] == 1 and service.answer("left")["known"])
        assert service.processes["left"].pid == ahead
        service._spare.prepare()
        ready = service._spare._process.pid
    finally:
        service.close()
    until(lambda: gone(ahead) and gone(ready))
    assert any(path.suffix == ".npz" for path in (tmp_path / "state").iterdir())
