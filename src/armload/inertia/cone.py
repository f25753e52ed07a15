"""J(x) ⪰ 0 in compiled loops: symmetric 4×4 matrices, the ten parameters they stand for, and the dual of that map.

x (10,) are the parameters in units in which J has no factors: any unit of length. The functions write into arrays they
are given.
"""

from __future__ import annotations

import numpy as np

from armload.runtime.kernels import kernel

_ROOT2 = float(np.sqrt(2.0))


@kernel
def congruent(G, A, T, out):  # pragma: no cover - compiled
    """out = Gᵀ·A·G, A symmetric."""
    for i in range(4):
        for j in range(4):
            total = 0.0
            for k in range(4):
                total += A[i, k] * G[k, j]
            T[i, j] = total
    for i in range(4):
        for j in range(i, 4):
            total = 0.0
            for k in range(4):
                total += G[k, i] * T[k, j]
            out[i, j] = out[j, i] = total


@kernel
def pseudo(x, J):  # pragma: no cover - compiled
    """J(x) (4, 4)."""
    J[0, 0], J[1, 1], J[2, 2] = 0.5 * (x[7] + x[9] - x[4]), 0.5 * (x[4] + x[9] - x[7]), 0.5 * (x[4] + x[7] - x[9])
    J[0, 1] = J[1, 0] = -x[5]
    J[0, 2] = J[2, 0] = -x[6]
    J[1, 2] = J[2, 1] = -x[8]
    for i in range(3):
        J[i, 3] = J[3, i] = x[1 + i]
    J[3, 3] = x[0]


@kernel
def primal(J, x):  # pragma: no cover - compiled
    """x (10,) of J(x)."""
    x[0], x[1], x[2], x[3] = J[3, 3], J[0, 3], J[1, 3], J[2, 3]
    x[4], x[7], x[9] = J[1, 1] + J[2, 2], J[0, 0] + J[2, 2], J[0, 0] + J[1, 1]
    x[5], x[6], x[8] = -J[0, 1], -J[0, 2], -J[1, 2]


@kernel
def dual(z, Z):  # pragma: no cover - compiled
    """Z (4, 4) with tr(Z·J(x)) = z·x for every x."""
    Z[0, 0], Z[1, 1], Z[2, 2], Z[3, 3] = z[7] + z[9], z[4] + z[9], z[4] + z[7], z[0]
    Z[0, 1] = Z[1, 0] = -0.5 * z[5]
    Z[0, 2] = Z[2, 0] = -0.5 * z[6]
    Z[1, 2] = Z[2, 1] = -0.5 * z[8]
    for i in range(3):
        Z[i, 3] = Z[3, i] = 0.5 * z[1 + i]


@kernel
def of_dual(Z, z):  # pragma: no cover - compiled
    """z (10,) with z·x = tr(Z·J(x)) for every x."""
    trace = Z[0, 0] + Z[1, 1] + Z[2, 2]
    z[0], z[1], z[2], z[3] = Z[3, 3], 2.0 * Z[0, 3], 2.0 * Z[1, 3], 2.0 * Z[2, 3]
    z[4], z[7], z[9] = 0.5 * trace - Z[0, 0], 0.5 * trace - Z[1, 1], 0.5 * trace - Z[2, 2]
    z[5], z[6], z[8] = -2.0 * Z[0, 1], -2.0 * Z[0, 2], -2.0 * Z[1, 2]


@kernel
def pack(A, v):  # pragma: no cover - compiled
    """v (10,) with v·w = tr(A·B) for symmetric A and B."""
    at = 0
    for i in range(4):
        v[at] = A[i, i]
        for j in range(i + 1, 4):
            v[at + j - i] = _ROOT2 * A[i, j]
        at += 4 - i


@kernel
def unpack(v, A):  # pragma: no cover - compiled
    """The symmetric A (4, 4) of `pack`."""
    at = 0
    for i in range(4):
        A[i, i] = v[at]
        for j in range(i + 1, 4):
            A[i, j] = A[j, i] = v[at + j - i] / _ROOT2
        at += 4 - i
