"""phi under a Gaussian prior, given what the rows say of it: the answer of a stream, in bounded time.

With Λ, h what the rows say and phi ~ N(m, R·Rᵀ) before,

    P = R·(1 + Rᵀ·Λ·R)⁻¹·Rᵀ,    phi = m + P·(h − Λ·m),    covariance  c·P + s²·phi·phiᵀ,

c by how much the physics overrates its evidence, s the relative deviation of the torque's scale.
"""

from __future__ import annotations

import numpy as np

from armload.inertia.cholesky import factor, invert
from armload.runtime.kernels import kernel


@kernel
def under_prior(information, vector, mean, root, turned, overrated, gain):  # pragma: no cover - compiled
    """Mean (10,) and covariance (10, 10); `turned` is rootᵀ, `gain` is s²."""
    n, total = 10, 0.0
    phi, out, left = np.empty(n), np.empty((n, n)), np.empty(n)
    work, K, L = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        phi[i], left[i] = mean[i], vector[i]
        total += vector[i]
        for j in range(n):
            total += information[i, j]
            left[i] -= information[i, j] * mean[j]
    if not np.isfinite(total):
        _product(root, turned, out)
        return phi, out
    _product(information, root, work)
    _product(turned, work, K)
    for i in range(n):
        K[i, i] += 1.0
    factor(K, L, 1.0)  # a pivot below 1 is rounding
    invert(L, work, K)
    _product(root, K, work)
    _product(work, turned, K)  # the covariance
    for i in range(n):
        for j in range(n):
            phi[i] += K[i, j] * left[j]
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.5 * overrated * (K[i, j] + K[j, i]) + gain * phi[i] * phi[j]
    return phi, out


@kernel
def _product(A, B, out):  # pragma: no cover - compiled
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            total = 0.0
            for k in range(A.shape[1]):
                total += A[i, k] * B[k, j]
            out[i, j] = total
