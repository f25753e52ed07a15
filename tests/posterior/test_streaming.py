"""The live form of the default method: every shortcut it takes, against the form that takes none."""

import json
import os
import subprocess
import sys
from copy import deepcopy

import numpy as np
import pytest

from armload.arms import Arm, arm, full_arm_regressor, momentum_regressor
from armload.arms.momentum_row import MomentumRow, wrench_row
from armload.motion import random_motion, taie2024
from armload.payloads import test_payload as make_payload
from armload.posterior import HybridIdentifier, PosteriorLeastSquares
from armload.posterior.solve import solve_to_go_on
from armload.recording import write_recording
from armload.regression import Correction, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData
from armload.regression.noise import SMOOTH
from armload.regression.rows import REGRESSOR_RATE, FilteredRegression, Rows
from armload.simulation import World, simulate

GAIN = 20.0


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def world(panda):
    return World.real_like(panda, seed=3)


@pytest.fixture(scope="module")
def log(panda, world):
    whole = simulate(panda, taie2024(), payload=make_payload().parameters, world=world, rate=500.0)
    return whole.between(0.0, 2.5)


@pytest.fixture(scope="module")
def tare(panda, world):
    return simulate(panda, random_motion(panda, seed=5, duration=6.0), world=world, rate=200.0, seed=4)


@pytest.fixture(scope="module")
def rows(panda, log):
    """Rows of the log as the stream makes them, with the features and unknowns of the default method."""
    correction = Correction(panda, panda.limits.effort)
    stream = FilteredRegression(panda, GAIN, correction, JointFeatures(panda.n), REGRESSOR_RATE, SMOOTH.block)
    return [row for sample in log if (row := stream.row(*sample)) is not None]


def regression(panda, rows):
    data = RegressionData(Correction(panda, panda.limits.effort), GAIN, JointFeatures(panda.n), SMOOTH.block)
    data.take(Rows.of(rows))
    return data


def advance(runs, std):
    """The posterior at the stated scales, and the state that takes further rows."""
    found = solve_to_go_on(runs, std, None, SMOOTH, 1, None)
    return found.posterior, found.state


def wrench_of_the_arrays(robot, q):
    """Jᵀ (n, 6) of the payload frame, force first, in the base's axes, from Pinocchio's Jacobian."""
    J, R = robot.frame_motion(q).jacobian[0], robot.frame_pose(q)[0][0]
    return np.vstack([R @ J[3:], R @ J[:3]]).T


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_a_row_of_the_momentum_form_is_what_the_arrays_give(name):
    robot = arm(name, gravity=(1.0, -3.0, -9.0))
    rng = np.random.default_rng(1)
    row = MomentumRow(robot)
    for _ in range(3):
        q, dq = rng.normal(size=(2, robot.n))
        assert wrench_row(*row.chain[:4], q) == pytest.approx(wrench_of_the_arrays(robot, q), abs=1e-12)
        momentum, drift = row(q, dq)
        payload, links = momentum_regressor(robot.frame_motion(q), dq), full_arm_regressor(robot, q, dq)
        assert momentum == pytest.approx(np.concatenate([payload.momentum, links.momentum], axis=2)[0], abs=1e-12)
        assert drift == pytest.approx(np.concatenate([payload.drift, links.drift], axis=2)[0], abs=1e-12)


def test_a_row_knows_slanted_and_sliding_joints():
    inertial = '<inertial><origin xyz="0.02 0.1 -0.03"/><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.15" '
    inertial += 'ixy="0.01" ixz="0" iyz="0"/></inertial>'
    joint = (
        '<joint name="j{0}" type="{1}"><parent link="l{0}"/><child link="l{2}"/><origin xyz="0.1 0.2 0.3" '
        'rpy="0.1 0.2 0.3"/><axis xyz="{3}"/><limit lower="-2" upper="2" effort="10" velocity="2"/></joint>'
    )
    kinds = (("revolute", "0.3 0.5 -0.6"), ("prismatic", "0.3 -0.5 0.6"), ("continuous", "0 -1 0"), ("fixed", "1 0 0"))
    bodies = [f'<link name="l{k}">{inertial}</link>' for k in range(len(kinds) + 1)]
    joints = [joint.format(k, kind, k + 1, axis) for k, (kind, axis) in enumerate(kinds)]
    robot = Arm("slanted", f'<robot name="slanted">{"".join([*bodies, *joints])}</robot>')
    q, dq = np.random.default_rng(3).normal(size=(2, robot.n))
    assert wrench_row(*MomentumRow(robot).chain[:4], q) == pytest.approx(wrench_of_the_arrays(robot, q), abs=1e-12)
    momentum, drift = MomentumRow(robot)(q, dq)
    payload, links = momentum_regressor(robot.frame_motion(q), dq), full_arm_regressor(robot, q, dq)
    assert momentum == pytest.approx(np.concatenate([payload.momentum, links.momentum], axis=2)[0], abs=1e-12)
    assert drift == pytest.approx(np.concatenate([payload.drift, links.drift], axis=2)[0], abs=1e-12)


