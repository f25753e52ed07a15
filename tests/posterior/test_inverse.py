"""Linear algebra of the solution, beside SciPy's."""

import numpy as np
import pytest
from scipy import linalg, special

from armload.estimators.total import _relative
from armload.posterior.elimination import inverse
from armload.regression.features import _VELOCITY_SCALE, JointFeatures


def positive(n, decades=6, seed=1):
    rng = np.random.default_rng(seed)
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    return (Q * 10.0 ** rng.uniform(0, decades, n)) @ Q.T


@pytest.mark.parametrize("n", [1, 2, 39, 40, 41, 140])
def test_the_inverse_is_symmetric_and_that_of_its_cholesky_factor(n):
    A = positive(n)
    found = inverse(A)
    np.testing.assert_array_equal(found, found.T)
    expected = linalg.cho_solve(linalg.cho_factor(A), np.eye(n))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("n", [3, 90])
def test_a_matrix_that_is_not_positive_definite_is_refused(n):
    A = positive(n) - 2.0 * 10**6 * np.eye(n)
    with pytest.raises(np.linalg.LinAlgError):
        inverse(A)
    with pytest.raises(np.linalg.LinAlgError):
        inverse(np.full((n, n), np.nan))


def test_relative_eigenvalues_are_those_of_the_pair():
    A, B = positive(11, 3, 2), positive(11, 3, 3)
    values, V = _relative(B, A)
    np.testing.assert_allclose(values, linalg.eigh(B, A, eigvals_only=True), rtol=1e-9)
    np.testing.assert_allclose(V.T @ A @ V, np.eye(11), atol=1e-9)
    np.testing.assert_allclose(V.T @ B @ V, np.diag(values), atol=1e-9 * values[-1])


def test_velocity_waves_are_quantiles_of_the_half_normal():
    features = JointFeatures(7)
    count = features.velocity // 2
    expected = special.ndtri(0.5 + (np.arange(count) + 0.5) / (2 * count)) / _VELOCITY_SCALE
    np.testing.assert_allclose(features.velocity_waves, expected, rtol=1e-14)
