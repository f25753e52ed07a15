"""The MAP posterior row by row: what the logs say of phi after every row, at the scales found last.

With the scales of `posterior` given, the model r = W·phi + Z·s + G_j·g_j + e is linear and Gaussian, and conditioning
on one row at a time is exact:

    g_j | phi, s ~ N(own_j − slope_j·[phi s], C_j)        s | phi ~ N(own − slope·phi, C)        p(rows | phi) ∝ N(Λ, h)

A row (x, y) of joint j, of unit variance, is first freed of g_j, then of s:

    c = C_j·x_g,  v = 1 + x_g·c,   u = x_z − slope_jᵀ·x_g,   e = y − own_j·x_g
        own_j += c·e/v,  slope_j += c·uᵀ/v,  C_j −= c·cᵀ/v
    c = C·u_s,    v' = v + u_s·c,  w = u_phi − slopeᵀ·u_s,   e' = e − own·u_s
        likewise;  Λ += w·wᵀ/v',  h += w·e'/v'

One row of one joint costs R² + R·(10 + p) multiplications, a posterior from the accumulated information a thousand
times as many: so the answer is always new, and only the scales wait for the next solution.

Source: recursive least squares by conditioning, Anderson & Moore 1979, ch. 5.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.regression.rows import Row
from armload.runtime.kernels import kernel


@dataclass(eq=False)
class SequentialPosterior:
    """The state of the recursion; `take` changes it in place.

    C (n, R, R), own (n, R), slope (n, R, 10 + m): of the joints' own weights. shared_C (m, m), shared_own (m,),
    shared_slope (m, 10): of what the joints share, s = [tares' payloads, eta]. Of C and shared_C only the lower
    triangles count: half of what a row reads and writes. information Λ (10, 10), vector h (10,).
    noise: S (n,) [N²·m²·s]. tares: payloads of runs before this one, which the rows carry too: 0 or 1. drifts: how many
    unknowns of eta, the first ones, have a deviation of this session, which follows eta in s.
    order, active: a joint sees no friction but its own and no link before it, so that half of the columns of its slope
    are zero and stay so. `slope` is kept with those that are not in front: column k is that of z[order[j, k]], and from
    active[j] on all is zero. It is given in the order of z.
    seen: (n, 12) of each joint's last row, given all before: w (10,), e' and v', so that e' ~ N(w·phi, v').
    scale: (n,) what the last row was multiplied by.
    """

    C: NDArray[np.float64]
    own: NDArray[np.float64]
    slope: NDArray[np.float64]
    shared_C: NDArray[np.float64]
    shared_own: NDArray[np.float64]
    shared_slope: NDArray[np.float64]
    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    noise: NDArray[np.float64]
    tares: int
    drifts: int
    seen: NDArray[np.float64] = field(init=False)
    scale: NDArray[np.float64] = field(init=False)
    order: NDArray[np.int64] = field(init=False)
    active: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.seen, self.scale = np.zeros((len(self.C), 12)), np.zeros(len(self.C))
        known = (self.slope != 0.0).any(axis=1)
        self.order, self.active = np.argsort(~known, axis=1, kind="stable"), known.sum(axis=1)
        self.slope = np.ascontiguousarray(np.take_along_axis(self.slope, self.order[:, None], axis=2))

    def take(self, row: Row) -> None:
        """Condition on one row of each joint."""
        self.scale = np.sqrt(row.h * row.weights / self.noise)
        if row.h > 0.0:
            self._condition(row, self.scale, self.seen, True)

    def predict(self, row: Row) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """`seen` (n, 12) and `scale` (n,) of a row as `take` would leave them; the row is not conditioned on.

        Its joints are then not conditioned on each other.
        """
        scale, seen = np.sqrt(row.h * row.weights / self.noise), np.zeros_like(self.seen)
        self._condition(row, scale, seen, False)
        return seen, scale

    def _condition(self, row: Row, scale: NDArray, seen: NDArray, condition: bool) -> None:
        own = (self.C, self.own, self.slope, self.order, self.active)
        shared = (self.shared_C, self.shared_own, self.shared_slope)
        found = (self.information, self.vector, seen)
        _condition(row.X, row.r, scale, self.tares, self.drifts, *own, *shared, *found, condition)

    def copy(self) -> Self:
        """Another one in the same state."""
        return deepcopy(self)


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _product(lower, x, c):  # pragma: no cover - compiled
    """c = C·x from the lower triangle of a symmetric C."""
    for i in range(x.shape[0]):
        total, row, xi = 0.0, lower[i], x[i]
        for k in range(i):
            total += row[k] * x[k]
            c[k] += row[k] * xi
        c[i] = total + row[i] * xi


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _condition(
    X, r, scale, tares, drifts, C, own, slope, order, active,
    shared_C, shared_own, shared_slope, information, vector, seen, condition
):  # fmt: skip  # pragma: no cover - compiled
    """Each joint's row freed of its own weights, then of what the joints share; the state changes if `condition`."""
    n, R, Z = C.shape[0], C.shape[1], slope.shape[2]
    m = Z - 10
    known = X.shape[1] - R  # 10 + p
    x, z, some, c = np.empty(R), np.empty(Z), np.empty(Z), np.empty(max(R, m))
    w = np.empty(10)
    for j in range(n):
        a = scale[j]
        for k in range(10):
            z[k] = a * X[j, k]
            for i in range(tares):
                z[10 * (i + 1) + k] = z[k]
        for k in range(10, known):
            z[10 * tares + k] = a * X[j, k]
        for k in range(drifts):
            z[10 * tares + known + k] = a * X[j, 10 + k]
        for k in range(10 * tares + known + drifts, Z):
            z[k] = 0.0  # of other sessions
        e, v = a * r[j], 1.0
        for i in range(R):
            x[i] = a * X[j, known + i]
        _product(C[j], x, c)
        for i in range(R):
            v += x[i] * c[i]
            e -= own[j, i] * x[i]
        many, at = active[j], order[j]
        for k in range(many, Z):  # a column that has been zero so far
            if z[at[k]] != 0.0:
                at[k], at[many] = at[many], at[k]
                many += 1
        active[j] = many
        for k in range(many):
            some[k] = z[at[k]]
        for i in range(R):
            xi, row = x[i], slope[j, i]
            for k in range(many):
                some[k] -= row[k] * xi
        for k in range(many):
            z[at[k]] = some[k]
        if condition:
            for i in range(R):
                g = c[i] / v
                own[j, i] += g * e
                row = slope[j, i]
                for k in range(many):
                    row[k] += g * some[k]
                row = C[j, i]
                for k in range(i + 1):
                    row[k] -= g * c[k]
        _product(shared_C, z[10:], c)
        for k in range(10):
            w[k] = z[k]
        for i in range(m):
            u = z[10 + i]
            v += u * c[i]
            e -= shared_own[i] * u
            for k in range(10):
                w[k] -= shared_slope[i, k] * u
        seen[j, 10], seen[j, 11] = e, v
        for k in range(10):
            seen[j, k] = w[k]
        if condition:
            for i in range(m):
                g = c[i] / v
                shared_own[i] += g * e
                for k in range(10):
                    shared_slope[i, k] += g * w[k]
                row = shared_C[i]
                for k in range(i + 1):
                    row[k] -= g * c[k]
            for i in range(10):
                vector[i] += w[i] * e / v
                for k in range(10):
                    information[i, k] += w[i] * w[k] / v
