"""How good estimates are: absolute errors, intervals and whether they hold, and when an estimate has settled.

Arrays are (..., 10) over the parameters, with runs on axis 0 unless an axis is named.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from armload.errors import IdentificationError


def absolute_error(phi: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """|phi − truth|, any shapes that broadcast [units of phi]."""
    return np.abs(np.asarray(phi, dtype=float) - np.asarray(truth, dtype=float))


def mean_absolute_error(phi: ArrayLike, truth: ArrayLike, axis: int = 0) -> NDArray[np.float64]:
    """MAE = (1/R)·Σ_r |phi_r − truth_r|, the measure of Taie et al. 2024, Fig. 4-7 [units of phi].

    >>> float(mean_absolute_error([1.0, 2.0, 4.0], 2.0))
    1.0
    """
    return absolute_error(phi, truth).mean(axis=axis)


def spread(phi: ArrayLike, truth: ArrayLike, axis: int = 0) -> NDArray[np.float64]:
    """Standard deviation of the absolute error over runs (with R − 1; 0 for a single run) [units of phi]."""
    error = absolute_error(phi, truth)
    return error.std(axis=axis, ddof=1) if error.shape[axis] > 1 else np.zeros_like(error.mean(axis=axis))


def half_width(std: ArrayLike, level: float = 0.95) -> NDArray[np.float64]:
    """Half-width of the two-sided normal interval that holds a share `level`: z·std with z = Φ⁻¹((1 + level)/2).

    >>> round(float(half_width(1.0)), 3)
    1.96

    Raises:
        IdentificationError: the level is no share between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise IdentificationError(f"level is {level}: expected a share between 0 and 1")
    return ndtri(0.5 * (1.0 + level)) * np.asarray(std, dtype=float)


def coverage(phi: ArrayLike, std: ArrayLike, truth: ArrayLike, level: float = 0.95, axis: int = 0) -> NDArray:
    """Share of runs whose interval phi ± `half_width` holds the truth; an honest method has `level`.

    >>> float(coverage([0.0, 1.0, 3.0, 0.5], 1.0, 0.0))
    0.75
    """
    return np.mean(absolute_error(phi, truth) <= half_width(std, level), axis=axis)


def settling_time(times: ArrayLike, values: ArrayLike, band: ArrayLike) -> float:
    """The first of `times` (T,) from which on `values` (T,) stay within ± band of their last one.

    >>> settling_time([0.0, 1.0, 2.0, 3.0], [9.0, 2.0, 2.1, 2.0], 0.2)
    1.0
    """
    times, values = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    outside = np.flatnonzero(~(np.abs(values - values[-1]) <= band))  # NaN counts as outside
    return float(times[min(outside[-1] + 1, len(times) - 1)]) if len(outside) else float(times[0])
