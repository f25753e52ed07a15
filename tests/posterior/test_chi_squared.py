"""The closed form of the chi-squared distribution says what SciPy's incomplete gamma function says."""

import pytest
from scipy.stats import chi2

from armload.posterior.chi_squared import beyond


@pytest.mark.parametrize("k", [1, 2, 3, 18, 21, 36])
def test_how_seldom_a_value_is_exceeded_is_scipy_s(k):
    for x in (-1.0, 0.0, 1e-9, 0.5, 3.0, 21.0, 60.0, 300.0):
        assert beyond(x, k) == pytest.approx(chi2.sf(x, k), rel=1e-12)
    assert beyond(1e9, k) == 0.0