def test_the_links_rows_give_the_arms_own_momentum(panda):
    rng = np.random.default_rng(2)
    q, dq = rng.normal(size=(2, 7))
    momentum, drift = MomentumRow(panda)(q, dq)
    p, bias = panda.momentum(q, dq)
    links = panda.link_parameters.ravel()
    assert momentum[:, 10:] @ links == pytest.approx(p[0], abs=1e-12)
    assert drift[:, 10:] @ links == pytest.approx(bias[0], abs=1e-12)


def test_rows_of_a_stream_are_those_of_the_whole_log(panda, log, rows):
    data = RegressionData(Correction(panda, panda.limits.effort), GAIN, JointFeatures(panda.n), SMOOTH.block)
    data.add(log.t, log.q, log.dq, log.tau)
    streamed = regression(panda, rows)
    np.testing.assert_allclose(streamed.A, data.A, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(streamed.b, data.b, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("tared", [False, True])
def test_a_posterior_that_takes_rows_is_the_posterior_of_all_of_them(panda, rows, tared):
    cut, std = 3 * len(rows) // 4, payload_prior_std(panda)
    before = [regression(panda, rows[: cut // 2])] if tared else []
    first = cut // 2 if tared else 0
    _, state = advance([*before, regression(panda, rows[first:cut])], std)
    whole, _ = advance([*before, regression(panda, rows[first:])], std)
    for row in rows[cut:]:
        state.take(row)
    unit = np.sqrt(np.diag(whole.information))  # some of the recursion is of single precision
    assert state.information / np.outer(unit, unit) == pytest.approx(whole.information / np.outer(unit, unit), abs=1e-6)
    assert state.vector / unit == pytest.approx(whole.vector / unit, abs=1e-5 * np.abs(whole.vector / unit).max())


def test_an_innovation_is_what_the_rows_before_did_not_say(panda, rows):
    """e' ~ N(w·phi, v'): the evidence of the last row alone is what it adds to Λ and h."""
    _, state = advance([regression(panda, rows[:-1])], payload_prior_std(panda))
    Λ, h = state.information.copy(), state.vector.copy()
    state.take(rows[-1])
    w, e, v = state.seen[:, :10], state.seen[:, 10], state.seen[:, 11]
    assert state.information - Λ == pytest.approx(w.T @ (w / v[:, None]), abs=1e-6 * np.abs(w).max() ** 2)
    assert state.vector - h == pytest.approx(w.T @ (e / v), abs=1e-6 * np.abs(w.T @ (e / v)).max())


def test_what_is_foreseen_of_a_row_is_the_innovation_of_its_first_joint_if_it_is_taken(panda, rows):
    _, state = advance([regression(panda, rows[:-1])], payload_prior_std(panda))
    state.take(rows[-2])  # no longer the state that the solution left
    seen, scale = state.predict(rows[-1])
    state.take(rows[-1])
    assert scale == pytest.approx(state.scale)
    assert seen[0] == pytest.approx(state.seen[0], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("tared", [False, True])
@pytest.mark.full  # some seconds
def test_the_running_answer_is_near_the_concluded_one(panda, log, tare, tared):
    times = (0.02, 0.1, 0.5, 2.4)
    before = tare if tared else None
    concluded = HybridIdentifier(panda, before).at(log, times)
    live, running = HybridIdentifier(panda, before), []
    for sample in log:
        estimate = live.update(sample)
        if len(running) < len(times) and sample.t >= log.t[0] + times[len(running)] - 1e-9:
            running.append(estimate)
    for slow, fast in zip(concluded, running, strict=True):
        assert np.all(np.abs(fast.phi - slow.phi) < 0.6 * slow.std)
        assert np.all(fast.std < 1.5 * slow.std)
        # what is concluded with a tare holds an exchange since then, too, which 2.4 s do not exclude
        assert np.all(slow.std < (4.0 if tared else 1.5) * fast.std)


def test_an_answer_is_at_most_ten_milliseconds_old(panda, log):
    live = HybridIdentifier(panda)
    ages = []
    for sample in log.between(0.0, 0.5):
        live.update(sample)
        ages.append(sample.t - live.data_t)
    assert max(ages[3:]) <= 0.0101


@pytest.mark.parametrize("after", [200, 260])  # samples: while a solution is being found, and between two
def test_a_copy_of_a_running_identifier_goes_on_as_the_original_does(panda, log, after):
    samples = list(log)
    identifier = HybridIdentifier(panda)
    for sample in samples[:after]:
        identifier.update(sample)
    other = deepcopy(identifier)
    both = [[one.update(sample) for sample in samples[after:450]] for one in (identifier, other)]
    for one, two in zip(*both, strict=True):
        np.testing.assert_array_equal(one.phi, two.phi)
        np.testing.assert_array_equal(one.covariance, two.covariance)


def test_an_empty_run_may_be_the_tare_of_the_next(panda, log, tare):
    first = PosteriorLeastSquares(panda)
    first.run(tare)
    following = first.another(first)
    mass = make_payload().parameters.mass
    untared, tared = first.another().run(log), following.run(log)
    assert tared.std[0] < 0.85 * untared.std[0]
    assert abs(tared.phi[0] - mass) < 3.0 * tared.std[0]


def test_two_tares_say_what_one_tare_of_their_rows_says(panda, rows):
    """Whatever was mounted was mounted at both."""
    a, b, std = len(rows) // 3, 2 * len(rows) // 3, payload_prior_std(panda)
    parted = [regression(panda, rows[:a]), regression(panda, rows[a:b]), regression(panda, rows[b:])]
    joined = [regression(panda, rows[:b]), regression(panda, rows[b:])]
    (two, _), (one, _) = (advance(runs, std) for runs in (parted, joined))
    unit = np.sqrt(np.diag(one.covariance))
    assert two.phi / unit == pytest.approx(one.phi / unit, abs=1e-6)
    assert two.covariance / np.outer(unit, unit) == pytest.approx(one.covariance / np.outer(unit, unit), abs=1e-6)


_COUNTS_THREADS = """
import json, sys
from threading import current_thread, main_thread

from threadpoolctl import ThreadpoolController

from armload.arms import arm
from armload.posterior import HybridIdentifier
from armload.posterior.problem import Problem
from armload.recording import read_recording
from armload.regression.information import RegressionData

blas, seen = ThreadpoolController().select(user_api="blas").lib_controllers, []

def spy(take):
    def spied(self, *arguments):
        if current_thread() is not main_thread():
            seen.append(max(library.num_threads for library in blas))
        return take(self, *arguments)
    return spied

RegressionData.take, Problem.posterior = spy(RegressionData.take), spy(Problem.posterior)
before = max(library.num_threads for library in blas)
live = HybridIdentifier(arm("panda"))
for sample in read_recording(sys.argv[1]):
    live.update(sample)
live.close()
print(json.dumps([before, seen, max(library.num_threads for library in blas)]))
"""


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS has one thread on one core")
def test_the_products_beside_a_stream_keep_to_one_thread(log, tmp_path):
    """BLAS's own threads would wait busily for the next product, of which there are a hundred a second."""
    write_recording(tmp_path / "log.csv", log.between(0.0, 1.0))
    settings = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    command = [sys.executable, "-c", _COUNTS_THREADS, str(tmp_path / "log.csv")]
    done = subprocess.run(command, env=settings, capture_output=True, text=True, check=True)
    before, seen, after = json.loads(done.stdout)
    assert before == after == 2
    assert len(seen) > 5
    assert set(seen) == {1}
