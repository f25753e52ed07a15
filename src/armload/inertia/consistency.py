"""Which ten numbers belong to a body that can exist, and the nearest such numbers.

A body with density ρ(x) ≥ 0 has the pseudo-inertia

    J(phi) = ∫ [x; 1]·[x; 1]ᵀ dm = [[½·tr(I)·1 − I, m·r], [m·rᵀ, m]]  ⪰ 0      (4×4, about the frame's origin)

and every J ≻ 0 belongs to some body (Wensing, Kim, Slotine, RA-L 2018). The log-Cholesky chart maps ten free real
numbers one to one onto J ≻ 0 (Rucker, Wensing, RA-L 2022).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import InertiaError
from armload.inertia.parameters import InertialParameters, inertia_matrix, vech

# Lengths are divided by this before matrices are compared or projected, so that kg, kg·m and kg·m² weigh alike.
_LENGTH = 0.1  # [m]
# phi of the body whose J, lengths in units of _LENGTH, is the 4×4 identity
_BALL = np.array([1.0, 0.0, 0.0, 0.0, *(2 * _LENGTH**2 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]))])

_ANSWER = 1e-5  # [kg] smallest eigenvalue of an answer's J, lengths in units of 0.1 m


def pseudo_inertia(phi: ArrayLike) -> NDArray[np.float64]:
    """J(phi), shape (..., 4, 4) [kg·m², kg·m, kg]; linear in phi (..., 10)."""
    phi = np.asarray(phi, dtype=float)
    inertia = inertia_matrix(phi[..., 4:])
    trace = np.trace(inertia, axis1=-2, axis2=-1)
    J = np.empty((*phi.shape[:-1], 4, 4))
    J[..., :3, :3] = 0.5 * trace[..., None, None] * np.eye(3) - inertia
    J[..., :3, 3] = J[..., 3, :3] = phi[..., 1:4]
    J[..., 3, 3] = phi[..., 0]
    return J


def pseudo_inertia_to_phi(J: ArrayLike) -> NDArray[np.float64]:
    """phi (..., 10) of a pseudo-inertia (..., 4, 4): I = tr(S)·1 − S with S its upper left block."""
    J = np.asarray(J, dtype=float)
    S = J[..., :3, :3]
    inertia = np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S
    return np.concatenate([J[..., 3, 3, None], J[..., :3, 3], vech(inertia)], axis=-1)


def is_consistent(phi: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether a body with these parameters can exist: m > 0 and J(phi) ⪰ −tolerance (lengths in units of 0.1 m).

    The tolerance [kg] forgives rounding only: a point mass, which lies on the border, counts as consistent.
    """
    J = _scaled(pseudo_inertia(phi))
    return bool(J[3, 3] > 0 and np.linalg.eigvalsh(J)[0] >= -tolerance * max(1.0, float(J[3, 3])))


