"""How well a centre of mass, and the inertia about it, are known where phi ~ N(phi, P).

    r = h / m                              (h = m·r, the first moments)
    I_com = I − (|h|²·1 − h·hᵀ) / m        (parallel-axis theorem)

A quotient of normal variables has no standard deviation. Its interval is Fieller's: all r for which h − r·m is zero
within z standard deviations,

    (h − r·m)² ≤ z²·(P_hh − 2·r·P_hm + r²·P_mm),

which is exact, and finite only where the mass is more than z standard deviations from zero. The inertia's follows to
first order. Source: Fieller, J. R. Statist. Soc. B 16, 1954.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.inertia.determinacy import Z95
from armload.inertia.parameters import inertia_matrix, vech


def com_interval(
    phi: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both ends (3,) of the 95 % intervals of the centre of mass [m]; infinite where the mass may be zero.

    Args:
        phi: (10,). covariance: (10, 10).
    """
    m, h, P = phi[0], phi[1:4], Z95**2 * covariance
    a = m**2 - P[0, 0]
    if not a > 0.0:
        return np.full(3, -np.inf), np.full(3, np.inf)
    b, c = m * h - P[0, 1:4], h**2 - np.diag(P)[1:4]
    root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    return (b - root) / a, (b + root) / a


def inertia_com_std(phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviations (6,) of the inertia about the centre of mass, xx, xy, xz, yy, yz, zz [kg·m²], to first order.

    Args:
        phi: (10,), its mass not 0. covariance: (10, 10).
    """
    r = phi[1:4] / phi[0]
    jacobian = np.zeros((6, 10))
    jacobian[:, 4:] = np.eye(6)
    jacobian[:, 0] = vech(r @ r * np.eye(3) - np.outer(r, r))  # d/dm at fixed h: I_com grows as the offset shrinks
    for k, e in enumerate(np.eye(3)):
        jacobian[:, 1 + k] = -vech(2.0 * r[k] * np.eye(3) - np.outer(e, r) - np.outer(r, e))
    return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian), 0.0))


def largest_inertia_com(highest: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds (3, 3) of the inertia about any centre of mass, from the highest inertia (6,) about the origin [kg·m²].

    A moment about the centre is at least 0 and at most that about the origin; a product is at most half of the moment
    about the third axis, as ∫ 2·|x·y| dm ≤ ∫ (x² + y²) dm.
    """
    xx, _, _, yy, _, zz = np.maximum(highest, 0.0)
    high = inertia_matrix([xx, zz / 2.0, yy / 2.0, yy, xx / 2.0, zz])
    return np.diag(np.diag(high)) - high, high
