"""The 95 % intervals of an answer: of phi, of the centre of mass, and of the inertia about it. One rule, log or stream.

What the data do not determine keeps the interval of what was known before. Everything else follows from one Gaussian
over phi: its standard deviations are the half-widths of the intervals of phi over 1.96, its correlations those of the
posterior.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.identification.thresholds import FARTHEST
from armload.inertia import Z95, com_interval, inertia_com_std, inertia_matrix, largest_inertia_com, phi_to_com


class Before(NamedTuple):
    """What was known of the payload before the data: mean and standard deviation (10,)."""

    mean: NDArray[np.float64]
    std: NDArray[np.float64]


class Intervals(NamedTuple):
    """Both ends of every interval: phi (10,), com (3,) [m], inertia_com (3, 3) [kg·m²]; and the covariance (10, 10)."""

    phi_low: NDArray[np.float64]
    phi_high: NDArray[np.float64]
    com_low: NDArray[np.float64]
    com_high: NDArray[np.float64]
    inertia_com_low: NDArray[np.float64]
    inertia_com_high: NDArray[np.float64]
    covariance: NDArray[np.float64]


def about_com(phi: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """(mass, com, inertia_com) of phi; of a mass of exactly 0 the centre is the origin, so that numbers are finite."""
    return phi_to_com(phi) if phi[0] != 0.0 else (0.0, np.zeros(3), inertia_matrix(phi[4:]))


def phi_interval(
    phi: NDArray[np.float64],
    around: NDArray[np.float64],
    std: NDArray[np.float64],
    determined: NDArray[np.bool_],
    before: Before,
    otherwise: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both ends (10,) of the intervals of phi, each stretched to phi itself.

    Args:
        phi: the answer, a body. around, std: the posterior's mean and standard deviation, before a body was made of it.
        determined: which parameters the data determine; the others keep the interval of `before`.
        otherwise: how far off the truth may be beyond the error bars.
    """
    half, half_before = Z95 * std, Z95 * before.std
    reach = np.minimum(half, half_before)  # wider than what was known before is of no use to anyone
    low = np.where(determined, around - half, np.minimum(before.mean - half_before, around - reach))
    high = np.where(determined, around + half, np.maximum(before.mean + half_before, around + reach))
    if otherwise is not None:
        low, high = np.minimum(low, low + otherwise), np.maximum(high, high + otherwise)
    return np.minimum(low, phi), np.maximum(high, phi)


def intervals(
    phi: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    covariance: NDArray[np.float64],
    otherwise: NDArray[np.float64] | None = None,
) -> Intervals:
    """All intervals that follow from those of phi and the posterior's covariance; finite wherever those are.

    Where the mass may be zero, so that there may be no centre of mass at all, the centre's interval is a stated bound
    (`FARTHEST`), and the inertia's what a body allows.
    """
    spread = covariance if otherwise is None else covariance + np.outer(otherwise, otherwise) / (2.0 * Z95) ** 2
    P = _with_std(spread, 0.5 * (high - low) / Z95)
    centre, (_, com, inertia) = 0.5 * (low + high), about_com(phi)
    com_low, com_high = com_interval(centre, P)
    com_low, com_high = np.maximum(com_low, -FARTHEST), np.minimum(com_high, FARTHEST)
    if low[0] * high[0] > 0.0:
        half = Z95 * inertia_matrix(inertia_com_std(centre, P))
        about = phi_to_com(centre)[2]
        inertia_low, inertia_high = about - half, about + half
        if low[0] > 0.0:  # no body has a negative moment
            np.fill_diagonal(inertia_low, np.maximum(np.diag(inertia_low), 0.0))
    else:
        inertia_low, inertia_high = largest_inertia_com(high[4:])
    return Intervals(
        low,
        high,
        np.minimum(com_low, com),
        np.maximum(com_high, com),
        np.minimum(inertia_low, inertia),
        np.maximum(inertia_high, inertia),
        P,
    )


def _with_std(covariance: NDArray[np.float64], std: NDArray[np.float64]) -> NDArray[np.float64]:
    """A covariance (10, 10) of the same correlations, and of these standard deviations (10,)."""
    own = np.sqrt(np.diag(covariance))
    known = np.isfinite(own) & (own > 0.0)
    scale = np.where(known, 1.0 / np.where(known, own, 1.0), 0.0)
    correlation = np.where(np.outer(known, known), covariance, 0.0) * np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)
    return correlation * np.outer(std, std)
