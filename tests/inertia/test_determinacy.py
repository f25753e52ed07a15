"""Whether anything is there: the probability is right for payloads drawn as it says."""

import numpy as np
import pytest

from armload.inertia import DROPPED, SHRINK, held_probability


@pytest.mark.parametrize("std", [0.01, 0.1, 1.0])
def test_of_masses_that_are_held_with_a_probability_that_share_is_held(std):
    rng, payloads = np.random.default_rng(1), 1.5
    there = rng.random(100_000) < 0.5
    seen = np.where(there, np.abs(rng.normal(0.0, payloads, len(there))), 0.0) + rng.normal(0.0, std, len(there))
    there, p = there[seen > 0.0], np.array([held_probability(m, std, payloads) for m in seen[seen > 0.0]])
    for low, high in ((0.0, 0.1), (0.1, 0.5), (0.5, 0.9), (0.9, 1.0)):
        called = (p >= low) & (p < high)
        if called.sum() > 100:
            error = np.sqrt(0.25 / called.sum())
            assert there[called].mean() == pytest.approx(p[called].mean(), abs=4.0 * error)
    assert (p > 0.9).sum() > 1000


def test_a_mass_below_zero_is_held_no_more_than_none():
    assert held_probability(-5.0, 0.01, 1.5) == held_probability(0.0, 0.01, 1.5) < 0.01


def test_nothing_is_held_any_more_where_a_log_determines_a_mass_of_zero():
    assert held_probability(0.0, 1.5 / SHRINK, 1.5) < DROPPED < held_probability(0.0, 1.6 / SHRINK, 1.5)
