"""What designed motions maximise: it is the bound, and its gradient is exact."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from armload.arms import arm, payload_regressor
from armload.excitation import Constraints, Criterion, PayloadRange
from armload.excitation.optimisation import about_a_pose
from armload.motion import SplineMotion, random_motion
from armload.motion.spline import spline_basis
from armload.posterior import bound

POSES = {"panda": [0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8], "ur10e": [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]}


def splines(robot, count, seed=0, lasting=(1.0, 1.4)):
    rng = np.random.default_rng(seed)
    return [SplineMotion(np.array(POSES[robot.name]), 0.4 * rng.normal(size=(robot.n, 5)), t) for t in lasting[:count]]


def rows_of(criterion, motions, rate=200.0):
    out = []
    for motion in motions:
        t = np.linspace(0.0, motion.duration, round(motion.duration * rate) + 1)
        out.append(criterion.model.forward(motion(t)[0], motion.velocity(t), t[1]))
    return out


@pytest.mark.parametrize("name", ["panda", "ur10e"])
@pytest.mark.parametrize("tare", ["same", "own", None, "another"])
def test_what_is_maximised_is_the_bound(name, tare):
    robot = arm(name)
    motions = splines(robot, 2 if tare == "own" else 1)
    another = random_motion(robot, 3, duration=2.0)
    told = Criterion(robot, another if tare == "another" else tare)
    found = told(rows_of(told, motions))
    before = {"same": motions[0], "own": motions[-1], None: None, "another": another}[tare]
    expected = bound(robot, motions[0], tare=before, times=(motions[0].duration,))
    # 32 waves of the pose in place of 128 are all that differs
    np.testing.assert_allclose(found.half_width, expected.half_width[-1], rtol=0.05)
    if tare == "same":
        np.testing.assert_allclose(found.half_width, expected.half_width[-1], rtol=1e-5)


@pytest.mark.parametrize(("name", "tare"), [("panda", "own"), ("ur10e", "same"), ("panda", None)])
def test_the_gradient_is_that_of_central_differences_penalties_included(name, tare):
    robot = arm(name)
    constraints = Constraints(robot, POSES[name], payload=PayloadRange(1.0))
    problem = about_a_pose(constraints, Criterion(robot, tare), [1.0, 1.3] if tare == "own" else [1.0])
    rng = np.random.default_rng(1)
    x, weight = 0.8 * rng.normal(size=problem.size), 50.0
    _, slope = problem.loss(x, weight)
    for along in rng.normal(size=(3, problem.size)):
        up, down = (problem.loss(x + sign * 1e-5 * along, weight)[0] for sign in (1, -1))
        assert slope @ along == pytest.approx((up - down) / 2e-5, rel=2e-4, abs=1e-3)


def test_a_spline_starts_and_ends_at_rest_and_its_basis_is_its_own_derivative():
    motion = splines(arm("panda"), 1)[0]
    ends = np.array([0.0, motion.duration])
    np.testing.assert_array_equal(motion.derivative(ends, 0), np.tile(motion.start, (2, 1)))
    np.testing.assert_allclose(motion.derivative(ends, 1), 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.derivative(ends, 2), 0.0, atol=1e-10)
    t = np.linspace(0.05, 0.95, 7)
    for order in (1, 2, 3):
        slope = (motion.derivative(t + 1e-6, order - 1) - motion.derivative(t - 1e-6, order - 1)) / 2e-6
        np.testing.assert_allclose(motion.derivative(t, order), slope, rtol=1e-5, atol=1e-5)
        basis = spline_basis(5, motion.duration, t, order)
        np.testing.assert_allclose(motion.derivative(t, order), basis @ motion.control.T, atol=1e-12)


def test_a_spline_is_that_of_another_library():
    motion = splines(arm("panda"), 1)[0]
    points = np.vstack([np.zeros((3, 7)), motion.control.T, np.zeros((3, 7))])
    knots = np.concatenate([np.zeros(5), np.linspace(0, motion.duration, len(points) - 4), np.full(5, motion.duration)])
    other = BSpline(knots, points, 5)
    t = np.linspace(0.0, motion.duration, 101)
    for order in range(6):
        found = motion.derivative(t, order) - (motion.start if order == 0 else 0.0)
        np.testing.assert_allclose(found, other(t, nu=order), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(motion.derivative(t, 6), 0.0)


def test_no_payload_of_a_range_needs_more_torque_than_its_corners():
    robot, rng = arm("panda"), np.random.default_rng(2)
    held = PayloadRange(2.5, half=(0.08, 0.03, 0.12))
    poses = np.array(POSES["panda"])
    q, dq, ddq = poses + 0.4 * rng.normal(size=(20, 7)), 1.5 * rng.normal(size=(20, 7)), 10 * rng.normal(size=(20, 7))
    Y = payload_regressor(robot.frame_motion(q), dq, ddq)
    corners = np.abs(robot.torque(q, dq, ddq)[:, :, None] + Y @ held.corners().T)
    for _ in range(60):
        one = held.payload(rng.random(), rng.uniform(-1, 1, 3))
        assert np.all(np.abs(robot.with_payload(one).torque(q, dq, ddq)) <= corners.max(axis=2) + 1e-9)