def nearest_body(phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """An answer (10,): phi where a body can have it, else the nearest that one can, in the metric of phi's covariance.

    It stays far enough inside to survive being printed.
    """
    if is_consistent(phi):
        return phi.copy()
    return nearest_consistent(phi, np.linalg.inv(covariance), margin=_ANSWER)


def distance_to_body(phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Standard deviations between an estimate phi (10,) and the nearest body, in the metric of phi's covariance.

    Bodies are a convex cone: where the truth is one and phi ~ N(truth, covariance), the square is at most that of the
    distance to the truth, a chi-square of ten degrees of freedom.
    """
    away = nearest_body(phi, covariance) - phi
    return float(np.sqrt(away @ np.linalg.solve(covariance, away))) if away.any() else 0.0


def nearest_consistent(phi: ArrayLike, information: ArrayLike | None = None, margin: float = 1e-6) -> NDArray:
    """The physically consistent parameters nearest to phi: argmin (x − phi)ᵀ·Λ·(x − phi) subject to J(x) ⪰ margin.

    Solved as a semidefinite program with Clarabel (the LMI of Sousa & Cortesão, IJRR 2014, with Wensing's J).

    Args:
        phi: the ten numbers to project.
        information: Λ (10, 10), symmetric positive semidefinite, usually the inverse covariance of phi. Default: units
            of kg, 0.1 kg·m and 0.01 kg·m².
        margin: smallest eigenvalue of J allowed, lengths in units of 0.1 m [kg].

    Raises:
        InertiaError: phi is not ten finite numbers, or the solver found no answer.
    """
    import clarabel
    from scipy import sparse

    phi = InertialParameters(np.asarray(phi, dtype=float)).phi  # ten finite numbers, or a sentence
    if np.linalg.eigvalsh(_scaled(pseudo_inertia(phi)))[0] >= 0.99 * margin:  # what the solver returns passes too
        return phi.copy()
    scale = _column_scale()
    weight = np.eye(10) if information is None else np.asarray(information, dtype=float) / np.outer(scale, scale)
    weight = 0.5 * (weight + weight.T) / max(np.abs(weight).max(), 1e-300) + 1e-12 * np.eye(10)
    target = phi * scale
    size = np.abs(target).max() + margin
    svec, order = _svec_of_basis()
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    # solved for (x − phi) / size: numbers near 1 around 0, where the solver's relative tolerances mean most
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(weight)),
        np.zeros(10),
        sparse.csc_matrix(-svec),
        (svec @ target - margin * _svec_identity(order)) / size,
        [clarabel.PSDTriangleConeT(4)],
        settings,
    )
    solution = solver.solve()
    x = (target + size * np.asarray(solution.x)) / scale
    if "Solved" not in str(solution.status) or not np.all(np.isfinite(x)):
        raise InertiaError(f"no consistent parameters found near {phi.tolist()} (solver: {solution.status})")
    missing = margin - np.linalg.eigvalsh(_scaled(pseudo_inertia(x)))[0]
    if missing > 0:  # rounding of the solver: a small ball at the origin makes up for it
        x = x + missing * _BALL
    return x


def log_cholesky(phi: ArrayLike) -> NDArray[np.float64]:
    """Log-Cholesky coordinates θ = [α, d1, d2, d3, s12, s23, s13, t1, t2, t3] of consistent phi.

    J = U·Uᵀ, U = e^α·[[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]].

    Raises:
        InertiaError: phi is not strictly consistent (J is not positive definite).
    """
    J = pseudo_inertia(phi)
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
    """phi of log-Cholesky coordinates (10,): consistent for every real θ."""
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
    entries = pseudo_inertia_to_phi(np.eye(16).reshape(16, 4, 4)) @ np.asarray(weights, dtype=float)
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
    alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3 = np.asarray(theta, dtype=float)
    return np.exp(alpha) * np.array(
        [[np.exp(d1), s12, s13, t1], [0, np.exp(d2), s23, t2], [0, 0, np.exp(d3), t3], [0, 0, 0, 1]]
    )


def _scaled(J: NDArray[np.float64]) -> NDArray[np.float64]:
    units = np.array([1 / _LENGTH, 1 / _LENGTH, 1 / _LENGTH, 1.0])
    return J * np.outer(units, units)


def _column_scale() -> NDArray[np.float64]:
    return np.array([1.0] + [1 / _LENGTH] * 3 + [1 / _LENGTH**2] * 6)


@cache
def _svec_of_basis() -> tuple[NDArray[np.float64], tuple[tuple[int, int], ...]]:
    """svec(J) as a linear map (10, 10) of the scaled parameters; Clarabel stacks the upper triangle by columns."""
    order = tuple((i, j) for j in range(4) for i in range(j + 1))
    basis = pseudo_inertia(np.eye(10))  # scale-free: the scaled parameters are those of lengths in units of 0.1 m
    svec = np.array([[basis[k, i, j] * (1 if i == j else np.sqrt(2)) for k in range(10)] for i, j in order])
    return svec, order


def _svec_identity(order: tuple[tuple[int, int], ...]) -> NDArray[np.float64]:
    """svec of the 4×4 identity in the given order of entries."""
    return np.array([1.0 if i == j else 0.0 for i, j in order])
