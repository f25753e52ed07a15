"""The torque-controlled arm: its loop against Pinocchio and closed forms, and what its sensors show of a push."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from armload.arms import ForwardDynamics, arm
from armload.errors import ArmError, MotionError
from armload.inertia import InertialParameters
from armload.motion import FourierMotion, random_motion
from armload.regression import FilteredRegression
from armload.simulation import Drift, GravityCompensation, JointImpedance, World, moderate_stiffness, torque_controlled

PAYLOAD = InertialParameters.from_com(2.0, (0.02, -0.03, 0.08), np.diag([8e-3, 9e-3, 6e-3]))


def held_pose(arm) -> FourierMotion:
    pose = [0.1, -0.4, 0.2, -1.9, 0.1, 1.7, 0.3] if arm.n == 7 else [0.0, -1.2, 1.5, -1.0, -1.5, 0.0]
    return FourierMotion(np.array(pose), np.zeros((arm.n, 2)), np.zeros((arm.n, 2)), period=1.0)


def rms(x) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


# ---------------------------------------------------------------- the loop


def test_with_the_exact_model_nothing_is_left_of_the_tracking_error(some_arm):
    motion = random_motion(some_arm, 3)
    law = JointImpedance(some_arm.with_payload(PAYLOAD), motion)
    log = torque_controlled(some_arm, law, motion.position([0.0])[0], 3.0, PAYLOAD, settle=0.2).recording
    assert np.ptp(log.q, axis=0).min() > 0.05  # every joint moved
    np.testing.assert_allclose(log.q, motion.position(log.t), rtol=0, atol=1e-13)


def test_the_arm_accelerates_as_computed_torque_commands(panda):
    motion, actual = random_motion(panda, 1, duration=3.0), panda.with_payload(PAYLOAD)
    law, start = JointImpedance(actual, motion), motion.position([0.0])[0] + 0.02
    run = torque_controlled(panda, law, start, 1.0, PAYLOAD)
    log, stiffness = run.recording, moderate_stiffness(panda)
    v = np.diff(log.q, axis=0, prepend=log.q[:1]) * 1000.0
    assert np.abs(log.q[0] - motion.position([0.0])[0]).max() > 0.01  # there is an error to be controlled away
    for k in range(0, 1000, 97):
        q_d, dq_d, ddq_d = law.reference(log.t[k])
        feedback = stiffness * (q_d - log.q[k]) + law.damping(log.q[k]) @ (dq_d - v[k])
        expected = ddq_d + np.linalg.solve(actual.mass_matrix(log.q[k]), feedback)
        np.testing.assert_allclose(run.acceleration[k], expected, rtol=1e-6, atol=1e-6)


def test_an_undeclared_payload_accelerates_the_arm_as_pinocchio_says(panda):
    motion = random_motion(panda, 2, duration=3.0)
    run = torque_controlled(panda, JointImpedance(panda, motion), motion.position([0.0])[0], 1.0, PAYLOAD)
    log = run.recording
    v = np.diff(log.q, axis=0, prepend=log.q[:1]) * 1000.0
    forward = ForwardDynamics(panda)
    for k in range(0, 1000, 97):
        expected = forward(log.q[k], v[k], run.command[k], PAYLOAD.phi)
        np.testing.assert_allclose(run.acceleration[k], expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", ["panda", "ur10e"])  # of seven joints, and of six
def test_an_undeclared_payload_bends_the_joints_by_its_torque_over_the_stiffness(name):
    held = arm(name)
    hold = held_pose(held)
    log = torque_controlled(held, JointImpedance(held, hold), hold.offset, 0.1, PAYLOAD, settle=6.0).recording
    load = held.with_payload(PAYLOAD).torque(log.q[-1]) - held.torque(log.q[-1])
    sag = load / moderate_stiffness(held)
    assert np.abs(sag).max() > 3e-3
    np.testing.assert_allclose(hold.offset - log.q[-1], sag, atol=1e-6)


def test_the_command_stays_within_the_joints_efforts(panda):
    hold = held_pose(panda)
    run = torque_controlled(panda, JointImpedance(panda, hold), hold.offset + 0.4, 0.2)
    effort = panda.limits.effort
    assert np.all(np.abs(run.command) <= effort)
    assert np.any(np.abs(run.command) == effort)


def test_the_damping_is_critical_in_every_mode(any_arm):
    """With M·ë + D·ė + K·e = 0, each mode of (M, K) has a double real root −sqrt(lambda)."""
    q, stiffness = held_pose(any_arm).offset, moderate_stiffness(any_arm)
    M, D = any_arm.mass_matrix(q), JointImpedance(any_arm, held_pose(any_arm)).damping(q)
    values, modes = eigh(np.diag(stiffness), M)
    np.testing.assert_allclose(modes.T @ D @ modes, np.diag(2.0 * np.sqrt(values)), atol=1e-8 * values.max())


# ---------------------------------------------------------------- what the sensors show


def test_the_sensors_show_inverse_dynamics_and_the_world_s_own_torque(panda):
    world = replace(World.real_like(panda, 4), gain=np.linspace(0.98, 1.02, 7), drift=Drift(np.full(7, 0.2), 3.0))
    motion = random_motion(panda, 5)
    law = JointImpedance(panda.with_payload(PAYLOAD), motion)
    run = torque_controlled(panda, law, motion.position([0.0])[0], 6.0, PAYLOAD, world=world, settle=1.0)
    log = run.recording
    rigid = world.arm(panda).with_payload(PAYLOAD).torque(log.q, log.dq, CubicSpline(log.t, log.dq)(log.t, 1))
    expected = world.measured(rigid + world.disturbance(log.q, log.dq, rigid), log.t)
    inner = slice(5, -5)  # off the spline's ends
    assert np.abs((log.tau - expected)[inner]).max() < 2e-3
    assert rms(log.tau - run.command) < 0.02  # the joints' torque loop follows the command
    assert rms(log.tau - rigid) > 0.2


def test_a_push_shows_in_the_sensors_with_the_opposite_sign(panda):
    hold, push = held_pose(panda), np.array([3.0, -4.0, 2.0, 3.0, -1.0, 0.8, 0.3])
    law = JointImpedance(panda, hold)
    log = torque_controlled(panda, law, hold.offset, 0.5, external=lambda *_: push, settle=6.0).recording
    np.testing.assert_allclose(log.q[-1] - hold.offset, push / moderate_stiffness(panda), atol=1e-6)
    residual = -FilteredRegression(panda)(log.t, log.q, log.dq, log.tau)[0]  # in the observer's sign
    np.testing.assert_allclose(residual[-1], push * (1 - np.exp(-20.0 * log.duration)), atol=1e-3)


def test_the_observer_s_residual_is_nothing_with_the_payload_declared_and_its_torque_without(panda):
    motion = random_motion(panda, 6)
    law = JointImpedance(panda.with_payload(PAYLOAD), motion)
    log = torque_controlled(panda, law, motion.position([0.0])[0], 6.0, PAYLOAD).recording

    def residual(model):
        return -FilteredRegression(model)(log.t, log.q, log.dq, log.tau)[0]

    assert rms(residual(panda.with_payload(PAYLOAD))) < 1e-3
    _, W = FilteredRegression(panda)(log.t, log.q, log.dq, log.tau)
    np.testing.assert_allclose(residual(panda), -W @ PAYLOAD.phi, atol=5e-3)
    assert rms(W @ PAYLOAD.phi) > 1.0


# ---------------------------------------------------------------- guided by hand


@pytest.mark.parametrize("declared", [0.0, 0.5, 1.0], ids=["nothing", "half", "all"])
def test_in_gravity_compensation_the_sensors_show_what_was_declared_whatever_is_held(panda, declared):
    """The hand takes the difference: at rest the torque is the declared model's gravity."""
    hold, model = held_pose(panda), panda.with_payload(InertialParameters(declared * PAYLOAD.phi))
    missing = panda.with_payload(PAYLOAD).torque(hold.offset) - model.torque(hold.offset)
    law = GravityCompensation(model)
    log = torque_controlled(panda, law, hold.offset, 0.5, PAYLOAD, external=lambda *_: missing).recording
    np.testing.assert_allclose(log.tau, np.tile(model.torque(hold.offset), (500, 1)), atol=1e-9)


