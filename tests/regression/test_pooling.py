"""Rows that are taken together say what they say one after another."""

import numpy as np
import pytest

from armload.regression.pooling import Pooling, pooled
from armload.regression.rows import Row


def row(t, h=0.005, size=6, n=2, seed=0):
    rng = np.random.default_rng(seed)
    return Row(t, rng.normal(size=n), h, rng.normal(size=(n, size)), rng.normal(size=n), rng.uniform(0.1, 1.0, n))


def information(rows):
    """Σ h·w·Xᵀ·X and Σ h·w·Xᵀ·r, as least squares on single rows has them."""
    weighted = [(r.h * r.weights[:, None] * r.X, r) for r in rows]
    return sum(a.T @ r.X for a, r in weighted), sum(a.T @ r.r for a, r in weighted)


def test_rows_of_one_regressor_say_as_one_what_they_say_alone():
    X = row(0.0).X
    rows = [row(0.01 * k, h=h, seed=k)._replace(X=X) for k, h in enumerate((0.004, 0.006, 0.002))]
    for ours, theirs in zip(information([pooled(rows)]), information(rows), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def test_a_row_alone_stays_as_it_is():
    alone = row(0.0)
    assert pooled([alone]) is alone


def test_rows_as_one_are_where_the_last_is_for_as_long_as_all():
    first, last = row(0.0, h=0.005, seed=1), row(0.006, h=0.006, seed=2)
    one = pooled([first, last])
    assert (one.t, one.h) == (last.t, pytest.approx(0.011))
    np.testing.assert_array_equal(one.q, last.q)


def test_a_row_that_stands_for_no_time_says_nothing_beside_one_that_does():
    moving, standing = row(0.0, seed=1), row(0.005, h=0.0, seed=2)
    np.testing.assert_allclose(pooled([moving, standing]).X, moving.X, rtol=1e-12)


def test_rows_of_a_standing_arm_stand_for_no_time_as_one_and_are_averaged():
    rows = [row(0.005 * k, h=0.0, seed=k)._replace(weights=np.ones(2)) for k in range(2)]
    one = pooled(rows)
    assert one.h == 0.0
    np.testing.assert_allclose(one.r, (rows[0].r + rows[1].r) / 2.0, rtol=1e-12)


def given(pooling, steps):
    """How many rows come together, of rows with these steps between them [s]."""
    return [len(rows) for t in np.cumsum(steps) if (rows := pooling.take(row(t)))]


@pytest.mark.parametrize(("step", "expected"), [(0.005, 2), (0.002, 5), (0.006, 1), (0.008, 1), (0.01, 1), (0.04, 1)])
def test_no_row_waits_longer_than_asked(step, expected):
    groups = given(Pooling(0.01), np.full(100, step))
    assert set(groups[1:]) == {expected}


def test_rows_come_together_though_the_clock_jitters():
    rng = np.random.default_rng(3)
    groups = given(Pooling(0.01), 0.005 * rng.uniform(0.9, 1.1, 400))
    assert np.mean(groups) > 1.6


def test_without_a_time_each_row_is_taken_alone():
    assert given(Pooling(0.0), np.full(20, 0.005)) == [1] * 20


def test_what_waits_can_be_had():
    pooling = Pooling(0.01)
    pooling.take(row(0.0))
    assert pooling.take(row(0.005)) == []
    assert [r.t for r in pooling.release()] == [0.005]
    assert pooling.release() == []
