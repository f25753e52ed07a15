"""Whether gravity is as it was given: the angles by which the base leans, and how surely it does.

Two more unknowns of the arm (`Correction.tilt`), the same at the tare and in the run: the derivative of the bare arm's
torque as gravity is turned about two horizontal axes. Gravity is believed at first; here it has a wide prior,
theta ~ N(0, WIDE²), and with P the posterior covariance of theta and c by how much that is overrated,

    T = thetaᵀ·(c·P + LEVEL²)⁻¹·theta

is small where gravity is as given. The payload's own torque turns too; that is left out here, as whoever finds gravity
turned answers the log once more, with gravity as it was found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior.drift import STEPS
from armload.posterior.problem import Problem
from armload.posterior.scales import Posterior, Scales, Tilt
from armload.posterior.solve import solve
from armload.regression import GaussianPrior
from armload.regression.information import RegressionData
from armload.regression.noise import NoiseModel

LEVEL = np.radians(0.5)  # standard deviation of a base that counts as level: bolted without a spirit level
WIDE = np.radians(10.0)  # of one that may not: the log decides
# T above which a base leans: beyond 1.8° of an arm whose links are known well. Sound logs of Pandas stay below 3, those
# of arms with nominal links or motor currents below 10 (test_gravity_as_it_is_is_not_doubted)
LEANS = 12.0
# T above which it may, of an arm whose links are known: the 95 % quantile of a chi-squared distribution of two degrees
# of freedom. T allows for a base that is level to 0.5°, so that of 128 sound logs of simulated Pandas none is above 2
# (test_a_base_that_may_lean_is_said_and_no_answer_of_it_is_called_calibrated)
MAY_LEAN = 5.991464547107979
# [rad] by which gravity still turns once it has been found turned: an answer changes by less than its error bars; and
# how often it is turned at most (test_a_base_that_leans_is_found_and_answered_for)
TURNED, TURNS = np.radians(0.2), 3
# [s] of all logs before a stream is asked: friction behind gears looks like a base that leans until it has shown, after
# 0.4 s (test_friction_that_nobody_expects_is_no_base_that_leans)
ASKED_FROM = 0.7


def tilt_of_base(
    runs: Sequence[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None,
    noise: NoiseModel,
    found: Posterior,
) -> Tilt:
    """Test whether gravity is as it was given.

    Args:
        runs, prior_std, prior, noise: as of `solve`. found: their solution, for its scales.
    """
    start = _wide(found.scales, runs[-1].correction.tilt)
    there = solve(list(runs), prior_std, prior, noise, STEPS, start)
    return _tilt(there.tilt, there.tilt_covariance, noise.overrated)


def tilt_so_far(problem: Problem, scales: Scales) -> Tilt:
    """The same of a stream, at the scales of its last solution: it is asked often, and this costs next to nothing.

    A base that leans makes the noise look larger, so that T is smaller than that of `tilt_of_base`.
    """
    which = problem.correction.tilt
    there = problem.posterior(_wide(scales, which))
    C = there.covariance[problem.eta, problem.eta][which, which]
    return _tilt(there.mean[problem.eta][which], C, problem.noise_model.overrated)


def _wide(scales: Scales, which: slice) -> Scales:
    """Scales with which gravity is not believed."""
    eta = scales.eta.copy()
    eta[which] = WIDE**2
    return replace(scales, eta=eta)


def _tilt(angles: NDArray[np.float64], covariance: NDArray[np.float64], overrated: float) -> Tilt:
    statistic = float(angles @ np.linalg.solve(overrated * covariance + LEVEL**2 * np.eye(2), angles))
    return Tilt(angles, statistic, statistic > LEANS)
