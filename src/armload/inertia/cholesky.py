"""Small positive definite systems inside compiled loops, where a call of LAPACK costs more than the arithmetic.

    A = L·Lᵀ

The functions are compiled and write into arrays they are given; sizes are those of the arrays. They read the lower
triangle of A only.
"""

from __future__ import annotations

import numpy as np

from armload.runtime.kernels import kernel


@kernel
def factor(A, L, floor):  # pragma: no cover - compiled
    """L (n, n), its lower triangle, of A (n, n); False where a pivot is not positive.

    With a floor > 0 a smaller pivot is taken to be the floor.
    """
    n = A.shape[0]
    for j in range(n):
        for i in range(j, n):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total > floor:
                L[j, j] = np.sqrt(total)
            elif floor > 0.0:
                L[j, j] = np.sqrt(floor)
            else:  # not a number, too
                return False
    return True


@kernel
def root(A, F, order, floor):  # pragma: no cover - compiled
    """F (n, n) with FᵀF = A (n, n), by the largest pivot first; the size of what is left of A where pivots end.

    Diagonal entries, and pivots relative to them, below `floor` count as rounding and are taken to be the floor, so
    that F is regular and a singular A has no noise for its null space. F[:, order] is upper triangular. Relative to
    its diagonal, what is left of a positive semidefinite A is of the size of the floor; more says that A is not.
    """
    n = A.shape[0]
    largest = 0.0
    for i in range(n):
        largest = max(largest, A[i, i])
    unit, S = np.empty(n), np.empty((n, n))
    for i in range(n):
        unit[i] = np.sqrt(max(A[i, i], floor * largest))
        order[i] = i
    for i in range(n):
        for j in range(n):
            S[i, j] = 0.5 * (A[i, j] + A[j, i]) / (unit[i] * unit[j])
            F[i, j] = 0.0
        if A[i, i] > -floor * largest:
            S[i, i] = 1.0
    left = 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if S[order[i], order[i]] > S[order[best], order[best]]:
                best = i
        order[k], order[best] = order[best], order[k]
        p = order[k]
        if S[p, p] <= floor:
            for i in range(k, n):
                for j in range(k, n):
                    left = max(left, abs(S[order[i], order[j]]))
                F[i, order[i]] = np.sqrt(floor) * unit[order[i]]
            break
        pivot = np.sqrt(S[p, p])
        F[k, p] = pivot * unit[p]
        for i in range(k + 1, n):
            F[k, order[i]] = S[p, order[i]] / pivot
        for i in range(k + 1, n):
            for j in range(k + 1, i + 1):
                S[order[i], order[j]] -= F[k, order[i]] * F[k, order[j]]
                S[order[j], order[i]] = S[order[i], order[j]]
        for i in range(k + 1, n):
            F[k, order[i]] *= unit[order[i]]
    return left


@kernel
def solve(L, b, x):  # pragma: no cover - compiled
    """x (n,) with L·Lᵀ·x = b (n,); x may be b."""
    n = L.shape[0]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= L[k, i] * x[k]
        x[i] = total / L[i, i]


@kernel
def invert(L, work, out):  # pragma: no cover - compiled
    """out (n, n) = (L·Lᵀ)⁻¹; work (n, n) becomes L⁻¹, its lower triangle."""
    n = L.shape[0]
    for j in range(n):
        work[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= L[i, k] * work[k, j]
            work[i, j] = total / L[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):
                total += work[k, i] * work[k, j]
            out[i, j] = total
            out[j, i] = total


@kernel
def inverse(A):  # pragma: no cover - compiled
    """A⁻¹ (n, n); nan where A is not positive definite."""
    L, work, out = np.empty(A.shape), np.empty(A.shape), np.empty(A.shape)
    if factor(A, L, 0.0):
        invert(L, work, out)
        return out
    for i in range(A.shape[0]):
        for j in range(A.shape[0]):
            out[i, j] = np.nan
    return out
