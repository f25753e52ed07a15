"""The nearest body, in a bounded time: what a live stream can afford at every answer.

    min ½·(x − phi)ᵀ·P·(x − phi) − ν·ln det J(x),      ν = 0.3 … 1e-4

Newton's method along the central path; at its end x is a body, and (x − phi)ᵀ·P·(x − phi) is at most 8·ν above that of
`nearest_consistent`, which solves the same to the end.

Source: Boyd & Vandenberghe, Convex Optimization, 2004, ch. 11.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from armload.inertia.consistency import is_consistent, nearest_consistent, pseudo_inertia

_BASIS = np.ascontiguousarray(pseudo_inertia(np.eye(10)))  # J is linear in phi
_BARRIERS = np.array([0.3, 1e-2, 1e-4])
_SIZE, _FARTHEST, _LIGHTEST = 0.05, 0.3, 1e-3  # [m], [m], [kg] of the body that the search begins with


def near_consistent(phi: ArrayLike, precision: ArrayLike) -> NDArray[np.float64]:
    """A body (10,) as near to phi (10,) as any within 1e-3 in the metric of `precision` (10, 10); phi if it is one.

    Raises:
        InertiaError: numbers that are not finite.
    """
    phi = np.asarray(phi, dtype=float)
    if is_consistent(phi):
        return phi
    P = np.ascontiguousarray(precision, dtype=float)
    if np.all(np.isfinite(phi)) and np.all(np.isfinite(P)):
        x, converged = _central_path(phi, P, _start(phi), _BARRIERS, _BASIS)
        if converged and np.all(np.isfinite(x)) and is_consistent(x):
            return x
    return nearest_consistent(phi, P)


def _start(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    m = max(float(phi[0]), _LIGHTEST)
    r = phi[1:4] / m
    r = r * min(1.0, _FARTHEST / max(float(np.linalg.norm(r)), 1e-12))
    x, y, z = r
    k = _SIZE**2
    return m * np.array([1.0, x, y, z, y * y + z * z + k, -x * y, -x * z, x * x + z * z + k, -y * z, x * x + y * y + k])


@njit(cache=True, nogil=True)
def _central_path(phi, P, x, barriers, basis):  # pragma: no cover - compiled
    J, inverse = np.empty((4, 4)), np.empty((4, 4))
    M = np.empty((10, 4, 4))
    converged = False
    _pseudo(x, basis, J)
    for nu in barriers:
        for _ in range(25):
            inverse[:] = np.linalg.inv(J)
            g = P @ (x - phi)
            H = P.copy()
            for i in range(10):
                M[i] = inverse @ basis[i]
                g[i] -= nu * (M[i, 0, 0] + M[i, 1, 1] + M[i, 2, 2] + M[i, 3, 3])
            for i in range(10):
                for j in range(i + 1):
                    total = 0.0
                    for a in range(4):
                        for b in range(4):
                            total += M[i, a, b] * M[j, b, a]
                    H[i, j] += nu * total
                    if i != j:
                        H[j, i] += nu * total
            step = -np.linalg.solve(H, g)
            decrease = -(g @ step)
            before = 0.5 * (x - phi) @ P @ (x - phi) - nu * np.log(np.linalg.det(J))
            length = 1.0
            moved = False
            while length > 1e-6:
                new = x + length * step
                _pseudo(new, basis, J)
                if _positive(J):
                    value = 0.5 * (new - phi) @ P @ (new - phi) - nu * np.log(np.linalg.det(J))
                    if value <= before - 0.1 * length * decrease:
                        x, moved = new, True
                        break
                length *= 0.5
            if not moved:
                _pseudo(x, basis, J)
            converged = decrease < 0.05 * nu
            if converged or not moved:
                break
    return x, converged


@njit(cache=True, nogil=True)
def _pseudo(x, basis, J):  # pragma: no cover - compiled
    J[:] = 0.0
    for k in range(10):
        for a in range(4):
            for b in range(4):
                J[a, b] += x[k] * basis[k, a, b]


@njit(cache=True, nogil=True)
def _positive(J):  # pragma: no cover - compiled
    """Whether a 4×4 matrix is positive definite, by its Cholesky factor."""
    L = np.zeros((4, 4))
    for j in range(4):
        for i in range(j, 4):
            total = J[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if total <= 0.0:
                    return False
                L[j, j] = np.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    return True
