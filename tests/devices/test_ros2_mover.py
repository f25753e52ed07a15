"""What a ROS 2 controller is told by a process that did not run for a while; without ROS 2."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from armload.arms import arm
from armload.devices.mover import samples_of_movement
from armload.devices.ros2.mover import Ros2Mover
from armload.devices.ros2.trajectory import read_trajectory
from armload.motion import FourierMotion
from armload.recording import Sample

POSE = np.array([0.0, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5])
SWING = 0.12 * np.array([[1.0, 0.3, -1.6 / 3]] * 7)
MOTION = FourierMotion(POSE, SWING, 0.0 * SWING, 5.0, "small").smooth()
CYCLE = 0.005  # [s] of the joint states
EPOCH = 1_000_000_000_000  # [ns]


class Cell:
    """A joint trajectory controller, its joint states, the topics between, and the clock of all of them.

    After its sample number `at` whoever listens does not run for `held_up` [s]: samples wait meanwhile, and nobody says
    so. Four samples later its clock jumps by `jump` [s]. Simulated time goes on by `pace` of ours. Whoever makes
    message or point number `making` does not run for two seconds, either.
    """

    rate = 1.0 / CYCLE
    name = "/joint_states"

    def __init__(self, robot, held_up, jump=0.0, pace=1.0, at=300, making=None):
        self.robot, self.held_up, self.jump, self.pace = robot, held_up, jump, pace
        self.number, self.pause_at, self.making, self.made = 0, at, making, 0
        self.now, self.jumped, self.paced = 0.0, 0.0, pace == 1.0
        self.orders = [(0.0, None)]  # from when, which trajectory
        self.speeds = []  # the fastest of each trajectory [rad/s]
        kinds = {"JointTrajectory": self._message, "JointTrajectoryPoint": self._message}
        self.connection = SimpleNamespace(publisher=lambda *_: self._take, listeners=lambda _: 1, **kinds)

    def _message(self):
        self.made += 1
        self.now += 2.0 * (self.made == self.making)
        stamp = SimpleNamespace(sec=0, nanosec=0)
        return SimpleNamespace(header=SimpleNamespace(stamp=stamp), time_from_start=SimpleNamespace(sec=0, nanosec=0))

    def at(self, t):
        """Position, velocity and acceleration that the arm is commanded at t."""
        since, motion = [order for order in self.orders if order[0] <= t][-1]
        if motion is None:
            return MOTION.position([0.0])[0], np.zeros(7), np.zeros(7)
        q, dq, ddq = motion([min(t - since, motion.duration)])
        return q[0], dq[0], ddq[0]

    def _take(self, message):
        now = self.now * self.pace
        motion = read_trajectory(message, self.robot, self.at(now), self.stamp(now + self.jumped))
        self.orders.append((now, motion))
        self.speeds.append(np.abs(motion.velocity(np.arange(0.0, motion.duration, 1e-3))).max())

    def ticking(self, _):
        while (k := self.number) < 4000:
            self.number, t = k + 1, k * CYCLE
            self.now = max(self.now + 1e-4, t / self.pace) + self.held_up * (k == self.pause_at)
            self.jumped = self.jump * (k > self.pause_at + 3)
            q, dq, _ = self.at(t)
            yield Sample(t + self.jumped, q, dq, self.robot.torque(q))

    def stamp(self, t):
        return EPOCH + round(1e9 * t)

    def lag(self):
        return 0.0

    def arrived(self):
        return None


@pytest.mark.parametrize("held_up", [0.0, 0.3, 0.6, 0.9, 2.0])
def test_a_controller_is_never_told_to_catch_up_with_a_path_that_it_has_left(held_up, monkeypatch):
    mover = moved(cell := Cell(arm("panda"), held_up), monkeypatch)
    assert rests_on_its_path(cell)
    if held_up < 0.5:
        assert mover.why is None
    else:
        assert "s (expected less than 0.5 s): this process did not run" in mover.why


@pytest.mark.parametrize("held_up", [0.0, 0.3])
def test_a_clock_that_jumps_back_while_samples_wait_stops_the_arm_on_its_path(held_up, monkeypatch):
    mover = moved(cell := Cell(arm("panda"), held_up, jump=-30.0), monkeypatch)
    assert rests_on_its_path(cell)
    assert "the clock of its samples jumped by -30" in mover.why


def test_an_arm_in_slow_simulated_time_goes_on_after_a_short_pause(monkeypatch):
    mover = moved(cell := Cell(arm("panda"), 0.2, pace=0.7), monkeypatch)
    assert mover.why is None
    assert rests_on_its_path(cell)


@pytest.mark.parametrize("held_up", [0.3, 0.9, 2.0])
def test_a_movement_that_begins_while_samples_wait_begins_in_the_controllers_future(held_up, monkeypatch):
    mover = moved(cell := Cell(arm("panda"), held_up, at=10), monkeypatch, seen=10)
    assert rests_on_its_path(cell)
    assert mover.why is None


@pytest.mark.parametrize("making", [300, 310, 330])
@pytest.mark.parametrize("stopped", [False, True])
def test_a_trajectory_that_was_not_ready_in_time_is_not_sent(making, stopped, monkeypatch):
    cell = Cell(arm("panda"), 0.0, making=making)
    mover = moved(cell, monkeypatch, stop_at=making if stopped else None)
    assert rests_on_its_path(cell)
    assert mover.why == "asked" if stopped else "this process did not run" in mover.why


def moved(cell, monkeypatch, seen=0, stop_at=None):
    """What moved the arm of a cell, once its movement has ended."""
    monkeypatch.setattr("armload.devices.ros2.mover.Ros2Source", lambda *_, **__: cell)
    for module in ("mover", "heard", "ros2.mover"):
        monkeypatch.setattr(f"armload.devices.{module}.time", SimpleNamespace(monotonic=lambda: cell.now))
    mover = Ros2Mover("/joint_states", cell.robot)
    mover._seen = MOTION.position([0.0])[0]
    list(itertools.islice(mover.ticking(None), seen))
    for _ in samples_of_movement(mover, MOTION):
        if stop_at is not None and cell.made > stop_at - 60:
            mover.stop("asked")
    return mover


def rests_on_its_path(cell):
    """Whether it does, and was never told to be faster than planned."""
    planned = np.abs(MOTION.velocity(np.linspace(0.0, MOTION.duration, 2001))).max()
    assert max(cell.speeds) < 1.05 * planned
    rest, speed, _ = cell.at(cell.now * cell.pace)
    path = MOTION.position(np.linspace(0.0, MOTION.duration, 5001))
    return np.abs(speed).max() < 1e-9 and np.abs(path - rest).max(axis=1).min() < 1e-3
