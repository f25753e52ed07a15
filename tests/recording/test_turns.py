"""Angles that a robot counts anew after each turn are the same poses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armload.arms import arm
from armload.motion import random_motion
from armload.recording import Recording, read_recording, recording_chunks, write_recording
from armload.simulation import Sensors, World, simulate

GEN3 = arm("gen3")
TURN = 2.0 * np.pi


@pytest.fixture(scope="module")
def log():
    """A log whose endless joints pass half a turn."""
    t = np.linspace(0.0, 8.0, 801)
    q = 0.5 * np.sin(t)[:, None] * np.ones(7)
    q[:, [0, 2]] += np.column_stack([0.5 * t, -0.6 * t])
    q[:, [1, 3, 5]] -= 0.5
    dq = np.gradient(q, t, axis=0)
    return Recording(t, q, dq, GEN3.torque(q, dq), joint_names=GEN3.joint_names)


@pytest.mark.parametrize("counted", ["from -pi to pi", "from 0 to 2 pi"])
def test_angles_counted_anew_after_a_turn_go_on(log, tmp_path, counted):
    from_zero = np.mod(log.q, TURN)
    q = from_zero if "0 to" in counted else np.where(from_zero > np.pi, from_zero - TURN, from_zero)
    assert np.abs(np.diff(q, axis=0)).max() > 6.0
    write_recording(tmp_path / "log.csv", replace(log, q=q))
    read = read_recording(tmp_path / "log.csv", GEN3)
    assert_allclose(read.q, log.q, atol=1e-9)
    assert any("full turns were added to q" in note for note in read.notes)
    parts = list(recording_chunks(tmp_path / "log.csv", GEN3, size=50))
    assert len(parts) > 5
    assert_allclose(np.vstack([part.q for part in parts]), log.q, atol=1e-9)
    assert_allclose(read_recording(tmp_path / "log.csv").q, q)  # of an arm that nobody names nothing is known


def test_a_joint_that_may_turn_twice_is_where_it_says(tmp_path):
    """A UR's joints go from -2 pi to 2 pi, and their encoders know the turn."""
    robot = arm("ur5e")
    made = simulate(
        robot, random_motion(robot, 4, duration=3.0), world=World.real_like(robot, 4), sensors=Sensors.of(robot)
    )
    away = replace(made, q=made.q + np.array([TURN, 0.0, 0.0, 0.0, -TURN, 0.0]) * (np.abs(made.q).max(axis=0) < 1.0))
    write_recording(tmp_path / "log.npz", away)
    read = read_recording(tmp_path / "log.npz", robot)
    assert_allclose(read.q, away.q)
    assert not read.notes


def test_an_encoder_that_jumps_by_less_than_a_turn_is_not_mended(log, tmp_path):
    q = log.q.copy()
    q[300:, 0] += 4.0
    write_recording(tmp_path / "log.npz", replace(log, q=q))
    assert_allclose(read_recording(tmp_path / "log.npz", GEN3).q, q)
