"""What the last moments of a stream are: steady, a payload being handed over, another payload, or a contact.

Given all rows before, a row says e ~ N(w·phi, v) (`SequentialPosterior.seen`). With phi ~ N(m, P) from the stream its
innovation is d = e − w·m, of variance v + wᵀ·P·w, and the noise is taken to be as large as it has lately been. With
R·Rᵀ = E[phi·phiᵀ] of a body (`body_root`) the hypotheses are, each for several sizes s,

    steady          d = noise
    contact         d_j = b_j + noise,         b_j an Ornstein–Uhlenbeck process of size s·effort_j: any joint, varying
    handing over    d = W·R·x + noise,         x (10,) an Ornstein–Uhlenbeck process of size s: a body that varies
    another         d = W·R·x + noise,         x ~ N(0, s²) since one of several moments: a body that stays

Each is a Gaussian filter, so that the likelihood of a row is in closed form; their probabilities follow from rates of
beginning and mean durations, as in a hidden Markov model. Rows that the run is not told of share the errors of what
it foresees, and count for less.

Sources: interacting multiple models, Blom & Bar-Shalom, IEEE T-AC 1988; change points, Adams & MacKay 2007.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from armload.kernels import kernel
from armload.online.thresholds import (
    BODY_COM,
    BODY_GYRATION,
    BODY_SIZES,
    CONTACT_LASTS,
    CONTACT_VARIES,
    DRIFT_SIZE,
    DRIFT_VARIES,
    HANDED_OVER,
    HANDING_VARIES,
    LAG,
    LEVEL,
    LEVEL_BLOCK,
    LEVEL_OUTLIER,
    LEVEL_SHARE,
    LOWEST_LEVEL,
    PUSH_SIZES,
    RARE,
    SAME_ERROR,
    STARTS,
)

CONTACT = 2  # 0: steady; 1: the arm drifting
HANDING = CONTACT + len(PUSH_SIZES)
OTHER = HANDING + len(BODY_SIZES)


def body_root() -> NDArray[np.float64]:
    """R (10, 10) with R·Rᵀ = E[phi·phiᵀ] of a body of 1 kg somewhere about the flange, turned any way."""
    c, k = BODY_COM**2, 2.0 * BODY_COM**2 + BODY_GYRATION**2
    mean = np.array([1.0, 0.0, 0.0, 0.0, k, 0.0, 0.0, k, 0.0, k])
    P = np.outer(mean, mean) + np.diag([0.0, c, c, c, *(c * c * np.array([4.0, 1.0, 1.0, 4.0, 1.0, 4.0]))])
    moments = [4, 7, 9]
    P[np.ix_(moments, moments)] += 2.0 * c * c * (1.0 - np.eye(3))
    return np.linalg.cholesky(P)


class Modes:
    """The probabilities of the hypotheses, row by row.

    Args:
        mass: of a payload as the arm usually holds [kg]. effort: torque scale of each joint (n,) [N·m].

    Attributes:
        steady, contact, handing, other: probabilities.
    """

    def __init__(self, mass: float, effort: NDArray[np.float64]) -> None:
        n, bodies, pushes, starts = len(effort), len(BODY_SIZES), len(PUSH_SIZES), len(STARTS)
        self.root, self.effort = mass * body_root(), effort
        self._U, self._d, self._v = np.zeros((n, 10)), np.zeros(n), np.zeros(n)
        self._weights = np.zeros(OTHER + starts)
        self._sizes = np.concatenate([[DRIFT_SIZE], PUSH_SIZES])
        self._times = np.array([DRIFT_VARIES] + [CONTACT_VARIES] * pushes)
        self._b = np.zeros((2, 1 + pushes, n))
        self._x, self._P = np.zeros((bodies, 10)), np.zeros((bodies, 10, 10))
        self._A, self._c = np.zeros((starts, 10, 10)), np.zeros((starts, 10))
        self._found, self._age = np.zeros(starts), np.zeros(starts)
        self._loud = np.zeros((2, n))
        self.level, self._block = LEVEL, 0.0
        self._told = 0.0
        self.reset()

    def reset(self) -> None:
        """Everything is steady again; how large the noise has been is not forgotten."""
        self._weights[:] = 0.0
        self._weights[0] = 1.0
        self._b[0], self._x[:], self._A[:], self._c[:] = 0.0, 0.0, 0.0, 0.0
        self._b[1] = np.outer(self._sizes, self.effort) ** 2
        self._P[:] = BODY_SIZES[:, None, None] ** 2 * np.eye(10)
        self._found[:] = 0.0
        self._age[:] = 0.0
        self.lately = np.zeros(10)

    def take(self, h, seen, X, scale, mean, covariance, looking: bool) -> None:
        """Take a row that stands for h [s].

        Args:
            seen: (n, 12) as in `SequentialPosterior`. X: (n, ≥ 10) the row's regressor, payload first. scale: (n,) what
                the row was multiplied by. mean, covariance: of phi before the row. looking: the run is not told.
        """
        factor = 1.0 + 2.0 * SAME_ERROR / h if looking else 1.0
        _innovation(seen, X, scale, self.root, mean, covariance, factor, self.level, self._U, self._d, self._v)
        if not looking:
            self._listen(h, scale)
        _weigh(
            h, self._U, self._d, self._v, scale, self.effort, self._weights, self._b, self._x, self._P,
            self._A, self._c, self._found, self._age, BODY_SIZES, self._sizes, self._times, HANDING_VARIES, STARTS,
            RARE, CONTACT_LASTS, HANDED_OVER, RARE,
        )
        self._told += h
        if self.steady < 0.999 and self._told > 0.02:
            self.lately += min(self._told / LAG, 1.0) * (self.shift[0] - self.lately)
            self._told = 0.0
        elif self.steady >= 0.999:
            self.lately = np.zeros(10)

    def _listen(self, h: float, scale: NDArray[np.float64]) -> None:
        """Follow how large the noise is, in units of what it is held to be."""
        v = self._v / self.level
        self._loud[0] += scale**2 / v
        self._loud[1] += scale * self._d / v
        self._block += h
        if self._block >= LEVEL_BLOCK:
            if self.steady > 0.5:
                ratio = float((self._loud[1] ** 2 / np.maximum(self._loud[0], 1e-12)).mean())
                self.level += LEVEL_SHARE * (min(ratio, LEVEL_OUTLIER * self.level) - self.level)
                self.level = max(self.level, LOWEST_LEVEL)
            self._loud[:] = 0.0
            self._block = 0.0

    @property
    def steady(self) -> float:
        return float(self._weights[0] + self._weights[1])

    @property
    def contact(self) -> float:
        return float(self._weights[CONTACT:HANDING].sum())

    @property
    def handing(self) -> float:
        return float(self._weights[HANDING:OTHER].sum())

    @property
    def other(self) -> float:
        return float(self._weights[OTHER:].sum())

    @property
    def since(self) -> float:
        """For how long the likeliest other payload has been there [s]."""
        return float(self._age[int(self._weights[OTHER:].argmax())])

    @property
    def drift(self) -> float:
        return float(self._weights[1])

    @property
    def shift(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """By how much phi (10,) has changed if it has, and its covariance: of the likeliest such hypothesis."""
        k = int(self._weights[HANDING:].argmax())
        if k < len(BODY_SIZES):
            x, P = self._x[k], self._P[k]
        else:
            k -= len(BODY_SIZES)
            A = np.tril(self._A[k]) + np.tril(self._A[k], -1).T
            best, most = BODY_SIZES[0], -np.inf
            for s in BODY_SIZES:
                M = np.eye(10) + s * s * A
                f = 0.5 * s * s * self._c[k] @ np.linalg.solve(M, self._c[k]) - 0.5 * np.linalg.slogdet(M)[1]
                if f > most:
                    best, most = s, f
            P = np.linalg.inv(A + np.eye(10) / best**2)
            x = P @ self._c[k]
        return self.root @ x, self.root @ P @ self.root.T


@kernel
def _innovation(seen, X, scale, root, mean, covariance, factor, level, U, d, v):  # pragma: no cover - compiled
    """One row's innovations, their variance, and what they would see of a body."""
    for j in range(seen.shape[0]):
        e, s = seen[j, 10], seen[j, 11]
        for i in range(10):
            e -= seen[j, i] * mean[i]
            for k in range(10):
                s += seen[j, i] * covariance[i, k] * seen[j, k]
        d[j], v[j] = e, level * (1.0 + factor * max(s - 1.0, 0.0))
        for i in range(10):
            U[j, i] = 0.0
            for k in range(i, 10):
                U[j, i] += scale[j] * X[j, k] * root[k, i]


