"""Whether the payload has just changed: three explanations of the last moments, weighed against each other.

Given all rows before, a row says e ~ N(w·phi, v) (`SequentialPosterior.seen`). With phi ~ N(m, P) from the stream its
innovation is d = e − w·m, of variance v + wᵀ·P·w. Over a short window the innovations are

    nothing       d = noise
    a payload     d = W·delta + noise,    delta ~ N(0, s²·P_0): one body more or less, the same in every joint and pose
    a push        d_j = b_j + noise,      b_j ~ N(0, s²·σ_j²): any torque on any joint, a person's hand

each for several sizes s that are as likely before. The ratios to nothing are in closed form: with P_0 = R·Rᵀ,
ln p/p_nothing = ½·bᵀ·(A + s⁻²)⁻¹·b − ½·ln|1 + s²·A|, A = Σ Rᵀ·W·Wᵀ·R/v, b = Σ Rᵀ·W·d/v. A change is a payload that
beats nothing by far, and a push, and goes on doing so: most pushes look like a payload only while they begin. While
anything beats nothing the detector is suspicious, and no row should be believed until that is over. The noise
is taken to be as large as it has lately been.

Source: generalised likelihood ratio, Willsky & Jones, IEEE T-AC 1976; Bayesian model comparison, Bishop 2006, ch. 3.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.kernels import kernel
from armload.online.thresholds import (
    ALARM,
    ALARM_ROWS,
    BODY_COM,
    BODY_GYRATION,
    BODY_SIZES,
    CALM,
    LEVEL,
    LEVEL_OUTLIER,
    LEVEL_SHARE,
    LOWEST_LEVEL,
    OVER_PUSH,
    OVER_PUSH_LATELY,
    PUSH_SIZES,
    WINDOWS,
)


class Weighed(NamedTuple):
    """ln of the likelihood ratios of a payload and of a push over nothing, and the change of phi (10,) it would be.

    rows: how many of the last ones say so.
    """

    payload: float
    push: float
    delta: NDArray[np.float64]
    rows: int


_NOTHING = Weighed(0.0, 0.0, np.zeros(10), 0)


def body_root() -> NDArray[np.float64]:
    """R (10, 10) with R·Rᵀ = E[phi·phiᵀ] of a body of 1 kg somewhere about the flange, turned any way."""
    c, k = BODY_COM**2, 2.0 * BODY_COM**2 + BODY_GYRATION**2
    mean = np.array([1.0, 0.0, 0.0, 0.0, k, 0.0, 0.0, k, 0.0, k])
    P = np.outer(mean, mean) + np.diag([0.0, c, c, c, *(c * c * np.array([4.0, 1.0, 1.0, 4.0, 1.0, 4.0]))])
    moments = [4, 7, 9]
    P[np.ix_(moments, moments)] += 2.0 * c * c * (1.0 - np.eye(3))
    return np.linalg.cholesky(P)


class ChangeDetector:
    """Watches the innovations of a stream.

    Args:
        mass: of a payload as the arm usually holds [kg]. effort: torque scale of each joint (n,) [N·m].

    Attributes:
        suspicious: whether the last rows are not what was foreseen. last: how they were weighed.
    """

    def __init__(self, mass: float, effort: NDArray[np.float64]) -> None:
        self.root, self.effort = mass * body_root(), effort
        n, longest = len(effort), max(WINDOWS)
        self._A, self._b = np.zeros((longest, 10, 10)), np.zeros((longest, 10))
        self._N, self._B, self._h = np.zeros((longest, n)), np.zeros((longest, n)), np.zeros(longest)
        self.level = LEVEL
        self.reset()

    def reset(self) -> None:
        """Forget the window, not how large the noise has been."""
        self._count = self._alarmed = 0
        self.suspicious, self.last = False, _NOTHING

    def take(
        self,
        h: float,
        seen: NDArray[np.float64],
        X: NDArray[np.float64],
        scale: NDArray[np.float64],
        mean: NDArray[np.float64],
        covariance: NDArray[np.float64],
    ) -> Weighed | None:
        """Take a row; None unless the payload seems to have changed.

        Args:
            h: what the row stands for [s]. seen: (n, 12) as in `SequentialPosterior`. X: (n, ≥ 10) the row's regressor,
                payload first. scale: (n,) what the row was multiplied by. mean, covariance: of phi before the row.
        """
        longest = max(WINDOWS)
        k = self._count % longest
        sums = (self._A, self._b, self._N, self._B)
        _parts(seen, X, scale, self.root, mean, covariance, *(x[k] for x in sums))
        self._h[k] = h
        self._count += 1
        if self._count % longest == 0 and not self.suspicious:
            ratio = _loudness(self._N, self._B)
            self.level += LEVEL_SHARE * (min(ratio, LEVEL_OUTLIER * self.level) - self.level)
            self.level = max(self.level, LOWEST_LEVEL)
        best, alarm, lately = None, False, False
        most = [-np.inf, -np.inf]  # of either ratio, in the short window and in all
        for rows in WINDOWS:
            if self._count < rows:
                break
            delta = np.empty(10)
            payload, push = _weigh(*sums, self._count, rows, self.level, self.effort, BODY_SIZES, PUSH_SIZES, delta)
            alarm |= payload > max(ALARM, push + OVER_PUSH)
            lately |= rows == WINDOWS[0] and payload > push + OVER_PUSH_LATELY
            most = [max(payload, push) if rows == WINDOWS[0] else most[0], max(most[1], payload, push)]
            if best is None or payload > best.payload:
                best = Weighed(payload, push, self.root @ delta, rows)
        self._alarmed = self._alarmed + 1 if alarm and lately else 0
        self.last = best or _NOTHING
        self.suspicious = most[1] > ALARM or (self.suspicious and most[0] > CALM)
        return best if self._alarmed >= ALARM_ROWS else None

    def ratio(self, shift: NDArray[np.float64]) -> float:
        """ln of the likelihood ratio, over nothing, of phi having changed by just this (10,), in the short window."""
        rows = min(self._count, WINDOWS[0])
        last = self._window(rows)
        x = np.linalg.solve(self.root, shift)
        return float(self._b[last].sum(axis=0) @ x - 0.5 * x @ self._A[last].sum(axis=0) @ x) / self.level

    def seconds(self, rows: int) -> float:
        """What the last so many rows stand for [s]."""
        return float(self._h[self._window(rows)].sum())

    def _window(self, rows: int) -> NDArray[np.intp]:
        """Where the last so many rows are kept."""
        return (self._count - 1 - np.arange(rows)) % max(WINDOWS)


@kernel
def _parts(seen, X, scale, root, mean, covariance, A, b, N, B):  # pragma: no cover - compiled
    """One row's share of A and b, in units of a body, and of each joint's own sums."""
    x = np.empty(10)
    for i in range(10):
        b[i] = 0.0
        for k in range(10):
            A[i, k] = 0.0
    for j in range(seen.shape[0]):
        d, v = seen[j, 10], seen[j, 11]
        for i in range(10):
            d -= seen[j, i] * mean[i]
            for k in range(10):
                v += seen[j, i] * covariance[i, k] * seen[j, k]
        a = scale[j]
        N[j], B[j] = a * a / v, a * d / v
        for i in range(10):
            x[i] = 0.0
            for k in range(i, 10):
                x[i] += a * X[j, k] * root[k, i]
        for i in range(10):
            b[i] += x[i] * d / v
            for k in range(10):
                A[i, k] += x[i] * x[k] / v


@kernel
def _loudness(N, B):  # pragma: no cover - compiled
    """Mean over the joints of (Σ B)²/Σ N: what the noise is, in units of what it is held to be."""
    total = 0.0
    for j in range(N.shape[1]):
        weight = pull = 0.0
        for i in range(N.shape[0]):
            weight += N[i, j]
            pull += B[i, j]
        total += pull * pull / max(weight, 1e-12)
    return total / N.shape[1]


@kernel
def _weigh(A, b, N, B, count, rows, level, effort, bodies, pushes, best):  # pragma: no cover - compiled
    """ln of both ratios over the last rows, and the likeliest change (10,) in units of a body."""
    longest, n = N.shape
    S, c = np.empty((10, 10)), np.empty(10)
    weight, pull = np.empty(n), np.empty(n)
    for i in range(10):
        c[i] = 0.0
        for k in range(10):
            S[i, k] = 0.0
    for j in range(n):
        weight[j] = pull[j] = 0.0
    for row in range(count - rows, count):
        k = row % longest
        for i in range(10):
            c[i] += b[k, i] / level
            for j in range(i + 1):
                S[i, j] += A[k, i, j] / level
        for j in range(n):
            weight[j] += N[k, j] / level
            pull[j] += B[k, j] / level
    L, y, x = np.empty((10, 10)), np.empty(10), np.empty(10)
    payload, likeliest = -np.inf, -np.inf
    for s in bodies:  # L·Lᵀ = 1 + s²·S, L·y = s·c
        found = 0.0
        for i in range(10):
            y[i] = s * c[i]
            for j in range(i + 1):
                z = s * s * S[i, j]
                if i == j:
                    z += 1.0
                for k in range(j):
                    z -= L[i, k] * L[j, k]
                L[i, j] = np.sqrt(z) if i == j else z / L[j, j]
            for k in range(i):
                y[i] -= L[i, k] * y[k]
            y[i] /= L[i, i]
            found += 0.5 * y[i] * y[i] - np.log(L[i, i])
        payload = np.logaddexp(payload, found - np.log(len(bodies)))
        if found > likeliest:
            likeliest = found
            for i in range(9, -1, -1):
                x[i] = y[i]
                for k in range(i + 1, 10):
                    x[i] -= L[k, i] * x[k]
                x[i] /= L[i, i]
            for i in range(10):
                best[i] = s * x[i]
    push = -np.inf
    for s in pushes:
        found = 0.0
        for j in range(n):
            size = (s * effort[j]) ** 2
            room = weight[j] * size
            found += 0.5 * (pull[j] * pull[j] * size / (1.0 + room) - np.log1p(room))
        push = np.logaddexp(push, found - np.log(len(pushes)))
    return payload, push
