"""A run of another arm than its tare: two hypotheses compared, said, and answered without the tare's arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from armload import arm, identify
from armload.arms import rated_effort
from armload.identification.arm_notes import arm_changed
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import random_motion
from armload.posterior import HybridIdentifier
from armload.posterior.another_arm import SURPRISING, another_arm, apart
from armload.posterior.problem import Problem
from armload.posterior.profile_session import log_data
from armload.posterior.scales import AnotherArm
from armload.posterior.solve import solve
from armload.regression import Correction, FilteredRegression, JointFeatures, solution_prior_std
from armload.regression.information import SAME, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.simulation import Sensors, World, simulate

SMALL = JointFeatures(7, 8, 4)


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def short(panda):
    """Two logs of a second, of one arm: dense matrices of their rows are small."""
    world, sensors = World.real_like(panda, 4), Sensors.panda(panda)
    motions = [random_motion(panda, seed, duration=1.0) for seed in (1, 2)]
    return [simulate(panda, motion, world=world, sensors=sensors, rate=50.0, seed=3) for motion in motions]


def rows(panda, log):
    """Scaled rows X (m, n, size) and r (m, n) of a log, and the data that hold them."""
    correction = Correction(panda, rated_effort(panda))
    made = FilteredRegression(panda, GAIN, correction, SMALL, 50.0, SMOOTH.block).rows(log.t, log.q, log.dq, log.tau)
    root = np.sqrt(made.weights * made.h[:, None])
    return log_data(correction, log, SMALL, SAME), root[:, :, None] * made.X, root * made.r


def dense(panda, problem, scales, logs, payloads, drifts):
    """ln p of all rows of `logs`, (X, r, S) each, made of the model as one multivariate Gaussian."""
    correction = problem.correction
    p, d, R, n = correction.size, correction.drifting, SMALL.size, panda.n
    prior = [scales.payloads, scales.eta, scales.drifts.ravel(), scales.features.ravel()]
    blocks, values = [], []
    for k, (X, r, S) in enumerate(logs):
        for j in range(n):
            H = np.zeros((len(r), sum(len(part) for part in prior)))
            for i in payloads[k]:
                H[:, 10 * i : 10 * i + 10] = X[:, j, :10]
            first = len(prior[0])
            H[:, first : first + p] = X[:, j, 10 : 10 + p]
            if drifts[k]:
                H[:, first + p : first + p + d] = X[:, j, 10 : 10 + d]
            own = first + p + len(prior[2]) + j * R
            H[:, own : own + R] = X[:, j, 10 + p :]
            blocks.append(H / np.sqrt(S[j]))
            values.append(r[:, j] / np.sqrt(S[j]))
    H, y = np.concatenate(blocks), np.concatenate(values)
    C = (H * np.concatenate(prior)) @ H.T + np.eye(len(y))
    return float(multivariate_normal(np.zeros(len(y)), C, allow_singular=True).logpdf(y))  # pyright: ignore


def test_the_odds_are_the_ratio_of_the_densities_of_all_rows(panda, short):
    (tare, *tare_rows), (run, *run_rows) = (rows(panda, log) for log in short)
    run.session, wide = Session(1, 3.0), solution_prior_std(panda)
    found = solve([tare, run], wide, None, SMOOTH, 3)
    S, scales = found.scales.noise, found.scales
    both, before = Problem([tare, run], wide, None, SMOOTH), Problem([tare], wide, None, SMOOTH)
    joint = replace(scales, drifts=both.drift_variance)
    same = dense(panda, both, joint, [(*tare_rows, S[0]), (*run_rows, S[1])], [[0], [0, 1]], [False, True])
    first = replace(scales, payloads=scales.payloads[:10], drifts=np.zeros((0, 0)))
    same -= dense(panda, before, first, [(*tare_rows, S[0])], [[0]], [False])
    run.session = SAME
    alone = Problem([run], wide, None, SMOOTH)
    own = alone.scales(None)
    for _ in range(3):
        own = alone.improved(own, alone.posterior(own))
    other = dense(panda, alone, own, [(*run_rows, S[1])], [[0]], [False])
    run.session = Session(1, 3.0)
    assert another_arm([tare, run], wide, None, SMOOTH, found).log_odds == pytest.approx(other - same, abs=1e-3)


def test_what_is_left_of_the_payload_is_the_difference_of_two_arms_loads(panda, short):
    (tare, *_), (run, *_) = (rows(panda, log) for log in short)
    wide = solution_prior_std(panda)
    found = solve([tare, run], wide, None, SMOOTH, 3)
    out = apart([tare, run], wide, None, SMOOTH, 3, found).posterior
    before = solve([tare], wide, None, SMOOTH, 1, found.scales)
    now = solve([run], wide, None, SMOOTH, 3)
    # phi = x − phi_0 of two arms that know nothing of each other: their covariances add up
    heaviest = abs(before.phi[0]) + 2.0 * np.sqrt(before.covariance[0, 0])
    weak = np.r_[wide[:1] ** 2, np.minimum(wide[1:] ** 2, (heaviest * np.r_[[0.2] * 3, [0.04] * 6]) ** 2)]
    P0 = np.linalg.inv(before.information + np.diag(1.0 / weak))
    units = np.outer(wide, wide)
    expected = np.linalg.inv(now.information) + P0
    assert np.linalg.inv(out.information) / units == pytest.approx(expected / units, rel=1e-5, abs=1e-9)
    mean = np.linalg.solve(now.information, now.vector) - P0 @ before.vector
    assert np.linalg.solve(out.information, out.vector) / wide == pytest.approx(mean / wide, rel=1e-4, abs=1e-6)


@pytest.mark.full  # some seconds
def test_the_tare_of_another_arm_is_said_and_the_intervals_hold_without_it(panda):
    drawn = draw_episodes(panda, "reference", 3, seed=81, motions=3)
    others = [replace(e, tare_world=World.real_like(panda, (e.world.seed or 0) + 1)) for e in drawn]
    said, inside = [], []
    for log in simulate_episodes(others):
        answer = identify(log.run, panda, tare=log.tare)
        said.append(any("another one, or was repaired" in note for note in answer.notes))
        inside.append((log.truth.phi >= answer.phi_low) & (log.truth.phi <= answer.phi_high))
        assert answer.interval == "approximate"
    assert sum(said) >= 2
    assert np.mean(inside) > 0.85


def test_what_the_odds_do_not_say_is_not_said_flatly(panda):
    def said(log_odds):
        return arm_changed(panda, None, AnotherArm(log_odds, 5.0, found=True))

    assert "it is another one" in said(3.1)
    assert "it may be another one" in said(2.9)


@pytest.mark.full  # some seconds
def test_the_same_arm_is_no_other_after_a_day(panda):
    drawn = draw_episodes(panda, "reference", 3, seed=81, motions=3)
    then = [replace(e, tare_world=replace(e.world, offset=np.asarray(e.world.offset) + 0.1)) for e in drawn]
    for e in simulate_episodes([*drawn[:1], *then]):
        identifier = HybridIdentifier(panda, e.tare)
        identifier.run(e.run)
        assert identifier.stream.another is not None
        assert not identifier.stream.another.found
        assert identifier.stream.another.surprise < SURPRISING
