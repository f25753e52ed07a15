"""What is added at a cut, from one solution for all cuts, is what a solution of the cut's two sides says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload.identification.cut_scan import added_at_cuts, of_the_log
from armload.identification.cut_statistics import Cuts
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.posterior import SmoothPosteriorLeastSquares
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
    for stretch in stretches:
        stretch.session = search.session
    whole = RegressionData.joined(stretches).of_features(features)
    scales = Problem([*known, whole], search.weak, None, SMOOTH, same=True).scales(search.rough.start)
    twice = replace(scales, noise=np.vstack([scales.noise, scales.noise[-1:]]))
    found = added_at_cuts(known, stretches, features, search.weak, scales)
    assert len(found) == len(CUTS)
    for k, (information, vector) in enumerate(found, start=1):
        parts = [RegressionData.joined(part).of_features(features) for part in (stretches[:k], stretches[k:])]
        own = solve([*known, *parts], search.weak, None, SMOOTH, 1, twice)
        scale = np.sqrt(np.outer(np.diag(own.information), np.diag(own.information)))
        np.testing.assert_allclose(information / scale, own.information / scale, atol=1e-6)
        np.testing.assert_allclose(vector, own.vector, atol=1e-6 * np.abs(own.vector).max())
    np.testing.assert_allclose(of_the_log(twice, (2.0, 3.0)).noise, scales.noise)
