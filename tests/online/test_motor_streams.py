"""Streams of arms whose torque is motor current, with a tare: what starts from rest or stops, and what is light."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import savgol_filter

from armload import OnlineIdentifier, Recording, arm, read_recording
from armload.arms import payload_regressor, rated_effort
from armload.inertia import com_to_phi
from armload.motion import JoinedMotion, StraightMotion, random_motion
from armload.recording import Sample
from armload.simulation import Sensors, World, simulate

RATE = 200.0


def _simulated(robot, motion, world, seed):
    """The log of an empty arm along a motion, and its tare of 20 s along another."""
    more = {"world": world, "sensors": Sensors.of(robot), "rate": RATE}
    tare = simulate(robot, random_motion(robot, seed + 50_000, duration=20.0), seed=seed + 1, **more)
    return simulate(robot, motion, seed=seed, **more), tare


def _starting(name: str, seed: int):
    """Four seconds of an arm that starts from rest."""
    robot = arm(name)
    return robot, *_simulated(robot, random_motion(robot, seed, duration=4.0), World.real_like(robot, seed), seed)


def _told(robot, log, tare):
    """Every estimate of a stream."""
    identifier = OnlineIdentifier(robot, tare)
    estimates = [identifier.update(*sample) for sample in log]
    identifier.close()
    return estimates


@pytest.mark.parametrize(("name", "seed"), [("ur5e", 54007), ("xarm7", 54000), ("xarm7", 54007)])
@pytest.mark.full  # some seconds
def test_an_empty_arm_that_starts_from_rest_is_no_change_of_payload(name, seed):
    estimates = _told(*_starting(name, seed))
    assert estimates[-1].event is None
    assert sum(one.interval == "calibrated" for one in estimates) > 0.5 * len(estimates)


def _stopping(name: str, seed: int):
    """An empty arm that stops four times, whose joints then keep the friction that they had: the gears hold."""
    robot = arm(name)
    world, rng = replace(World.real_like(robot, seed), stiction=None), np.random.default_rng(seed)
    poses = random_motion(robot, seed, duration=20.0).position(np.sort(rng.uniform(0.0, 20.0, 5)))
    parts = []
    for start, stop in pairwise(poses):
        lasting = max(1.5, 2.2 * float(np.abs(stop - start).max()))
        parts += [StraightMotion(start, stop, lasting), StraightMotion(stop, stop, 2.5)]
    motion = JoinedMotion(parts)
    log, tare = _simulated(robot, motion, world, seed)
    friction, sign, kept = world.friction, np.zeros(robot.n), np.zeros_like(log.tau)
    for k, dq in enumerate(motion.velocity(log.t)):
        sign = np.where(np.abs(dq) > 1e-3, np.sign(dq), sign)
        kept[k] = sign * friction.level * (1.0 - np.abs(np.tanh(dq / friction.width)))
    return robot, Recording(log.t, log.q, log.dq, log.tau + kept), tare


@pytest.mark.parametrize(("name", "seed"), [pytest.param("ur10e", 57004, marks=pytest.mark.full), ("ur5e", 57000)])
@pytest.mark.full  # some seconds
def test_joints_that_keep_their_friction_at_a_stop_are_no_change_of_payload(name, seed):
    estimates = _told(*_stopping(name, seed))
    assert {one.event for one in estimates} == {None}


@pytest.fixture(scope="module")
def real_pair(real_data):
    """The real UR10e: its arm, its log with 2.805 kg, and the empty one, which is the tare."""
    robot = arm(real_data / "ur10e.urdf", "tool0")
    loaded, empty = (read_recording(real_data / f"ur10e_{name}.csv", robot) for name in ("loaded_2805g", "unloaded"))
    return robot, loaded, empty


@pytest.mark.full
@pytest.mark.parametrize("taken", [10.0, 25.0, 40.0])
def test_half_a_kilogram_more_on_a_real_arm_is_never_denied(real_pair, taken):
    """4 % of what it may carry: it may be noticed late, but the interval holds what the arm holds all the time."""
    robot, loaded, empty = real_pair
    log = loaded.between(taken - 10.0, taken + 5.0)
    more = com_to_phi(0.5, np.array([0.0, 0.0, 0.08]), 1e-3 * np.eye(3))
    ddq = savgol_filter(np.gradient(log.dq, log.t, axis=0), 11, 2, axis=0)
    added = payload_regressor(robot.frame_motion(log.q), log.dq, ddq) @ more
    log = Recording(log.t, log.q, log.dq, log.tau + added * (log.t > taken)[:, None])
    estimates = _told(robot, log, empty)
    for after in (0.5, 1.0, 2.0, 4.9):
        one = estimates[np.searchsorted(log.t, taken + after) - 1]
        assert one.low[0] <= 2.805 + 0.5 <= one.high[0]


def test_an_arm_that_moves_is_not_too_slow_while_its_rows_are_left_out():
    """What is doubted, or follows a change, is taken by no run, and counts as motion all the same."""
    robot = arm("ur5e")
    t = np.arange(0.0, 6.0, 0.01)
    moved = np.where(t < 4.0, t, np.maximum(t - 1.0, 4.0))[:, None]  # it stands from 4 to 5 s
    speed = ((t < 4.0) | (t > 5.0))[:, None] * 2.0 * np.pi * np.array([0.5, 1.0, 0.5, 1.0, 1.5, 1.0])
    angle = 2.0 * np.pi * np.array([0.5, 1.0, 0.5, 1.0, 1.5, 1.0]) * moved
    q, dq = np.array([0.0, -1.4, 1.6, -1.6, -1.5, 0.0]) - 0.2 * np.cos(angle), 0.2 * speed * np.sin(angle)
    tau = robot.torque(q, dq, 0.2 * speed**2 * np.cos(angle)) + 0.05 * rated_effort(robot) * np.tanh(dq / 0.03)
    identifier = OnlineIdentifier(robot)
    for k in np.flatnonzero(t < 4.9):
        identifier.update(t[k], q[k], dq[k], tau[k])
    weighing, run = identifier._watch._weighing, identifier.engine
    assert weighing.blind
    for k in np.flatnonzero(t >= 4.9):
        weighing.passed_over(Sample(t[k], q[k], dq[k], tau[k]), run, run.stream.state)
    assert not weighing.blind
    identifier.close()
