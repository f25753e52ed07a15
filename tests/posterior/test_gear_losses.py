"""Gears lose a share of the torque they transmit, the payload's too: found, and not taken for payload."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import FRICTION_WIDTH, arm, rated_effort
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.posterior import SmoothPosteriorLeastSquares, learn_profile
from armload.regression import Correction, FilteredRegression
from armload.regression.lag import GAIN
from armload.regression.mismatch import LINK_LOSS
from armload.simulation import Friction, World, simulate

LOSSES = np.array([0.04, 0.06, 0.08, 0.10, 0.07, 0.05])
BOX = InertialParameters.from_com(6.0, [0.02, -0.03, 0.12], np.diag([0.04, 0.05, 0.03]))


@pytest.fixture(scope="module")
def logs():
    """A UR10e as described but for friction, with 6 kg and, on another motion, without."""
    robot = arm("ur10e")
    friction = Friction(0.03 * rated_effort(robot), np.full(6, 0.06), load=LOSSES)
    world = replace(World.nominal(robot), friction=friction)
    run, before = (
        simulate(robot, random_motion(robot, k), b, world=world, rate=200.0) for k, b in ((1, BOX), (2, None))
    )
    return robot, run, before


def losses(found):
    n = found.arm.n
    return found.posterior.eta[4 * n : 5 * n]


def test_what_gears_lose_is_found(logs):
    """The shoulder and the elbow transmit gravity; the wrist's torque is mostly friction, which hides its losses."""
    robot, run, before = logs
    found = SmoothPosteriorLeastSquares(robot, before)
    found.run(run)
    np.testing.assert_allclose(losses(found)[1:3], LOSSES[1:3], atol=0.015)


def test_the_payloads_share_of_it_is_not_taken_for_payload(logs):
    """A tare without the payload shows what gears lose of the arm's torque; of the payload's it follows."""
    robot, run, before = logs
    method = SmoothPosteriorLeastSquares(robot, before)
    answers = [method.run(run.between(start, start + 1.0)) for start in (0.5, 1.5, 2.5, 3.5, 4.5)]
    errors = np.array([a.phi[0] - BOX.mass for a in answers])
    assert np.mean(np.abs(errors)) < 0.05 * BOX.mass  # 9 % without the unknown
    assert all(abs(e) < 1.96 * a.std[0] for e, a in zip(errors, answers, strict=True))


def test_sensors_behind_the_gears_see_nothing_of_it():
    robot = arm("panda")
    n = robot.n
    assert Correction(robot, rated_effort(robot)).own == 4 * n
    motor = replace(robot, motor_torque=True)
    assert Correction(motor, rated_effort(motor)).own == 5 * n


SHARES = np.array([0.012, 0.008, 0.01, 0.015, 0.01, 0.01, 0.01])


@pytest.fixture(scope="module")
def rubbing():
    """A Panda as described but for friction, with 2.5 kg and, on another motion, without."""
    robot = arm("panda")
    friction = Friction(np.full(7, 0.25), np.full(7, 0.06), load=SHARES)
    world = replace(World.nominal(robot), friction=friction)
    body = InertialParameters.from_com(2.5, [0.02, -0.03, 0.12], np.diag([0.02, 0.02, 0.01]))
    run, before = (
        simulate(robot, random_motion(robot, k), b, world=world, rate=200.0) for k, b in ((1, body), (2, None))
    )
    return replace(robot, gear_loss=LINK_LOSS), run, before


def test_what_joints_rub_away_under_load_is_found_behind_the_gears_where_it_is_asked(rubbing):
    robot, run, before = rubbing
    found = SmoothPosteriorLeastSquares(robot, before)
    found.run(run)
    bears = [1, 3]  # the joints that hold the arm up
    np.testing.assert_allclose(losses(found)[bears], SHARES[bears], atol=0.003)


def test_rows_hold_it_as_the_correction_describes_it(rubbing):
    """Of a log that stands still in its torque, the lag has passed: the row is |tau|·tanh(dq/w)."""
    robot, _, _ = rubbing
    correction = Correction(robot, rated_effort(robot))
    t = np.arange(0.0, 2.0, 0.005)
    q, dq, tau = np.zeros((400, 7)), np.full((400, 7), 0.05), np.tile(np.arange(1.0, 8.0), (400, 1))
    X = FilteredRegression(robot, GAIN, correction).rows(t, q, dq, tau).X[-1]
    at = 10 + np.arange(7) + correction.load.start
    np.testing.assert_allclose(X[np.arange(7), at], np.arange(1.0, 8.0) * np.tanh(0.05 / FRICTION_WIDTH), rtol=1e-6)


def test_a_profile_says_the_same_of_joints_that_hardly_rub(rubbing):
    """It was learned without that unknown, which is then known to be next to nothing."""
    robot, run, before = rubbing
    plain = replace(robot, gear_loss=0.0)
    profile = learn_profile(plain, [before])
    answers = [
        SmoothPosteriorLeastSquares(replace(robot, gear_loss=loss), profile=profile).run(run) for loss in (0.0, 1e-7)
    ]
    np.testing.assert_allclose(answers[1].phi, answers[0].phi, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(answers[1].covariance, answers[0].covariance, rtol=1e-4, atol=1e-12)
