"""Orthogonal factorisations of small matrices inside compiled loops: what keeps its digits where A·Aᵀ would lose them.

Jacobi's rotations (Golub & Van Loan, Matrix Computations, 2013, ch. 8) and Householder's reflections (ch. 5). The
functions are compiled and write into arrays they are given.
"""

from __future__ import annotations

import numpy as np

from armload.runtime.kernels import kernel

_SWEEPS = 30  # of rotations; a matrix of four rows needs about five
_ROUNDING = 1e-15


@kernel
def _rotation(half_difference, product):  # pragma: no cover - compiled
    """Cosine and sine of the rotation that makes [[a, product], [product, b]] diagonal; half_difference: ½·(b − a)."""
    ratio = abs(half_difference)
    t = product / (ratio + np.sqrt(ratio * ratio + product * product))
    if half_difference < 0.0:
        t = -t
    cosine = 1.0 / np.sqrt(1.0 + t * t)
    return cosine, cosine * t


@kernel
def _rotate(A, p, q, cosine, sine):  # pragma: no cover - compiled
    """Columns p and q of A, rotated."""
    for k in range(A.shape[0]):
        x, y = A[k, p], A[k, q]
        A[k, p] = cosine * x - sine * y
        A[k, q] = sine * x + cosine * y


@kernel
def eigen(A, V, vectors):  # pragma: no cover - compiled
    """The eigenvalues of symmetric A (n, n) are left on its diagonal; its eigenvectors, if wanted, are V (n, n)."""
    n = A.shape[0]
    if vectors:
        for i in range(n):
            for j in range(n):
                V[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        done = True
        for p in range(n - 1):
            for q in range(p + 1, n):
                if abs(A[p, q]) <= _ROUNDING * np.sqrt(abs(A[p, p] * A[q, q])) or A[p, q] == 0.0:
                    continue
                done = False
                cosine, sine = _rotation(0.5 * (A[q, q] - A[p, p]), A[p, q])
                _rotate(A, p, q, cosine, sine)
                for k in range(n):
                    x, y = A[p, k], A[q, k]
                    A[p, k] = cosine * x - sine * y
                    A[q, k] = sine * x + cosine * y
                A[p, q] = A[q, p] = 0.0
                if vectors:
                    _rotate(V, p, q, cosine, sine)
        if done:
            break


@kernel
def singular(A, K):  # pragma: no cover - compiled
    """A becomes A·V with orthogonal columns, as long as its singular values, and K becomes K·V; both (n, n)."""
    n = A.shape[0]
    for _ in range(_SWEEPS):
        done = True
        for p in range(n - 1):
            for q in range(p + 1, n):
                a, b, product = 0.0, 0.0, 0.0
                for k in range(n):
                    a += A[k, p] * A[k, p]
                    b += A[k, q] * A[k, q]
                    product += A[k, p] * A[k, q]
                if abs(product) <= _ROUNDING * np.sqrt(a * b):
                    continue
                done = False
                cosine, sine = _rotation(0.5 * (b - a), product)
                _rotate(A, p, q, cosine, sine)
                _rotate(K, p, q, cosine, sine)
        if done:
            break


@kernel
def reflect(A, diagonal):  # pragma: no cover - compiled
    """Q·R of A = [B; 1] (2n, n): reflectors on and below A's diagonal, R above it and in `diagonal` (n,)."""
    n = A.shape[1]
    for k in range(n):
        end = n + k + 1  # the rows below are those of the unit matrix still
        square = 0.0
        for i in range(k, end):
            square += A[i, k] * A[i, k]
        length = -np.sqrt(square) if A[k, k] > 0.0 else np.sqrt(square)
        first = A[k, k] - length
        scale = 1.0 / np.sqrt(-length * first)
        diagonal[k] = length
        A[k, k] = first * scale
        for i in range(k + 1, end):
            A[i, k] *= scale
        for j in range(k + 1, n):
            total = 0.0
            for i in range(k, end):
                total += A[i, k] * A[i, j]
            for i in range(k, end):
                A[i, j] -= total * A[i, k]


@kernel
def least_squares(A, diagonal, b, x):  # pragma: no cover - compiled
    """x (n,) with the smallest |[B; 1]·x − b|, from what `reflect` made of [B; 1]; b (2n,) is used up."""
    n = A.shape[1]
    for k in range(n):
        total = 0.0
        for i in range(k, n + k + 1):
            total += A[i, k] * b[i]
        for i in range(k, n + k + 1):
            b[i] -= total * A[i, k]
    for i in range(n - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, n):
            total -= A[i, k] * x[k]
        x[i] = total / diagonal[i]
