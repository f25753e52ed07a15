"""Which ten numbers belong to a body that can exist.

A body with density ρ(x) ≥ 0 has the pseudo-inertia

    J(phi) = ∫ [x; 1]·[x; 1]ᵀ dm = [[½·tr(I)·1 − I, m·r], [m·rᵀ, m]]  ⪰ 0      (4×4, about the frame's origin)

and every J ≻ 0 belongs to some body (Wensing, Kim, Slotine, RA-L 2018). The log-Cholesky chart maps ten free real
numbers one to one onto J ≻ 0 (Rucker, Wensing, RA-L 2022).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import InertiaError
from armload.inertia.parameters import InertialParameters, inertia_matrix, numbers, vech

# Lengths are divided by this before matrices are compared, so that kg, kg·m and kg·m² weigh alike.
LENGTH = 0.1  # [m]


def pseudo_inertia(phi: ArrayLike) -> NDArray[np.float64]:
    """J(phi), shape (..., 4, 4) [kg·m², kg·m, kg]; linear in phi (..., 10)."""
    phi = numbers(phi, "phi", 10)
    inertia = inertia_matrix(phi[..., 4:])
    trace = np.trace(inertia, axis1=-2, axis2=-1)
    J = np.empty((*phi.shape[:-1], 4, 4))
    J[..., :3, :3] = 0.5 * trace[..., None, None] * np.eye(3) - inertia
    J[..., :3, 3] = J[..., 3, :3] = phi[..., 1:4]
    J[..., 3, 3] = phi[..., 0]
    return J


def pseudo_inertia_to_phi(J: ArrayLike) -> NDArray[np.float64]:
    """phi (..., 10) of a pseudo-inertia (..., 4, 4): I = tr(S)·1 − S with S its upper left block."""
    J = numbers(J, "J", 4, 4)
    S = J[..., :3, :3]
    inertia = np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S
    return np.concatenate([J[..., 3, 3, None], J[..., :3, 3], vech(inertia)], axis=-1)


def is_consistent(phi: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether a body with these parameters can exist: m > 0 and J(phi) ⪰ −tolerance (lengths in units of 0.1 m).

    The tolerance [kg] forgives rounding only: a point mass, which lies on the border, counts as consistent. Numbers
    that are not finite belong to no body.

    Raises:
        InertiaError: phi is not ten numbers.
    """
    phi = _one(phi, "phi")
    if not np.isfinite(phi).all():
        return False
    J = _scaled(pseudo_inertia(phi))
    return bool(J[3, 3] > 0 and np.linalg.eigvalsh(J)[0] >= -tolerance * max(1.0, float(J[3, 3])))


def log_cholesky(phi: ArrayLike) -> NDArray[np.float64]:
    """Log-Cholesky coordinates θ = [α, d1, d2, d3, s12, s23, s13, t1, t2, t3] of consistent phi.

    J = U·Uᵀ, U = e^α·[[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]].

    Raises:
        InertiaError: phi is not ten finite numbers, or not strictly consistent (J is not positive definite).
    """
    J = pseudo_inertia(InertialParameters(numbers(phi, "phi", 10)).phi)
    flip = J[::-1, ::-1]  # J = U·Uᵀ with U upper triangular ⇔ the flipped J has a lower Cholesky factor
    try:
        U = np.linalg.cholesky(flip)[::-1, ::-1]
    except np.linalg.LinAlgError:
        raise InertiaError(
            "these parameters are not strictly physically consistent: project them with nearest_consistent first"
        ) from None
    scale = U[3, 3]
    V = U / scale
    return np.array([np.log(scale), *np.log(np.diag(V)[:3]), V[0, 1], V[1, 2], V[0, 2], V[0, 3], V[1, 3], V[2, 3]])


def from_log_cholesky(theta: ArrayLike) -> NDArray[np.float64]:
    """phi of log-Cholesky coordinates (10,): consistent for every real θ.

    Raises:
        InertiaError: θ is not ten finite numbers.
    """
    U = _root_of_chart(theta)
    return pseudo_inertia_to_phi(U @ U.T)


def log_cholesky_jacobian(theta: ArrayLike) -> NDArray[np.float64]:
    """∂phi/∂θ (10, 10) of `from_log_cholesky`: dJ = dU·Uᵀ + U·dUᵀ, and phi is linear in J. Regular for every real θ."""
    U = _root_of_chart(theta)
    dJ = _root_derivatives(U) @ U.T
    return pseudo_inertia_to_phi(dJ + np.swapaxes(dJ, 1, 2)).T


def log_cholesky_curvature(theta: ArrayLike, weights: ArrayLike) -> NDArray[np.float64]:
    """∂²(weights·phi)/∂θ² (10, 10) of `from_log_cholesky`, weights (10,): what Newton's method needs beside ∂phi/∂θ."""
    U = _root_of_chart(theta)
    dU = _root_derivatives(U)
    entries = pseudo_inertia_to_phi(np.eye(16).reshape(16, 4, 4)) @ _one(weights, "weights")
    G = entries.reshape(4, 4)
    G = 0.5 * (G + G.T)  # weights·phi = tr(G·J)
    curvature = 2.0 * np.einsum("iab,bc,jca->ij", np.swapaxes(dU, 1, 2), G, dU)
    second = 2.0 * np.einsum("kab,ab->k", dU, G @ U)  # of U: α with anything gives dU, a diagonal entry with itself
    curvature[0, :] += second
    curvature[1:, 0] += second[1:]
    curvature[[1, 2, 3], [1, 2, 3]] += second[1:4]
    return curvature


def _root_derivatives(U: NDArray[np.float64]) -> NDArray[np.float64]:
    """∂U/∂θ (10, 4, 4)."""
    dU = np.zeros((10, 4, 4))
    dU[0] = U
    for k in range(3):
        dU[1 + k, k, k] = U[k, k]
    for k, (row, column) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], start=4):
        dU[k, row, column] = U[3, 3]
    return dU


def _root_of_chart(theta: ArrayLike) -> NDArray[np.float64]:
    theta = _one(theta, "theta")
    if not np.isfinite(theta).all():
        raise InertiaError(f"theta is {theta.tolist()}: expected 10 finite numbers")
    alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3 = theta
    return np.exp(alpha) * np.array(
        [[np.exp(d1), s12, s13, t1], [0, np.exp(d2), s23, t2], [0, 0, np.exp(d3), t3], [0, 0, 0, 1]]
    )


def _one(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Ten numbers, not several times ten."""
    out = numbers(values, name, 10)
    if out.ndim > 1:
        raise InertiaError(f"{name} has shape {out.shape}: expected 10 numbers, of one body")
    return out


def _scaled(J: NDArray[np.float64]) -> NDArray[np.float64]:
    units = np.array([1 / LENGTH, 1 / LENGTH, 1 / LENGTH, 1.0])
    return J * np.outer(units, units)
