"""A robot that is switched off and on again under the service, its clock then back or ahead, beside another arm."""

import contextlib
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import ARMS, arm
from armload.payloads import test_payload
from armload.recording import write_recording
from armload.service import ArmSettings, Service, ServiceSettings

pytestmark = [pytest.mark.full, pytest.mark.timeout(1500)]
SERVERS = Path(__file__).resolve().parents[1] / "devices" / "servers"
HELD = test_payload().parameters
PATIENCE = 300.0  # [s] for each step, whatever else the machine does; there "behind" is an answer, too
ONE_RUN = 100.0  # [s] a robot moves for 60 s: what has not been answered then is tried with it switched on once more
RUNS = 3
ROBOTS = [
    ("panda", "panda", "panda_py", "127.0.7.81"),
    ("fr3", "fr3", "pylibfranka", "127.0.7.82"),
    ("ur", "ur10e", "rtde_receive", "127.0.7.83"),
]


def within(patience, condition):
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def until(condition, what):
    assert within(PATIENCE, condition), what()


@contextlib.contextmanager
def switched_on(scheme, robot, log, start, address, folder):
    """The loopback robot, which moves while a log lasts, its clock at `start` [s]; killed whatever happens."""
    file = folder / f"from_{start:.0f}.npz"
    if scheme == "ur":
        current = log.tau / np.array(ARMS[robot.name].torque_constants)
        columns = {"actual_q": log.q, "actual_qd": log.dq, "actual_current": current}
        np.savez(file, timestamp=start + log.t, **columns)
        command = [SERVERS / "ur_server.py", file, "--address", address]
    else:
        np.savez(file, t=start + log.t, q=log.q, dq=log.dq, tau=log.tau)
        limits = r'\1<position_based_velocity_limits velocity_offset="0.2" deceleration_limit="5.0" />'
        urdf = folder / "robot.urdf"
        urdf.write_text(re.sub(r"(<limit [^>]*/>)", limits, robot.urdf.replace(f"{robot.name}_", "")))
        version = 10 if scheme == "fr3" else 5
        command = [SERVERS / "franka_server.py", file, "--address", address, "--version", version, "--urdf", urdf]
    with subprocess.Popen([sys.executable, *map(str, command)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ready = threading.Event()

        def hear():
            for _ in process.stdout:
                ready.set()

        thread = threading.Thread(target=hear, daemon=True)
        thread.start()
        try:
            assert ready.wait(PATIENCE)
            yield
        finally:
            process.kill()
            thread.join(30.0)


@pytest.mark.parametrize(("scheme", "name", "package", "address"), ROBOTS, ids=[scheme for scheme, *_ in ROBOTS])
def test_a_robot_that_is_switched_off_and_on_is_answered_again_whatever_its_clock_says(
    scheme, name, package, address, analytic_log, tmp_path
):
    pytest.importorskip(package, reason=f"{package} has no wheel for this Python")
    robot, panda = arm(name), arm("panda")
    log = analytic_log(robot, HELD, duration=60.0, rate=500.0 if scheme == "ur" else 1000.0)
    write_recording(tmp_path / "beside.csv", analytic_log(panda, HELD, duration=8.0, rate=100.0))
    beside = {"source": str(tmp_path / "beside.csv"), "loop": True}
    arms = (
        ArmSettings(name, name="restarted", source=f"{scheme}://{address}", method="map"),
        ArmSettings("panda", name="beside", method="map", **beside),
    )
    notes = []
    service = Service(ServiceSettings(arms, spare=False), notes.append)
    thread = threading.Thread(target=service.run, daemon=True)

    def said():
        return [service.answer("restarted"), service.answer("beside"), notes]

    def answered():
        answer = service.answer("restarted")
        if answer["connections"] <= connections or answer.get("t") in (None, t) or not answer["determined"][0]:
            return False
        return abs(answer["mass"] - HELD.mass) < 0.3

    connections, t = 0, None
    thread.start()
    try:
        for start in (1000.0, 5.0, 50_000.0):  # as it was, back, and ahead
            for run in range(RUNS):
                with switched_on(scheme, robot, log, start, address, tmp_path):
                    if not within(ONE_RUN, answered):
                        assert run < RUNS - 1, said()
                        continue
                    until(lambda: service.answer("beside").get("t") is not None, said)
                    break
            until(lambda: service.answer("restarted")["connection"] != "streaming", said)
            connections, t = service.answer("restarted")["connections"], service.answer("restarted")["t"]
        assert [service.answer(x)["restarts"] for x in service.names] == [0, 0]
        assert service.answer("beside")["connections"] == 1
    finally:
        service.close()
        thread.join(30.0)
