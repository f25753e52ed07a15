"""The MAP posterior row by row: what the logs say of phi after every row, at the scales found last.

With the scales of `posterior` given, the model r = W·phi + Z·s + G_j·g_j + e is linear and Gaussian, and conditioning
on one row at a time is exact:

    g_j | phi, s ~ N(own_j − slope_j·[phi s], C_j)        s | phi ~ N(own − slope·phi, C)        p(rows | phi) ∝ N(Λ, h)

A row (x, y) of joint j, of unit variance, is first freed of g_j, then of s:

    c = C_j·x_g,  v = 1 + x_g·c,   u = x_z − slope_jᵀ·x_g,   e = y − own_j·x_g
        own_j += c·e/v,  slope_j += c·uᵀ/v,  C_j −= c·cᵀ/v
    c = C·u_s,    v' = v + u_s·c,  w = u_phi − slopeᵀ·u_s,   e' = e − own·u_s
        likewise;  Λ += w·wᵀ/v',  h += w·e'/v'

C_j and slope_j are changed for some rows at once; until then c and u of these rows are taken into account:

    C_j·x_g − Σ c·(c·x_g)/v,    slope_jᵀ·x_g + Σ u·(c·x_g)/v

One row of one joint costs R² + R·(10 + p) multiplications, a posterior from the accumulated information a thousand
times as many: so the answer is always new, and only the scales wait for the next solution.

C_j, slope_j, c and u are of single precision, half of the memory that a row has to pass. Nothing cancels there, as a
row says little beside its noise (v is hardly above 1), and each solution begins them anew: what rounding leaves is less
than a millionth of Λ (test_a_posterior_that_takes_rows_is_the_posterior_of_all_of_them).

Source: recursive least squares by conditioning, Anderson & Moore 1979, ch. 5.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.regression.rows import Row
from armload.runtime.kernels import kernel

# [rows] whose changes of C and slope, half a megabyte, are made at once: to read and write it costs more than the
# products. A multiple of 4 (`_add`); changes no answer by more than rounding
_LATE = 8


@dataclass(eq=False)
class SequentialPosterior:
    """The state of the recursion; `take` changes it in place.

    C (n, R, R), own (n, R), slope (n, R, 10 + m): of the joints' own weights; C and slope are made single. shared_C
    (m, m), shared_own (m,), shared_slope (m, 10): of what the joints share, s = [tares' payloads, eta]. Of C and
    shared_C only the lower triangles are kept: half of what a row reads and writes. information Λ (10, 10), vector h
    (10,).
    noise: S (n,) [N²·m²·s]. tares: payloads of runs before this one, which the rows carry too: 0 or 1. drifts: how many
    unknowns of eta, the first ones, have a deviation of this session, which follows eta in s.
    order, active: a joint sees no friction but its own and no link before it, so that half of the columns of its slope
    are zero and stay so. `slope` is kept with those that are not in front: column k is that of z[order[j, k]], and from
    active[j] on all is zero. It is given in the order of z.
    late (n, K, R + 10 + m), waiting (1,): c/√v and u/√v of the last rows, as many as wait: C and slope lack them.
    seen: (n, 12) of each joint's last row, given all before: w (10,), e' and v', so that e' ~ N(w·phi, v').
    scale: (n,) what the last row was multiplied by.
    """

    C: NDArray[np.floating]
    own: NDArray[np.float64]
    slope: NDArray[np.floating]
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
    late: NDArray[np.float32] = field(init=False)
    waiting: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.seen, self.scale = np.zeros((len(self.C), 12)), np.zeros(len(self.C))
        known = (self.slope != 0.0).any(axis=1)
        self.order, self.active = np.argsort(~known, axis=1, kind="stable"), known.sum(axis=1)
        n, R, Z = self.slope.shape
        self.late, self.waiting = np.zeros((n, _LATE, R + Z), np.float32), np.zeros(1, dtype=np.int64)
        self.slope = np.ascontiguousarray(np.take_along_axis(self.slope, self.order[:, None], axis=2), np.float32)
        self.C, self.shared_C = np.tril(self.C).astype(np.float32), np.tril(self.shared_C)

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

    def mass_in_all(self, phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> tuple[float, float]:
        """Mass of all that is mounted, at the tare and since [kg], and its variance, if rows say phi ± covariance."""
        if not self.tares:
            return float(phi[0]), float(covariance[0, 0])
        share = np.eye(10)[0] - self.shared_slope[0]
        return float(share @ phi + self.shared_own[0]), float(share @ covariance @ share + self.shared_C[0, 0])

    def _condition(self, row: Row, scale: NDArray, seen: NDArray, condition: bool) -> None:
        own = (self.C, self.own, self.slope, self.order, self.active, self.late, self.waiting)
        shared = (self.shared_C, self.shared_own, self.shared_slope)
        found = (self.information, self.vector, seen)
        _condition(row.X, row.r, scale, self.tares, self.drifts, *own, *shared, *found, condition)

    def copy(self) -> Self:
        """Another one in the same state."""
        return deepcopy(self)


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _product(lower, x, c):  # pragma: no cover - compiled
    """c = C·x from the lower triangle of a symmetric C, four rows at once as far as they go."""
    R, zero = x.shape[0], x.dtype.type(0)
    whole = R - R % 4
    for i in range(0, whole, 4):
        p, q, s, t = lower[i], lower[i + 1], lower[i + 2], lower[i + 3]
        xp, xq, xs, xt = x[i], x[i + 1], x[i + 2], x[i + 3]
        cp = cq = cs = ct = zero
        for k in range(i):
            cp += p[k] * x[k]
            cq += q[k] * x[k]
            cs += s[k] * x[k]
            ct += t[k] * x[k]
            c[k] += p[k] * xp + q[k] * xq + s[k] * xs + t[k] * xt
        c[i], c[i + 1], c[i + 2], c[i + 3] = cp, cq, cs, ct
        for a in range(i, i + 4):
            for k in range(i, a):
                c[a] += lower[a, k] * x[k]
                c[k] += lower[a, k] * x[a]
            c[a] += lower[a, a] * x[a]
    for i in range(whole, R):
        total = zero
        for k in range(i):
            total += lower[i, k] * x[k]
            c[k] += lower[i, k] * x[i]
        c[i] = total + lower[i, i] * x[i]


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _take_off(slope, x, some, many):  # pragma: no cover - compiled
    """some −= slopeᵀ·x, its first entries, four rows at once as far as they go."""
    R = x.shape[0]
    whole = R - R % 4
    for i in range(0, whole, 4):
        p, q, s, t = slope[i], slope[i + 1], slope[i + 2], slope[i + 3]
        xp, xq, xs, xt = x[i], x[i + 1], x[i + 2], x[i + 3]
        for k in range(many):
            some[k] -= p[k] * xp + q[k] * xq + s[k] * xs + t[k] * xt
    for i in range(whole, R):
        for k in range(many):
            some[k] -= slope[i, k] * x[i]


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _add(changes, R, many, lower, slope):  # pragma: no cover - compiled
    """lower −= Σ c·cᵀ (its triangle), slope += Σ c·uᵀ, of changes (K, R + ·): each c and u, of K a multiple of 4."""
    for first in range(0, changes.shape[0], 4):
        p, q, s, t = changes[first], changes[first + 1], changes[first + 2], changes[first + 3]
        pu, qu, su, tu = p[R:], q[R:], s[R:], t[R:]
        for i in range(R):
            a, b, c, d, row, other = p[i], q[i], s[i], t[i], lower[i], slope[i]
            for k in range(i + 1):
                row[k] -= a * p[k] + b * q[k] + c * s[k] + d * t[k]
            for k in range(many):
                other[k] += a * pu[k] + b * qu[k] + c * su[k] + d * tu[k]


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _condition(
    X, r, scale, tares, drifts, C, own, slope, order, active, late, waiting,
    shared_C, shared_own, shared_slope, information, vector, seen, condition
):  # fmt: skip  # pragma: no cover - compiled
    """Each joint's row freed of its own weights, then of what the joints share; the state changes if `condition`."""
    n, R, Z = C.shape[0], C.shape[1], slope.shape[2]
    m, K, wait = Z - 10, late.shape[1], waiting[0]
    known = X.shape[1] - R  # 10 + p
    x, some, c = np.empty(R, np.float32), np.empty(Z, np.float32), np.empty(R, np.float32)
    z, shared_c, w = np.empty(Z), np.empty(m), np.empty(10)
    shared = np.zeros((n + 3 - (n + 3) % 4, m + 10))  # changes of what the joints share, a multiple of 4
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
            x[i] = np.float32(a * X[j, known + i])
        many, at = active[j], order[j]
        for k in range(many, Z):  # a column that has been zero so far
            if z[at[k]] != 0.0:
                at[k], at[many] = at[many], at[k]
                many += 1
        active[j] = many
        for k in range(many):
            some[k] = np.float32(z[at[k]])
        _product(C[j], x, c)
        _take_off(slope[j], x, some, many)
        for p in range(wait):
            change, g = late[j, p], np.float32(0.0)
            for i in range(R):
                g += change[i] * x[i]
            for i in range(R):
                c[i] -= g * change[i]
            for k in range(many):
                some[k] -= g * change[R + k]
        for i in range(R):
            v += x[i] * c[i]
            e -= own[j, i] * x[i]
        for k in range(many):
            z[at[k]] = some[k]
        if condition:
            change, root = late[j, wait], np.float32(1.0 / math.sqrt(v))
            for i in range(R):
                own[j, i] += c[i] / v * e
                change[i] = root * c[i]
            for k in range(Z):
                change[R + k] = root * some[k] if k < many else np.float32(0.0)
            if wait + 1 == K:
                _add(late[j], R, many, C[j], slope[j])
        _product(shared_C, z[10:], shared_c)
        for k in range(10):
            w[k] = z[k]
        for i in range(m):
            u = z[10 + i]
            e -= shared_own[i] * u
            for k in range(10):
                w[k] -= shared_slope[i, k] * u
        for p in range(j if condition else 0):
            change, g = shared[p], 0.0
            for i in range(m):
                g += change[i] * z[10 + i]
            for i in range(m):
                shared_c[i] -= g * change[i]
            for k in range(10):
                w[k] -= g * change[m + k]
        for i in range(m):
            v += z[10 + i] * shared_c[i]
        seen[j, 10], seen[j, 11] = e, v
        for k in range(10):
            seen[j, k] = w[k]
        if condition:
            change, root = shared[j], 1.0 / math.sqrt(v)
            for i in range(m):
                shared_own[i] += shared_c[i] / v * e
                change[i] = root * shared_c[i]
            for k in range(10):
                change[m + k] = root * w[k]
                vector[k] += w[k] * e / v
                for i in range(10):
                    information[k, i] += w[k] * w[i] / v
    if condition:
        _add(shared, m, 10, shared_C, shared_slope)
        waiting[0] = (wait + 1) % K
