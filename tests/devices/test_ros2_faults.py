"""`armload measure` on a ROS 2 arm in fault: what stops, how it is said, and that the arm rests on its path."""

import contextlib
import json
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import arm
from armload.motion import FourierMotion, save_motion
from armload.recording import read_recording

pytestmark = pytest.mark.full
ROBOT = Path(__file__).resolve().parent / "servers" / "ros_robot.py"
POSE = np.array([0.0, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5])
NEAR = 0.04  # [rad] that each joint stands away from where the motion begins


class Cell:
    """A robot, and `armload measure` beside it."""

    def __init__(self, ros, robot, motion, wait, folder):
        self.ros, self.robot, self.motion, self.wait, self.folder = ros, robot, motion, wait, folder

    def order(self, line):
        self.robot.stdin.write(line + "\n")
        self.robot.stdin.flush()
        word = line.split()[0]
        self.wait(lambda: self.said(word), 20, self.robot)

    def said(self, event):
        return [each for each in map(json.loads, self.robot.printed_lines()) if each["event"] == event]

    @contextlib.contextmanager
    def measure(self, *more, motion=True):
        logs = self.folder / "logs"
        how = ("--motion", self.folder / "small.json") if motion else ()
        command = ("measure", "ros2:///joint_states", "--robot", "panda", "--method", "map", "--dir", logs, *how)
        with self.ros("-m", "armload", *command, "--grip", "true", *more) as run:
            yield run

    def on_its_way(self, run):
        """Until the arm is in the middle of its empty run."""
        self.wait(lambda: run.poll() is not None or len(self.said("moving")) == 2, 120, self.robot, run)
        time.sleep(1.5)

    def off_its_path_at_rest(self):
        """How far from the path of its motion the arm has come to rest [rad]."""
        self.wait(lambda: len(self.said("rest")) == 2, 20, self.robot)
        path = self.motion.position(np.linspace(0.0, self.motion.duration, 5001))
        return np.abs(path - self.said("rest")[-1]["q"]).max(axis=1).min()

    def ended(self, run):
        """Its exit code and the last line that it said, once it has ended."""
        self.wait(lambda: run.poll() is not None, 90, self.robot, run)
        assert "Traceback" not in run.noted()
        return run.returncode, (run.noted().splitlines() or [""])[-1]


@pytest.fixture
def cell(ros, wait_until, tmp_path):
    sine = 0.12 * np.array([[1.0, 0.3, -1.6 / 3]] * 7) * np.linspace(0.5, 1.0, 7)[:, None]
    cosine = 0.1 * np.array([[1.0, -1.0, 1.0 / 3]] * 7) * np.linspace(1.0, 0.6, 7)[:, None]
    motion = FourierMotion(POSE, sine, cosine, 5.0, "small").smooth()
    save_motion(tmp_path / "small.json", motion)
    at = ",".join(f"{x:.6f}" for x in motion.position([0.0])[0] + NEAR)
    with ros(ROBOT, "--robot", "panda", "--", at, orders=True) as robot:
        made = Cell(ros, robot, motion, wait_until, tmp_path)
        wait_until(lambda: made.said("ready"), 90, robot)
        yield made


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        (
            ["silent"],
            "no joint states on /joint_states for 5 s: .*; the arm was on its way, and its controller lets it",
        ),
        (["silent", "well"], r"no sample came for \d\.\d\d s"),
        (["jump 0.5"], r"the clock of its samples jumped by \+0\.\d\d s \(see what sets it\)"),
        (["jump -30"], r"the clock of its samples jumped by -\d\d\.\d\d s \(see what sets it\)"),
        (["deaf"], r"rad off the path \(more than 0\.05 rad; see that the controller of /joint_traj.* refuses what"),
        (["nan"], r"no usable sample for 0\.\d\d s"),
        (["short"], "had only the joints .* for 5 s, without panda_joint7: .*; the arm was on its way"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_an_arm_in_fault_on_its_way_rests_on_its_path_and_the_fault_is_named(cell, faults, said):
    with cell.measure("--move") as run:
        cell.on_its_way(run)
        for fault in faults:
            cell.order(fault)
            time.sleep(0.8)
        code, line = cell.ended(run)
    assert code == 2
    assert re.search(f"{said}.*; what was recorded until then is in .*empty.csv$", line), line
    assert cell.off_its_path_at_rest() < 0.01  # [rad]
    assert len(cell.said("moving")) == 2  # and nothing moves it again
    assert np.abs(read_recording(cell.folder / "logs" / "empty.csv", arm("panda")).dq).max() > 0.1


@pytest.mark.parametrize("seconds", [0.8, 2.0])
def test_an_arm_whose_measurement_did_not_run_for_a_while_rests_on_its_path_and_is_told_nothing_wild(cell, seconds):
    with cell.measure("--move") as run:
        cell.on_its_way(run)
        run.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        run.send_signal(signal.SIGCONT)
        code, line = cell.ended(run)
    assert code == 2
    assert re.search(r"no (trajectory could be sent|sample came) for \d\.\d\d s", line), line
    assert cell.off_its_path_at_rest() < 0.01  # [rad]
    refused = [each for each in cell.robot.noted().splitlines() if "refused" in each]
    # what asks for a jump is refused, here: another controller would jump; what comes too late is no such thing
    assert all("before it could begin" in each for each in refused), refused


def test_a_controller_that_takes_no_way_to_the_start_is_named_before_the_next_movement(cell):
    cell.order("deaf")
    with cell.measure("--move") as run:
        code, line = cell.ended(run)
    assert code == 2
    assert "was stopped on its way to the start: panda_joint" in line
    assert "/joint_trajectory_controller/joint_trajectory is active, and whether it refuses what it is sent" in line
    assert "without the payload" not in line
    assert not cell.said("moving")


@pytest.mark.parametrize(("named", "said"), [(True, "does not say how fast"), (False, "no position of every joint")])
def test_an_arm_that_does_not_say_where_it_is_is_not_moved(cell, named, said):
    cell.order("nan")
    with cell.measure("--move", motion=named) as run:
        code, line = cell.ended(run)
    assert (code, said in line) == (2, True), line
    assert not cell.said("moving")


def test_a_motion_can_be_designed_about_the_pose_of_a_ros_arm(cell):
    with cell.measure("--dry-run", "--time", "1", motion=False) as run:
        code, line = cell.ended(run)
        assert code == 0, line
        assert "with the payload: designed, 1.0 s" in "\n".join(run.printed_lines())
    assert not cell.said("moving")
