"""A payload that is written to a robot in fault: once, with a sentence that says what the controller may count.

Through the makers' own clients, against loopback robots (`servers`).
"""

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import arm
from armload.devices import Load, open_mover
from armload.errors import SentError, SinkError
from armload.inertia import InertialParameters
from armload.motion import FourierMotion, save_motion

pytestmark = pytest.mark.full
SERVERS = Path(__file__).resolve().parent / "servers"
UR = [0.3, -1.2, 1.4, -1.0, 1.3, 0.4]
FRANKA = [0.0, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5]
MAKES = {
    "ur": ("ur10e", "rtde_control", "ur_robot.py", UR),
    "fr3": ("fr3", "pylibfranka", "franka_robot.py", FRANKA),
    "panda": ("panda", "panda_py", "franka_robot.py", FRANKA),
}


class Cell:
    """A loopback robot, an arm that is read and moved there, and what it was told."""

    def __init__(self, make, process, address):
        self.name, self.process, self.events = MAKES[make][0], process, []
        self.robot, self.spec = arm(self.name), f"{make}://{address}"
        flange = "tool0" if make == "ur" else f"{self.name}_link8"
        self.load = Load(InertialParameters.from_com(1.2, (0.01, -0.02, 0.06), 4e-3 * np.eye(3), flange))
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()

    def _listen(self):
        for line in self.process.stdout:
            self.events.append(json.loads(line))

    def said(self, event):
        return [each for each in self.events if each["event"] == event]

    def wait(self, event):
        until = time.monotonic() + 60.0
        while not self.said(event):
            assert time.monotonic() < until, self.events
            time.sleep(0.02)

    def order(self, line, event=None):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        if event is not None:
            self.wait(event)

    def write(self, fault):
        """Write as `armload measure --apply` does, under the fault; what was sent."""
        with open_mover(self.spec, self.robot) as mover:
            next(iter(mover))
            if fault:
                self.order(fault, fault)
            return mover.write(self.load)


@pytest.fixture(params=MAKES)
def cell(request):
    _, package, program, at = MAKES[request.param]
    pytest.importorskip(package, reason="the maker's client has no wheel for this Python")
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    address = f"127.0.7.{110 + worker}"
    command = [sys.executable, SERVERS / program, "--robot", MAKES[request.param][0], "--address", address, "--"]
    command.append(",".join(map(str, at)))
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        made = Cell(request.param, process, address)
        try:
            made.wait("ready")
            yield made
        finally:
            process.kill()
            made.listener.join(30.0)


UNSURE = "whether the payload was written is not known .*: see on the robot's pendant or in Desk which one it counts"


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (
            "refuse",
            "the robot refused the (payload|load): .*; see .* what stops it, and which (payload|load) it counts",
        ),
        (
            "forget",
            "the controller was told 1.200 kg and counts 0.000 kg: see on its pendant or in Desk what it counts",
        ),
        ("die", UNSURE),
    ],
)
def test_a_payload_that_was_sent_and_may_not_count_is_told_so_and_sent_once(cell, fault, said):
    with pytest.raises(SentError, match=f"{said}|{UNSURE}") as error:  # on a busy machine a client may take too long
        cell.write(fault)
    assert "\n" not in str(error.value)
    assert len(cell.said("payload")) == 1


def test_a_payload_that_counts_is_read_back_and_sent_once(cell):
    assert cell.write("")[0] == pytest.approx(1.2)
    assert len(cell.said("payload")) == 1


def test_a_robot_that_went_away_before_is_told_nothing(cell):
    with open_mover(cell.spec, cell.robot) as mover:
        next(iter(mover))
        cell.process.kill()
        with pytest.raises(SinkError, match=f"was lost|cannot be reached|so no load is written|{UNSURE}"):
            mover.write(cell.load)
    assert not cell.said("payload")


@pytest.mark.parametrize("cell", ["ur"], indirect=True)
def test_what_must_not_be_written_does_not_end_the_program_of_a_ur(cell, tmp_path):
    heavy = Load(InertialParameters(20.0 * cell.load.parameters.phi, "tool0"))
    with open_mover(cell.spec, cell.robot) as mover:
        samples = iter(mover)
        next(samples)
        with pytest.raises(SinkError, match=r"rated for 12\.5 kg") as error:
            mover.write(heavy)
        assert not isinstance(error.value, SentError)
        sine = 0.3 * np.array([[1.0, 0.3, -1.6 / 3]] * 6)
        save_motion(tmp_path / "work.json", FourierMotion(np.array(UR), sine, 0.0 * sine, 30.0, "work").smooth())
        cell.order(f"work {tmp_path / 'work.json'}")
        for sample in samples:
            if np.abs(sample.dq).max() > 0.05:
                break
        with pytest.raises(SinkError, match="the robot moves: a load is written at standstill only"):
            mover.write(cell.load)
    assert not cell.said("script")
    assert not cell.said("payload")


@pytest.mark.parametrize("cell", ["ur"], indirect=True)
def test_a_ur_without_remote_control_says_so_and_is_told_nothing(cell):
    with pytest.raises(SinkError, match="set it to remote control") as error:
        cell.write("local")
    assert not isinstance(error.value, SentError)
    assert not cell.said("payload")
