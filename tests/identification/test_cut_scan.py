"""What is added at a cut, from one solution for all cuts, is what a solution of the cut's two sides says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from armload.identification.cut_scan import Unchanged, log_evidence, of_the_log
from armload.identification.cut_statistics import Cuts
from armload.identification.segments import changes_of_payload
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.posterior import SmoothPosteriorLeastSquares, learn_profile
from armload.posterior.problem import Problem
from armload.posterior.solve import solve
from armload.regression.information import RegressionData
from armload.regression.noise import SMOOTH
from armload.regression.rows_of_log import RowsOfLog
from armload.simulation import World, simulate_inverse

CUTS = [100, 250, 400]


def log_of(panda, seed, held=((0.0, None),)):
    world = World.real_like(panda, 3)
    return simulate_inverse(panda, random_motion(panda, seed, duration=6.0), held, world=world, rate=100.0, seed=seed)


@pytest.mark.parametrize("tared", [False, True])
def test_a_cut_says_what_a_solution_of_its_own_with_the_same_scales_does(panda, tared):
    log = log_of(panda, 1, [(0.0, None), (2.5, draw_payload("boxes", 3, 1.0))])
    physics = SmoothPosteriorLeastSquares(panda, log_of(panda, 2) if tared else None)
    search = Cuts(physics, RowsOfLog(physics.stream.regression(), log), 1.0)
    known, features = search.rough.known, search.few
    stretches = search._stretches(0, len(search.rows.t), np.array(CUTS))
    whole = RegressionData.joined(stretches).of_features(features)
    scales = Problem([*known, whole], search.weak, None, SMOOTH, same=True).scales(search.rough.start)
    twice = replace(scales, noise=np.vstack([scales.noise, scales.noise[-1:]]))
    found = Unchanged(known, stretches, features, search.weak, scales).at_cuts()
    assert len(found) == len(CUTS)
    for k, (information, vector) in enumerate(found, start=1):
        parts = [RegressionData.joined(part).of_features(features) for part in (stretches[:k], stretches[k:])]
        own = solve([*known, *parts], search.weak, None, SMOOTH, 1, twice)
        scale = np.sqrt(np.outer(np.diag(own.information), np.diag(own.information)))
        np.testing.assert_allclose(information / scale, own.information / scale, atol=1e-6)
        np.testing.assert_allclose(vector, own.vector, atol=1e-6 * np.abs(own.vector).max())
    np.testing.assert_allclose(of_the_log(twice, (2.0, 3.0)).noise, scales.noise)


@pytest.mark.full  # some seconds
def test_a_profile_and_a_tare_beside_it_carry_the_same_and_a_sound_log_is_not_doubted(panda):
    """What was taken off a run is told by its rows, by least squares: of both it is one body."""
    profile = learn_profile(panda, [log_of(panda, seed) for seed in range(4, 8)])
    log = log_of(panda, 1, [(0.0, draw_payload("boxes", 3, 1.0))])
    physics = SmoothPosteriorLeastSquares(panda, log_of(panda, 2), profile=profile)
    search = Cuts(physics, RowsOfLog(physics.stream.regression(), log), 1.0)
    taken = []
    for run, less in zip(physics.stream.tares, search.whole.known, strict=True):
        A, b = run.A[:, 10:, :10].reshape(-1, 10), (run.b - less.b)[:, 10:].ravel()
        scale = np.linalg.norm(A, axis=0)
        taken.append(np.linalg.lstsq(A / scale, b, rcond=None)[0] / scale)
    np.testing.assert_allclose(*taken, rtol=1e-6, atol=1e-9)
    changes = changes_of_payload(log, panda, log_of(panda, 2), profile)
    assert changes.times == []
    assert not changes.doubted


def test_what_torques_drift_by_is_told_by_the_information_of_the_drift(panda):
    """Oracle: h is linear in the drift that is added, with Λ as its slope; of a cut it is what is told of cuts."""
    log = log_of(panda, 1)
    physics = SmoothPosteriorLeastSquares(panda)
    by = np.linspace(-1.0, 1.0, panda.n)

    def told(drift):
        torque = log.tau + np.outer(log.t / log.t[-1] - 0.5, drift)
        search = Cuts(physics, RowsOfLog(physics.stream.regression(), replace(log, tau=torque)), 1.0)
        rows = np.linspace(0, len(search.rows.t), 41)[1:-1].astype(int)
        stretches, t = search._stretches(0, len(search.rows.t), rows), search.rows.t
        edges = t[[0, *rows, len(t) - 1]]
        height = (0.5 * (edges[1:] + edges[:-1]) - t[0]) / (t[-1] - t[0]) - 0.5
        unchanged = Unchanged([], stretches, search.few, search.weak, None)
        return unchanged.cut_and_drift(20, height), unchanged.at_cuts()[19]

    ((Λ, without), cut), ((_, with_it), _) = told(np.zeros(panda.n)), told(by)
    unit = np.sqrt(np.diag(Λ))
    assert np.linalg.eigvalsh(Λ / np.outer(unit, unit))[0] >= -1e-9
    expected = Λ[:, 10:] @ by  # of what seems to be added at the cut, too
    np.testing.assert_allclose((with_it - without) / unit, expected / unit, atol=0.03 * np.abs(expected / unit).max())
    np.testing.assert_allclose(Λ[:10, :10], cut[0], rtol=1e-9, atol=1e-9 * np.abs(cut[0]).max())
    np.testing.assert_allclose(without[:10], cut[1], rtol=1e-9, atol=1e-9 * np.abs(cut[1]).max())


@pytest.mark.parametrize("joint", [2, 6])
def test_the_joint_that_drifts_most_of_its_effort_limit_is_named(panda, joint):
    log, share = log_of(panda, 1), np.full(panda.n, 0.005)
    share[joint - 1] = -0.03
    torque = log.tau + np.outer(log.t / log.t[-1] - 0.5, share * panda.limits.effort)
    physics = SmoothPosteriorLeastSquares(panda)
    search = Cuts(physics, RowsOfLog(physics.stream.regression(), replace(log, tau=torque)), 1.0)
    found = search.drift(0, len(search.rows.t), 250)
    assert found.said
    assert found.joint == joint
    assert found.torque == pytest.approx(-0.03 * panda.limits.effort[joint - 1], rel=0.3)


def test_the_evidence_of_unknowns_is_that_of_the_marginal_likelihood():
    """Oracle: SciPy's multivariate normal, of data with the unknowns integrated out and of data without them."""
    rng = np.random.default_rng(0)
    X, root = rng.normal(size=(12, 3)), rng.normal(size=(3, 3))
    r = rng.normal(size=12)
    whole = multivariate_normal(np.zeros(12), np.eye(12) + X @ root @ root.T @ X.T).logpdf(r)
    none = multivariate_normal(np.zeros(12), np.eye(12)).logpdf(r)
    assert log_evidence((X.T @ X, X.T @ r), root) == pytest.approx(whole - none)