@kernel
def _weigh(
    h, U, d, v, scale, effort, weights, b, x, P, A, c, found, age, bodies, pushes, times, slow, starts, rare, lasts, handed, drifting
):  # pragma: no cover - compiled
    """One row: transitions, the likelihood of each hypothesis over steady, and its state."""
    n, pn, bn, sn = len(d), len(pushes), len(bodies), len(starts)
    D, C, H, O = 1, 2, 1 + pn, 1 + pn + bn
    # transitions
    contact = handing = other = 0.0
    for k in range(pn - 1):
        contact += weights[C + k]
    for k in range(bn):
        handing += weights[H + k]
    for k in range(sn):
        other += weights[O + k]
    steady = weights[0] + weights[D]
    out = h / rare
    over = min(h / lasts, 0.5)
    done = min(h / handed, 0.5)
    lost = weights[0] * h / drifting
    back = weights[D] * h / (0.1 * drifting)
    weights[D] += lost - back - 3.0 * out * weights[D]
    weights[0] += back - lost - 3.0 * out * weights[0] + over * contact + 0.2 * done * handing
    for k in range(pn - 1):
        weights[C + k] = weights[C + k] * (1.0 - over) + out * (steady + other) / (pn - 1)
    for k in range(bn):
        weights[H + k] = weights[H + k] * (1.0 - 0.2 * done) + out * (steady + contact + 10.0 * other) / bn
    for k in range(sn):
        weights[O + k] *= 1.0 - 11.0 * out
    best = 0
    for k in range(sn):
        if weights[O + k] > weights[O + best]:
            best = k
    for k in range(sn):
        age[k] += h
        if age[k] >= starts[k] and not (k == best and weights[O + k] > 0.01):
            weights[0] += weights[O + k]
            span = age[k]
            age[k], found[k] = 0.0, 0.0
            for i in range(10):
                c[k, i] = 0.0
                for m in range(10):
                    A[k, i, m] = 0.0
            share = span * (steady / rare + contact / (10.0 * lasts) + handing / handed) / sn
            weights[O + k] = min(share, 0.1)
            weights[0] -= 0.0
    # likelihoods
    gains = np.zeros(len(weights))
    for k in range(pn):
        keep = math.exp(-h / times[k])
        for j in range(n):
            size = (pushes[k] * effort[j]) ** 2
            b[0, k, j] *= keep
            b[1, k, j] = keep * keep * b[1, k, j] + (1.0 - keep * keep) * size
            a = scale[j]
            e, s = d[j] - a * b[0, k, j], a * a * b[1, k, j] + v[j]
            gains[D + k] += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
            g = a * b[1, k, j] / s
            b[0, k, j] += g * e
            b[1, k, j] *= v[j] / s
    y = np.empty(10)
    for k in range(bn):
        keep = math.exp(-h / slow[k])
        size = bodies[k] ** 2
        for i in range(10):
            x[k, i] *= keep
            for m in range(10):
                P[k, i, m] *= keep * keep
            P[k, i, i] += (1.0 - keep * keep) * size
        for j in range(n):
            e, s = d[j], v[j]
            for i in range(10):
                e -= U[j, i] * x[k, i]
                y[i] = 0.0
                for m in range(10):
                    y[i] += P[k, i, m] * U[j, m]
                s += U[j, i] * y[i]
            gains[H + k] += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
            for i in range(10):
                x[k, i] += y[i] * e / s
                for m in range(10):
                    P[k, i, m] -= y[i] * y[m] / s
    L = np.empty((10, 10))
    for k in range(sn):
        for j in range(n):
            for i in range(10):
                z = U[j, i] / v[j]
                c[k, i] += z * d[j]
                for m in range(i + 1):
                    A[k, i, m] += z * U[j, m]
        total = -np.inf
        for size in bodies:
            said = 0.0
            for i in range(10):
                y[i] = size * c[k, i]
                for j in range(i + 1):
                    z = size * size * A[k, i, j]
                    if i == j:
                        z += 1.0
                    for m in range(j):
                        z -= L[i, m] * L[j, m]
                    L[i, j] = math.sqrt(z) if i == j else z / L[j, j]
                for m in range(i):
                    y[i] -= L[i, m] * y[m]
                y[i] /= L[i, i]
                said += 0.5 * y[i] * y[i] - math.log(L[i, i])
            said -= math.log(len(bodies))
            top = max(total, said)
            total = top + math.log(math.exp(total - top) + math.exp(said - top))
        gains[O + k] = total - found[k]
        found[k] = total
    top = 0.0
    for k in range(len(weights)):
        top = max(top, gains[k])
    total = 0.0
    for k in range(len(weights)):
        weights[k] = max(weights[k] * math.exp(gains[k] - top), 1e-30)
        total += weights[k]
    for k in range(len(weights)):
        weights[k] /= total
