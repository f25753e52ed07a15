"""A weighed mass narrows what is left to be found, and is never taken against the log without a word."""

from __future__ import annotations

import numpy as np
import pytest

from armload import arm
from armload.errors import IdentificationError
from armload.inertia import Z95
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.posterior import HybridIdentifier
from armload.posterior.known_mass import KnownMass


def test_a_gaussian_given_one_of_its_coordinates_is_what_many_draws_near_it_show():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(10, 10))
    mean, C = rng.normal(size=10), root @ root.T
    known = KnownMass(float(mean[0] + 1.5), 0.3)
    found, covariance = known.given(mean, C)
    draws = rng.multivariate_normal(mean, C, size=400_000)
    weight = np.exp(-0.5 * ((draws[:, 0] - known.mass) / known.std) ** 2)
    seen = weight @ draws / weight.sum()
    assert found == pytest.approx(seen, abs=0.05 * np.sqrt(np.diag(C)).max())
    spread = (weight[:, None] * (draws - seen)).T @ (draws - seen) / weight.sum()
    assert covariance == pytest.approx(spread, abs=0.05 * np.diag(C).max())


@pytest.mark.full
def test_a_known_mass_makes_the_moments_better_and_their_intervals_narrower_and_they_hold():
    panda = arm("panda")
    better, inside = [], []
    for log in simulate_episodes(draw_episodes(panda, "untared", 8, seed=17, motions=6)):
        plain, weighed = HybridIdentifier(panda), HybridIdentifier(panda)
        weighed.known_mass = KnownMass(log.truth.mass, 1e-3)
        before, after = plain.run(log.run), weighed.run(log.run)
        assert abs(after.phi[0] - log.truth.mass) < 5e-3
        assert np.all(after.std <= before.std * (1 + 1e-9))
        better.append(np.abs(before.phi - log.truth.phi)[1:4].sum() - np.abs(after.phi - log.truth.phi)[1:4].sum())
        inside.append(np.abs(after.phi - log.truth.phi)[1:] <= Z95 * after.std[1:])
    assert np.mean(better) > 0.0
    assert np.mean(inside) > 0.85


@pytest.mark.parametrize(("mass", "std"), [(np.nan, 0.1), (1.0, 0.0), (1.0, -1.0), (np.inf, 1.0)])
def test_a_mass_that_is_none_is_refused(mass, std):
    with pytest.raises(IdentificationError, match="expected a number and a standard deviation above zero"):
        KnownMass(mass, std)
