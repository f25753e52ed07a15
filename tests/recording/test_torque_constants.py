"""Torque per motor current, where only the controller's own numbers tell it."""

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import RecordingError
from armload.motion import excitation
from armload.recording import read_recording
from armload.recording.currents import no_constants
from armload.simulation import simulate

UR = arm("ur5e")  # whose sheet has no constants
CONSTANTS = np.array([10.0, 11.0, 10.5, 8.0, 8.5, 9.0])  # [N·m/A]
FRICTION = np.array([[0.9, 0.8, 0.7, 0.3, 0.3, 0.2], [0.5, 0.4, 0.5, 0.2, 0.1, 0.2]])  # [A], [A·s/rad]


@pytest.fixture(scope="module")
def log():
    return simulate(UR, excitation(UR), rate=125.0)


def table(log, wanted):
    """An RTDE log: what was measured, and the moments and currents (N, n) that the controller wanted."""
    parts = {"actual_q": log.q, "actual_qd": log.dq, "actual_current": log.tau / CONSTANTS}
    parts |= {"target_moment": wanted[0], "target_current": wanted[1]}
    names = ["timestamp", *(f"{name}_{k}" for name in parts for k in range(6))]
    return ",".join(names), np.column_stack([log.t, *parts.values()])


def read(path, log, *wanted):
    names, numbers = table(log, wanted)
    np.savetxt(path, numbers, delimiter=",", header=names, comments="", fmt="%.17g")
    return read_recording(path, UR, columns="tau=actual_current_{i}")


def wanted(log):
    """Moments of the controller's model, and the currents with the friction that it expects."""
    moment = 0.97 * log.tau
    turning = np.sign(log.dq) * (np.abs(log.dq) > 0.01)
    return moment, moment / CONSTANTS + FRICTION[0] * turning + FRICTION[1] * log.dq * (turning != 0)


def test_what_the_controller_wants_tells_the_torque_of_an_ampere(tmp_path, log):
    found = read(tmp_path / "run.csv", log, *wanted(log))
    np.testing.assert_allclose(found.tau, log.tau, rtol=1e-6, atol=1e-9)
    assert any("10 11 10.5 8 8.5 9 N·m/A (the controller's own" in note for note in found.notes)


def test_a_joint_that_carries_nothing_at_rest_is_named(tmp_path, log):
    rest = log.between(0.0, 1.0)
    moment = np.tile([0.0, 20.0, 10.0, 2.0, 1.0, 0.5], (len(rest), 1))
    still = type(rest)(rest.t, np.zeros_like(rest.q), np.zeros_like(rest.dq), moment, joint_names=rest.joint_names)
    with pytest.raises(
        RecordingError, match=r"joint\(s\) 1 does not .* log while every joint moves, or give .* which a note"
    ):
        read(tmp_path / "rest.csv", still, moment, moment / CONSTANTS)


def test_currents_that_do_not_go_with_the_moments_are_refused(tmp_path, log):
    moment, current = wanted(log)
    current[:, 2] += 0.2 * np.abs(current[:, 2]).max() * np.sin(7.0 * log.t)
    with pytest.raises(RecordingError, match=r"joint\(s\) 3 does not follow"):
        read(tmp_path / "other.csv", log, moment, current)


def test_without_them_the_sentence_says_what_to_log(tmp_path, log):
    names, numbers = table(log, wanted(log))
    np.savetxt(
        tmp_path / "run.csv", numbers[:, :19], delimiter=",", header=",".join(names.split(",")[:19]), comments=""
    )
    with pytest.raises(RecordingError, match=r"known for ur5e: log target_moment and target_current as well"):
        read_recording(tmp_path / "run.csv", UR)


def test_as_many_constants_are_asked_for_as_the_arm_has_joints(panda):
    assert "give 7 numbers in N·m/A" in str(no_constants("run.csv", "these look like", panda, panda.n))
    assert '"torque_constants=K1 … K7"' in str(no_constants("run.csv", "these look like", panda, panda.n))
