"""What the last moments of a stream are: steady, a contact, a payload being handed over, or another payload.

Given all rows before, a row says e ~ N(w·phi, v) (`SequentialPosterior.seen`). With phi ~ N(m, P) from the stream its
innovation is d = e − w·m, of variance v + wᵀ·P·w; the noise is taken to be as large as it has lately been. With
R·Rᵀ = E[phi·phiᵀ] of a body (`body_root`) the hypotheses are

    steady          d = noise
    drifting        d_j = b_j + noise,     b_j an Ornstein–Uhlenbeck process, small and slow: the arm itself
    contact         the same, large and quick: a person's hand, any torque on any joint, varying
    handing over    d = W·R·x + noise,     x (10,) an Ornstein–Uhlenbeck process: a body that varies
    another         d = W·R·x + noise,     x ~ N(0, s²·1) since one of several moments: a body that stays

of several sizes and times each. Each is a Gaussian filter, so that the likelihood of a row is in closed form; of
another body it is that of all rows since its moment, ½·cᵀ·(A + s⁻²)⁻¹·c − ½·ln|1 + s²·A| over steady's, with
A = Σ Rᵀ·Wᵀ·W·R/v, c = Σ Rᵀ·Wᵀ·d/v. Probabilities follow from how often each begins and how long it lasts, as in a
hidden Markov model. Rows that are withheld from a run share the errors of its predictions, and count for less.

Sources: interacting multiple models, Blom & Bar-Shalom, IEEE T-AC 1988; change points, Adams & MacKay 2007.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from armload.online.thresholds import (
    BODY_COM,
    BODY_GYRATION,
    BODY_SIZES,
    CONTACT_LASTS,
    CONTACT_TIME,
    DRIFT_RARE,
    DRIFT_SIZE,
    DRIFT_TIME,
    HANDED_OVER,
    HANDING_TIMES,
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
from armload.runtime.kernels import kernel

_DRIFT, _CONTACT = 1, 2  # where each kind begins among the probabilities; 0: steady
_HANDING, _BODIES = _CONTACT + len(PUSH_SIZES), len(BODY_SIZES["link"])
_OTHER = _HANDING + _BODIES


def body_root() -> NDArray[np.float64]:
    """R (10, 10) with R·Rᵀ = E[phi·phiᵀ] of a body of 1 kg somewhere about the flange, turned any way."""
    c, k = BODY_COM**2, 2.0 * BODY_COM**2 + BODY_GYRATION**2
    mean = np.array([1.0, 0.0, 0.0, 0.0, k, 0.0, 0.0, k, 0.0, k])
    P = np.outer(mean, mean) + np.diag([0.0, c, c, c, *(c * c * np.array([4.0, 1.0, 1.0, 4.0, 1.0, 4.0]))])
    moments = [4, 7, 9]
    P[np.ix_(moments, moments)] += 2.0 * c * c * (1.0 - np.eye(3))
    return np.linalg.cholesky(P)


class Modes:
    """The probabilities of what the last rows are.

    Args:
        mass: of a payload as the arm usually holds [kg]. effort: torque scale of each joint (n,) [N·m].

    Attributes:
        side: "link" or "motor", where the torque is measured.
    """

    def __init__(self, mass: float, effort: NDArray[np.float64]) -> None:
        n, bodies, starts = len(effort), _BODIES, len(STARTS)
        self.root, self.effort = mass * body_root(), effort
        self.side = "link"
        self._sizes = np.array([DRIFT_SIZE, *PUSH_SIZES])
        self._times = np.array([DRIFT_TIME, *(CONTACT_TIME for _ in PUSH_SIZES)])
        self._weights = np.zeros(_OTHER + starts)
        self._b = np.zeros((2, len(self._sizes), n))  # mean and variance of each joint's torque
        self._x, self._P = np.zeros((bodies, 10)), np.zeros((bodies, 10, 10))
        self._A, self._c = np.zeros((starts, 10, 10)), np.zeros((starts, 10))  # of A the lower triangle
        self._found, self._age = np.zeros(starts), np.zeros(starts)
        self._loud, self._block, self.level = np.zeros((2, n)), 0.0, LEVEL
        self.reset()

    def reset(self) -> None:
        """All is steady; how large the noise has been is not forgotten."""
        self._weights[:] = 0.0
        self._weights[0] = 1.0
        for state in (self._b, self._x, self._P, self._A, self._c, self._found, self._age):
            state[:] = 0.0

    def take(
        self,
        h: float,
        seen: NDArray[np.float64],
        X: NDArray[np.float64],
        scale: NDArray[np.float64],
        mean: NDArray[np.float64],
        covariance: NDArray[np.float64],
        taken: bool,
    ) -> None:
        """Take a row.

        Args:
            h: what the row stands for [s]. seen: (n, 12) as in `SequentialPosterior`. X: (n, ≥ 10) the row's regressor,
                payload first. scale: (n,) what the row was multiplied by. mean, covariance: of phi before the row.
            taken: whether the run took it, too.
        """
        shared = 1.0 if taken else 1.0 + 2.0 * SAME_ERROR / h
        U, d, v = _innovation(seen, X, scale, self.root, mean, covariance, shared, self.level)
        if taken:
            self._listen(h, scale * scale / v, scale * d / v)
        row, state = (h, U, d, v, scale, self.effort), (self._b, self._x, self._P, self._A, self._c)
        known = (self._sizes, self._times, BODY_SIZES[self.side], HANDING_TIMES[self.side], STARTS)
        rates = (RARE, DRIFT_RARE, CONTACT_LASTS, HANDED_OVER)
        _weigh(*row, self._weights, *state, self._found, self._age, *known, *rates)

    def _listen(self, h: float, weight: NDArray[np.float64], pull: NDArray[np.float64]) -> None:
        """Follow how large the noise is, in units of what it is held to be: the mean over the joints of (Σ B)²/Σ N."""
        self._loud[0] += weight
        self._loud[1] += pull
        self._block += h
        if self._block >= LEVEL_BLOCK:
            if self._weights[0] > 0.5:
                ratio = self.level * float((self._loud[1] ** 2 / np.maximum(self._loud[0], 1e-12)).mean())
                self.level += LEVEL_SHARE * (min(ratio, LEVEL_OUTLIER * self.level) - self.level)
                self.level = max(self.level, LOWEST_LEVEL)
            self._loud[:] = 0.0
            self._block = 0.0

    @property
    def steady(self) -> float:
        """Probability that the arm holds what it held, and nothing else pulls at it; drifting or not."""
        return float(self._weights[:_CONTACT].sum())

    @property
    def drift(self) -> float:
        """Probability that the arm itself changes, slowly."""
        return float(self._weights[_DRIFT])

    @property
    def contact(self) -> float:
        """Probability that something touches the arm."""
        return float(self._weights[_CONTACT:_HANDING].sum())

    @property
    def handing(self) -> float:
        """Probability that the payload is changing."""
        return float(self._weights[_HANDING:_OTHER].sum())

    @property
    def other(self) -> float:
        """Probability that the payload has changed, and stays."""
        return float(self._weights[_OTHER:].sum())

    @property
    def stays(self) -> float:
        """For how long the likeliest other payload has been there [s]."""
        return float(self._age[self._weights[_OTHER:].argmax()])

    def shift(self, going_on: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """By how much phi (10,) has changed if it has, and its covariance, by the likeliest such hypothesis.

        going_on: of those alone by which it may still be changing.
        """
        k = int(self._weights[_HANDING : _OTHER if going_on else None].argmax())
        if k < _BODIES:
            x, P = self._x[k], self._P[k]
        else:
            k -= _BODIES
            sizes = BODY_SIZES[self.side]
            A, c = self._A[k] + np.tril(self._A[k], -1).T, self._c[k]
            found = [(s * s * c @ np.linalg.solve(M := np.eye(10) + s * s * A, c), M, s) for s in sizes]
            likely = [square - np.linalg.slogdet(M)[1] for square, M, _ in found]
            P = np.linalg.inv(A + np.eye(10) / sizes[int(np.argmax(likely))] ** 2)
            x = P @ c
        return self.root @ x, self.root @ P @ self.root.T


@kernel
def _innovation(seen, X, scale, root, mean, covariance, shared, level):  # pragma: no cover - compiled
    """What one row would see of a body (n, 10), its innovations (n,), their variance (n,); all in units of its noise.

    shared: by how much more than the noise the run's own uncertainty counts.
    """
    n = seen.shape[0]
    U, d, v = np.zeros((n, 10)), np.empty(n), np.empty(n)
    for j in range(n):
        d[j], v[j] = seen[j, 10], seen[j, 11]
        for i in range(10):
            d[j] -= seen[j, i] * mean[i]
            for k in range(10):
                v[j] += seen[j, i] * covariance[i, k] * seen[j, k]
            for k in range(i, 10):
                U[j, i] += scale[j] * X[j, k] * root[k, i]
        v[j] = level * (1.0 + shared * max(v[j] - 1.0, 0.0))
    return U, d, v


@kernel
def _weigh(
    h, U, d, v, scale, effort, p, b, x, P, A, c, found, age,
    sizes, times, bodies, slow, starts, rare, drift_rare, lasts, handed
):  # fmt: skip  # pragma: no cover - compiled
    """One row: what may have begun and ended (p), how likely each hypothesis is beside steady, and its state."""
    n, pushes, handing_from, other_from = len(d), len(sizes) - 1, 1 + len(sizes), 1 + len(sizes) + len(bodies)
    gains, y, L = np.zeros(len(p)), np.empty(10), np.empty((10, 10))
    contact, handing, other = p[2:handing_from].sum(), p[handing_from:other_from].sum(), p[other_from:].sum()
    steady, begins, over, done = p[0] + p[1], h / rare, min(h / lasts, 0.5), min(h / handed, 0.5)
    drifts, back = p[0] * h / drift_rare, p[1] * h * 10.0 / drift_rare
    p[0] += back - drifts - 3.0 * begins * p[0] + over * contact + 0.2 * done * handing
    p[1] += drifts - back - 3.0 * begins * p[1]
    for k in range(2, handing_from):
        p[k] += begins * (steady + other) / pushes - over * p[k]
    for k in range(handing_from, other_from):
        p[k] += begins * (steady + contact + 10.0 * other) / len(bodies) - 0.2 * done * p[k]
    best = other_from + p[other_from:].argmax()
    for k in range(len(starts)):
        p[other_from + k] *= 1.0 - 11.0 * begins
        age[k] += h
        if age[k] >= starts[k] and (other_from + k != best or p[best] < 0.01):  # begin it anew
            p[0] += p[other_from + k]
            p[other_from + k] = age[k] * (steady / rare + 0.1 * contact / lasts + handing / handed) / len(starts)
            p[other_from + k] = min(p[other_from + k], 0.1)
            age[k], found[k] = 0.0, 0.0
            for i in range(10):
                c[k, i] = 0.0
                for m in range(10):
                    A[k, i, m] = 0.0
    for k in range(len(sizes)):
        keep = math.exp(-h / times[k])
        for j in range(n):
            size = sizes[k] * effort[j]
            b[0, k, j] *= keep
            b[1, k, j] = keep * keep * b[1, k, j] + (1.0 - keep * keep) * size * size
            g = scale[j] * b[1, k, j]
            e, s = d[j] - scale[j] * b[0, k, j], scale[j] * g + v[j]
            gains[1 + k] += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
            b[0, k, j] += g * e / s
            b[1, k, j] *= v[j] / s
    for k in range(len(bodies)):
        keep = math.exp(-h / slow[k])
        for i in range(10):
            x[k, i] *= keep
            for m in range(10):
                P[k, i, m] *= keep * keep
            P[k, i, i] += (1.0 - keep * keep) * bodies[k] ** 2
        for j in range(n):
            e, s = d[j], v[j]
            for i in range(10):
                e -= U[j, i] * x[k, i]
                y[i] = 0.0
                for m in range(10):
                    y[i] += P[k, i, m] * U[j, m]
                s += U[j, i] * y[i]
            gains[handing_from + k] += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
            for i in range(10):
                x[k, i] += y[i] * e / s
                for m in range(10):
                    P[k, i, m] -= y[i] * y[m] / s
    for k in range(len(starts)):
        for j in range(n):
            for i in range(10):
                z = U[j, i] / v[j]
                c[k, i] += z * d[j]
                for m in range(i + 1):
                    A[k, i, m] += z * U[j, m]
        total = -np.inf
        for size in bodies:  # L·Lᵀ = 1 + s²·A, L·y = s·c
            log_evidence = -math.log(len(bodies))
            for i in range(10):
                y[i] = size * c[k, i]
                for j in range(i + 1):
                    z = size * size * A[k, i, j] + (1.0 if i == j else 0.0)
                    for m in range(j):
                        z -= L[i, m] * L[j, m]
                    L[i, j] = math.sqrt(z) if i == j else z / L[j, j]
                for m in range(i):
                    y[i] -= L[i, m] * y[m]
                y[i] /= L[i, i]
                log_evidence += 0.5 * y[i] * y[i] - math.log(L[i, i])
            total = np.logaddexp(total, log_evidence)
        gains[other_from + k], found[k] = total - found[k], total
    p *= np.exp(gains - gains.max())
    p += 1e-30
    p /= p.sum()