def test_an_undeclared_payload_sinks_once_the_hand_is_gone(panda):
    hold = held_pose(panda)
    let_go = torque_controlled(panda, GravityCompensation(panda), hold.offset, 0.5, PAYLOAD).recording
    _, flange = panda.frame_pose(let_go.q)
    assert flange[-1, 2] < flange[0, 2] - 0.02


def test_gravity_compensation_with_the_payload_declared_keeps_the_arm_where_it_is(any_arm):
    hold = held_pose(any_arm)
    law = GravityCompensation(any_arm.with_payload(PAYLOAD))
    log = torque_controlled(any_arm, law, hold.offset, 1.0, PAYLOAD).recording
    np.testing.assert_allclose(log.q, np.tile(hold.offset, (len(log), 1)), atol=1e-9)


def test_a_taught_arm_loses_its_energy_to_the_damping_alone(panda):
    """d(½·dqᵀ·M·dq)/dt = −dqᵀ·D·dq once gravity is compensated and nobody touches."""
    hold, damping = held_pose(panda), np.linspace(2.0, 0.3, 7)
    kicked = np.array([20.0, -15.0, 10.0, 12.0, 1.0, 1.0, 0.5])
    run = torque_controlled(
        panda, GravityCompensation(panda, damping), hold.offset, 0.6, external=lambda t, *_: kicked * (t < 0.1)
    )
    log = run.recording
    energy = np.array([0.5 * v @ panda.mass_matrix(q) @ v for q, v in zip(log.q, log.dq, strict=True)])
    power = (damping * log.dq**2).sum(axis=1)
    free = slice(150, 590)
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (power[free][1:] + power[free][:-1]) * 1e-3)])
    assert lost[-1] > 0.1 * energy[free][0] > 0.01
    np.testing.assert_allclose(energy[free][0] - energy[free], lost, atol=0.01 * energy[free][0])


# ---------------------------------------------------------------- what is refused


def test_what_does_not_fit_the_arm_is_refused(panda):
    motion = random_motion(panda, 0)
    with pytest.raises(MotionError, match="moves 7 joints"):
        JointImpedance(arm("ur10e"), motion)
    with pytest.raises(ArmError, match="expected \\(7,\\)"):
        torque_controlled(panda, JointImpedance(panda, motion), np.zeros(6), 0.1)


def test_an_arm_that_runs_away_is_said_to(panda):
    with pytest.raises(ArmError, match="ran away"):
        torque_controlled(panda, lambda _, q, dq: panda.torque(q) + 1e-3 + 100.0 * dq, held_pose(panda).offset, 3.0)
