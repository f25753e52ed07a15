"""Each joint's torque may have a scale of its own, where it is motor current: the intervals allow for it."""

import numpy as np
import pytest

from armload import arm, identify
from armload.arms import rated_effort
from armload.inertia import InertialParameters
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import random_motion
from armload.posterior import HybridIdentifier, SmoothPosteriorLeastSquares
from armload.posterior.evidence import TRAITS, Evidence
from armload.posterior.joint_gains import moved_by_joint, spread
from armload.posterior.problem import Problem
from armload.regression import Correction, JointFeatures, solution_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.simulation import World, simulate

BOX = InertialParameters.from_com(8.0, [0.05, -0.04, 0.15], np.diag([0.05, 0.06, 0.04]))


@pytest.fixture(scope="module")
def robot():
    return arm("ur10e")


@pytest.fixture(scope="module")
def logs(robot):
    """A UR10e that differs from its model, with a payload and, on another motion, without."""
    world = World.real_like(robot, 5)
    return [simulate(robot, random_motion(robot, k), b, world=world, rate=100.0) for k, b in ((1, BOX), (2, None))]


@pytest.fixture(scope="module")
def runs(robot, logs):
    """What tare and run say, with a few features."""
    correction, features = Correction(robot, rated_effort(robot)), JointFeatures(robot.n, 8, 4)
    out = []
    for log in reversed(logs):
        data = RegressionData(correction, GAIN, features, SMOOTH.block)
        data.add(log.t, log.q, log.dq, log.tau)
        out.append(data)
    return out


@pytest.mark.parametrize("joint", range(6))
def test_phi_moves_with_a_joint_s_scale_as_said(robot, runs, joint):
    """The torque that a payload asks of one joint is 1 % larger, everything else the same: solved anew."""
    tare, run = runs
    problem = Problem(runs, solution_prior_std(robot), None, SMOOTH)
    scales = problem.scales(None)
    found = problem.posterior(scales)
    phi = found.mean[problem.last]
    moved = moved_by_joint(
        run, problem.selections[-1], scales.noise[-1], found.covariance[problem.last], found.slope, 0.01
    )
    louder = RegressionData.joined([run])
    louder.b = run.b.copy()
    louder.b[joint] += 0.01 * run.A[joint, :, :10] @ phi
    again = Problem([tare, louder], solution_prior_std(robot), None, SMOOTH).posterior(scales).mean[problem.last]
    np.testing.assert_allclose(moved[joint] @ phi, again - phi, atol=1e-9)
    assert np.abs(again - phi).max() > 1e-5


def test_one_scale_of_all_joints_scales_phi(robot, runs):
    """Where the log determines phi, what the joints' scales do adds up to phi itself."""
    problem = Problem(runs, solution_prior_std(robot), None, SMOOTH)
    scales = problem.scales(None)
    found = problem.posterior(scales)
    phi = found.mean[problem.last]
    moved = moved_by_joint(
        runs[1], problem.selections[-1], scales.noise[-1], found.covariance[problem.last], found.slope, 1.0
    )
    np.testing.assert_allclose((moved.sum(axis=0) @ phi)[:4], phi[:4], rtol=1e-2)


def test_the_covariance_grows_by_what_independent_scales_do(robot, logs):
    """Against drawn scales: the covariance of phi over ten thousand draws of six independent ones."""
    found = SmoothPosteriorLeastSquares(robot, logs[1])
    phi = found.run(logs[0]).phi
    moved = found.posterior.moved
    scales = np.random.default_rng(0).normal(size=(10_000, robot.n))
    drawn = np.einsum("kj,jab,b->ka", scales, moved, phi)
    np.testing.assert_allclose(np.diag(spread(moved, phi)), drawn.var(axis=0), rtol=0.1)


@pytest.mark.full  # a quarter of a minute
def test_first_moments_of_what_is_heavy_lie_inside(robot):
    """Arms whose gears lose of the payload and whose joints have scales of their own; 0.81 of 75 without the spread."""
    drawn = draw_episodes(robot, "same-motion", 48, 300, motions=12)
    heavy = [e for e in drawn if e.payload is not None and e.payload.parameters.mass > 6.0]
    inside = []
    for log in simulate_episodes(heavy):
        answer, phi = identify(log.run, robot, tare=log.tare), log.truth.phi
        inside.append((answer.phi_low <= phi) & (phi <= answer.phi_high))
    assert np.mean(inside, axis=0)[1:4].mean() > 0.9


def test_sensors_behind_the_gears_have_one_scale():
    panda = arm("panda")
    found = HybridIdentifier(panda)
    found.run(simulate(panda, random_motion(panda, 1), rate=100.0))
    assert found.posterior.moved is None
    assert found.evidence().moved is None
    assert not spread(None, np.ones(10)).any()


def test_a_scale_of_what_the_prior_tells_widens_nothing():
    """What the log does not tell does not rest on its torque: P·Λ of the move, 0 where the prior is all."""
    information = np.diag(np.r_[1e8, np.zeros(9)])
    moved = 0.03 * np.eye(10)[None]
    evidence = Evidence(information, np.zeros(10), 0.0, np.zeros(len(TRAITS)), 1.0, 0, moved)
    P = np.linalg.inv(information + np.eye(10))
    widened = np.diag(evidence.of_joints(np.ones(10), P))
    np.testing.assert_allclose(widened, 0.03**2 * np.r_[1.0, np.zeros(9)], rtol=1e-6, atol=1e-12)


def test_a_stream_allows_for_it_as_its_log_does(robot, logs):
    found = HybridIdentifier(robot, logs[1])
    for sample in logs[0]:
        found.update(sample)
    live, std = found.stream.posterior.moved, found.last.std
    found.close()
    assert live is not None
    assert np.abs(live).max() > 0.0
    concluded = found.run(logs[0])
    assert std[0] == pytest.approx(concluded.std[0], rel=0.25)
