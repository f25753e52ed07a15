"""The long-run variance S of the residual, of noise whose S is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm
from armload.arms import rated_effort
from armload.motion import random_motion
from armload.posterior.solve import solve
from armload.regression import Correction, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, whole_noise
from armload.simulation import simulate


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
