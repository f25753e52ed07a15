"""The long-run variance S of the residual, of noise whose S is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm
from armload.arms import rated_effort
from armload.identification import identify
from armload.identification.notes import MOTOR_PROFILE
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.posterior import SmoothPosteriorLeastSquares, learn_profile
from armload.posterior.problem import Problem
from armload.posterior.solve import solve
from armload.regression import Correction, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, share_of_noise, whole_noise
from armload.simulation import Sensors, World, simulate


@pytest.mark.parametrize("seed", [0, 1])
def test_white_noise_is_known_by_its_power_where_few_blocks_and_many_functions_hide_it(seed):
    """White noise of variance s² in samples h apart has S = s²·h: an arm as its model is has no other."""
    robot, rate = arm("panda"), 100.0
    correction = Correction(robot, rated_effort(robot))
    std = 0.01 * correction.effort
    log = simulate(robot, random_motion(robot, 20 + seed, duration=3.0), rate=rate)
    log = replace(log, tau=log.tau + std * np.random.default_rng(seed).normal(size=log.tau.shape))
    data = RegressionData(correction, GAIN, JointFeatures(robot.n), SMOOTH.block)
    data.add(log.t, log.q, log.dq, log.tau)
    found = {}
    for white in (True, False):
        noise = replace(SMOOTH, white=white)
        found[white] = solve([data], payload_prior_std(robot), None, noise, 3).residual ** 2
    expected = whole_noise(correction, SMOOTH) + std**2 / rate
    assert np.all((0.4 * expected < found[True]) & (found[True] < 1.5 * expected))
    assert np.median(found[True] / expected) > 0.6
    assert np.median(found[False] / expected) < 0.4


def _said(robot, log) -> RegressionData:
    data = RegressionData(Correction(robot, rated_effort(robot)), GAIN, JointFeatures(robot.n, 8, 4), SMOOTH.block)
    data.add(log.t, log.q, log.dq, log.tau)
    return data


def test_a_run_too_short_to_tell_is_foreseen_as_noisy_as_its_tare_was():
    """A tenth of a second shows nothing of a noise of ten times what is expected of any arm."""
    robot, rate = arm("ur5e"), 100.0
    correction = Correction(robot, rated_effort(robot))
    std = 10.0 * np.sqrt(whole_noise(correction, SMOOTH) * rate)
    tare = simulate(robot, random_motion(robot, 3, duration=20.0), rate=rate)
    tare = replace(tare, tau=tare.tau + std * np.random.default_rng(0).normal(size=tare.tau.shape))
    run = simulate(robot, random_motion(robot, 4, duration=5.0), rate=rate).between(0.0, 0.1)
    said, prior = [_said(robot, tare), _said(robot, run)], payload_prior_std(robot)
    start = solve(said[:1], prior, None, SMOOTH, 5).scales
    problem = Problem(said, prior, None, SMOOTH)
    scales, shown = problem.scales(start), problem.share[-1] * start.noise[0]
    np.testing.assert_allclose(scales.noise[-1], shown)
    assert np.median(shown / problem.expected[-1]) > 10.0
    again = problem.improved(scales, problem.posterior(scales)).noise[-1]
    assert np.all((0.5 * shown < again) & (again < 2.0 * shown))


def test_logs_of_a_profile_are_learned_alike_whichever_comes_last():
    """Only a run after a tare is foreseen by it: which of several logs stands last must not change what they say."""
    robot = arm("ur5e")
    logs = [simulate(robot, random_motion(robot, k, duration=6.0), world=World.real_like(robot, 2)) for k in (1, 2)]
    data, prior = [_said(robot, log) for log in logs], payload_prior_std(robot)
    found = []
    for order in (data, data[::-1]):
        problem = Problem(order, prior, None, SMOOTH, same=True)
        scales = problem.scales(None)
        for _ in range(3):
            scales = problem.improved(scales, problem.posterior(scales))
        found.append(scales.noise)
    np.testing.assert_allclose(found[0], found[1][::-1], rtol=1e-6)


def test_a_run_with_a_profile_is_foreseen_as_noisy_as_the_profile_s_logs_were():
    robot, rate = arm("ur5e"), 100.0
    world, sensors = World.real_like(robot, 3), Sensors.of(robot)
    more = {"world": world, "sensors": sensors, "rate": rate}
    logs = [simulate(robot, random_motion(robot, k, duration=12.0), seed=k, **more) for k in (1, 2)]
    profile = learn_profile(robot, logs)
    identifier = SmoothPosteriorLeastSquares(robot, profile=profile)
    samples, correction = iter(logs[0]), Correction(robot, rated_effort(robot))
    shown = np.mean([np.square(one.noise) for one in profile.sessions], axis=0) * whole_noise(correction, SMOOTH)
    assert shown.max() > 2.0 * whole_noise(correction, SMOOTH)[shown.argmax()]
    expected = np.maximum(shown, whole_noise(correction, SMOOTH))
    while not identifier.stream.rows:
        identifier.update(next(samples))
    state = identifier.stream.state or identifier.stream._current
    np.testing.assert_allclose(state.noise, share_of_noise(identifier.stream.seconds) * expected, rtol=1e-3)


def test_an_answer_with_a_profile_of_motor_currents_is_not_called_calibrated_and_says_so():
    robot = arm("ur5e")
    more = {"world": World.real_like(robot, 3), "sensors": Sensors.of(robot), "rate": 100.0}
    profile = learn_profile(robot, [simulate(robot, random_motion(robot, 1, duration=20.0), seed=1, **more)])
    run = simulate(robot, random_motion(robot, 2, duration=4.0), draw_payload("boxes", 3, 2.0), seed=2, **more)
    answer = identify(run, robot, profile=profile)
    assert answer.method == "hybrid"
    assert answer.interval == "approximate"
    assert MOTOR_PROFILE in answer.notes
