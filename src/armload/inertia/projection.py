"""The nearest body, in a bounded time: what a live stream can afford at every answer.

    min ½·(x − phi)ᵀ·P·(x − phi) − ν·ln det J(x),      ν = 0.3 … 1e-4

Newton's method along the central path; at its end x is a body, and (x − phi)ᵀ·P·(x − phi) is at most 8·ν above that of
`nearest_consistent`, which solves the same by Clarabel in fifteen times the time. That one stays because the worlds of
a seed hang on its last digits: at its default tolerance Clarabel stops short of the optimum, by 2.5e-4 standard
deviations (median, at most 0.01) for answers of `identify`.

Source: Boyd & Vandenberghe, Convex Optimization, 2004, ch. 11.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from armload.inertia.cholesky import factor, invert, solve
from armload.inertia.consistency import nearest_consistent, pseudo_inertia

_BASIS = np.ascontiguousarray(pseudo_inertia(np.eye(10)))  # J is linear in phi
_LENGTH, _TOLERANCE = 0.1, 1e-9  # [m] and [kg] of `is_consistent`
_BARRIERS = np.array([0.3, 1e-2, 1e-4])
_SIZE, _FARTHEST, _LIGHTEST = 0.05, 0.3, 1e-3  # [m], [m], [kg] of the body that the search begins with


def near_consistent(phi: ArrayLike, precision: ArrayLike) -> NDArray[np.float64]:
    """A body (10,) as near to phi (10,) as any within 1e-3 in the metric of `precision` (10, 10); phi if it is one.

    Raises:
        InertiaError: numbers that are not finite.
    """
    phi = np.ascontiguousarray(phi, dtype=float)
    P = np.ascontiguousarray(precision, dtype=float)
    x, found = _near(phi, P, _BARRIERS, _BASIS)
    return x if found else nearest_consistent(phi, P)


@njit(cache=True, nogil=True)
def _near(phi, P, barriers, basis):  # pragma: no cover - compiled
    """phi, if it is a body, or the end of the central path; and whether that is anything."""
    if not np.isfinite(phi.sum() + P.sum()):
        return phi, False
    if _is_body(phi, basis):
        return phi, True
    x, converged = _central_path(phi, P, _start(phi), barriers, basis)
    return x, converged and np.isfinite(x.sum())


@njit(cache=True, nogil=True)
def _start(phi):  # pragma: no cover - compiled
    m = max(phi[0], _LIGHTEST)
    far = np.sqrt(phi[1] * phi[1] + phi[2] * phi[2] + phi[3] * phi[3]) / m
    shrink = min(1.0, _FARTHEST / max(far, 1e-12)) / m
    x, y, z = phi[1] * shrink, phi[2] * shrink, phi[3] * shrink
    k = _SIZE**2
    return m * np.array([1.0, x, y, z, y * y + z * z + k, -x * y, -x * z, x * x + z * z + k, -y * z, x * x + y * y + k])


@njit(cache=True, nogil=True)
def _is_body(phi, basis):  # pragma: no cover - compiled
    """What `is_consistent` says, its tolerance included."""
    J = np.empty((4, 4))
    _pseudo(phi, basis, J)
    for k in range(4):
        J[k, k] += _TOLERANCE * max(1.0, phi[0]) * (1.0 if k == 3 else _LENGTH**2)
    return phi[0] > 0.0 and factor(J, np.empty((4, 4)))


@njit(cache=True, nogil=True)
def _central_path(phi, P, x, barriers, basis):  # pragma: no cover - compiled
    J, L, inverse, work = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    M, H, root = np.empty((10, 4, 4)), np.empty((10, 10)), np.empty((10, 10))
    g, step, new, pull = np.empty(10), np.empty(10), np.empty(10), np.empty(10)
    converged = False
    for nu in barriers:
        for _ in range(60):
            _pseudo(x, basis, J)
            if not factor(J, L):
                return x, False
            invert(L, work, inverse)
            before = _value(x, phi, P, L, nu, g)
            for i in range(10):
                for a in range(4):
                    for b in range(4):
                        total = 0.0
                        for k in range(4):
                            total += inverse[a, k] * basis[i, k, b]
                        M[i, a, b] = total
                g[i] -= nu * (M[i, 0, 0] + M[i, 1, 1] + M[i, 2, 2] + M[i, 3, 3])
            for i in range(10):
                for j in range(i + 1):
                    total = 0.0
                    for a in range(4):
                        for b in range(4):
                            total += M[i, a, b] * M[j, b, a]
                    H[i, j] = P[i, j] + nu * total
            if not factor(H, root):
                return x, False
            solve(root, g, step)  # against the direction of the step
            decrease = 0.0
            for i in range(10):
                decrease += g[i] * step[i]
            length, moved = 1.0, False
            while length > 1e-6:
                for i in range(10):
                    new[i] = x[i] - length * step[i]
                _pseudo(new, basis, J)
                if factor(J, L) and _value(new, phi, P, L, nu, pull) <= before - 0.1 * length * decrease:
                    x[:] = new
                    moved = True
                    break
                length *= 0.5
            converged = decrease < (0.05 if nu == barriers[-1] else 1.0) * nu
            if converged or not moved:
                break
    return x, converged


@njit(cache=True, nogil=True)
def _value(x, phi, P, L, nu, pull):  # pragma: no cover - compiled
    """½·(x − phi)ᵀ·P·(x − phi) − ν·ln det J, J = L·Lᵀ, and P·(x − phi)."""
    total = 0.0
    for i in range(10):
        Pd = 0.0
        for k in range(10):
            Pd += P[i, k] * (x[k] - phi[k])
        pull[i] = Pd
        total += 0.5 * (x[i] - phi[i]) * Pd
    for a in range(4):
        total -= 2.0 * nu * np.log(L[a, a])
    return total


@njit(cache=True, nogil=True)
def _pseudo(x, basis, J):  # pragma: no cover - compiled
    J[:] = 0.0
    for k in range(10):
        for a in range(4):
            for b in range(4):
                J[a, b] += x[k] * basis[k, a, b]
