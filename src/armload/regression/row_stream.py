"""Rows of the filtered regression from a live stream: the numbers of `regression.RegressionData`, one sample at a time.

r = W·phi + Z·eta + G·g + e        x = [W Z G] (n, 10 + p + R), at most 200 rows a second, torque at its full rate
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from armload.arms.momentum_row import MomentumRow
from armload.recording import GAP
from armload.regression.features import JointFeatures
from armload.regression.information import REGRESSOR_RATE, Stiction, presliding
from armload.regression.mismatch import FRICTION_WIDTH, Correction


class Row(NamedTuple):
    """One row of each joint: X (n, size), r (n,), what it stands for h [s], its weights (n,)."""

    h: float
    X: NDArray[np.float64]
    r: NDArray[np.float64]
    weights: NDArray[np.float64]


class RowStream:
    """Turns samples into rows.

    Args:
        correction: the unknowns eta of the arm.
        gain: λ of the lag [1/s].
        features: of each joint's nonparametric part.
        block: [s] that one pose of a standing arm counts.
    """

    def __init__(self, correction: Correction, gain: float, features: JointFeatures, block: float) -> None:
        self.correction, self.gain, self.features, self.block = correction, gain, features, block
        arm = correction.arm
        self._momentum = MomentumRow(arm)
        self._links = arm.link_parameters.ravel()
        self.reset()

    def reset(self) -> None:
        """Forget the past; the next sample is the first."""
        self._t = self._row_t = -np.inf
        self._stiction = Stiction(self.block)
        self._restart()

    def _restart(self) -> None:
        n, wide = self.correction.arm.n, 10 + self.correction.size
        self._fresh = True
        self._torque, self._tau = np.zeros(n), np.zeros(n)
        # lag of the regressor, of the bare arm, of the pose's and of the velocities' features: states, last inputs
        shapes = ((n, wide), (n,), (self.features.pose,), (n, self.features.velocity))
        self._states = tuple(np.zeros(shape) for shape in shapes for _ in range(2))

    def feed(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> Row | None:
        """The row that a sample (n,) completes, if it does; times rise."""
        if t - self._t > GAP:
            self._restart()
            self._row_t = -np.inf
        if self._fresh:
            self._tau[:] = tau
        else:
            x = self.gain * (t - self._t)
            self._torque += x / (2.0 + x) * (tau + self._tau - 2.0 * self._torque)
            self._tau[:] = tau
        self._t = t
        if t - self._row_t < 0.9 / REGRESSOR_RATE:
            return None
        h = 0.0 if self._fresh else t - self._row_t
        momentum, drift = self._momentum(q, dq)
        pose, velocity = self.features.of_sample(q, dq)
        inputs = (momentum, drift, self._links, dq, pose, velocity, self._torque)
        X, r = _row(*inputs, self.gain, h, self._fresh, *self._states)
        self._row_t, self._fresh = t, False
        counted = 0.0 if self._stiction.known(t, q.copy()) else h
        return Row(counted, X, r, presliding(dq, self.correction.presliding))


@njit(cache=True, nogil=True)
def _row(
    momentum, drift, links, dq, pose, velocity, torque, gain, h, fresh, S, U, B, UB, P, UP, V, UV
):  # pragma: no cover - compiled
    n, R = dq.shape[0], pose.shape[0] + velocity.shape[1]
    wide = S.shape[1]
    X, r = np.empty((n, wide + R)), np.empty(n)
    x = gain * h
    keep, mix = (2.0 - x) / (2.0 + x), x / (2.0 + x)
    for k in range(pose.shape[0]):
        if fresh:
            UP[k] = pose[k]
        P[k] = keep * P[k] + mix * (pose[k] + UP[k])
        UP[k] = pose[k]
    for j in range(n):
        p = bare = 0.0
        for k in range(links.shape[0]):
            p += momentum[j, 10 + k] * links[k]
            bare += drift[j, 10 + k] * links[k]
        u = bare - gain * p
        if fresh:
            B[j], UB[j] = -gain * p, u
        B[j] = keep * B[j] + mix * (u + UB[j])
        UB[j] = u
        r[j] = torque[j] - gain * p - B[j]
        for k in range(wide):
            i = k - 10
            if k < 10:
                Y, D = momentum[j, k], drift[j, k]
            elif i < 4 * n:  # offset, Coulomb and viscous friction, rotor
                Y = D = 0.0
                if i % n == j:
                    if i < n:
                        D = 1.0
                    elif i < 2 * n:
                        D = np.tanh(dq[j] / FRICTION_WIDTH)
                    elif i < 3 * n:
                        D = dq[j]
                    else:
                        Y = dq[j]
            else:
                Y, D = momentum[j, 10 + i - 4 * n], drift[j, 10 + i - 4 * n]
            u = D - gain * Y
            if fresh:
                S[j, k], U[j, k] = -gain * Y, u
            S[j, k] = keep * S[j, k] + mix * (u + U[j, k])
            U[j, k] = u
            X[j, k] = gain * Y + S[j, k]
        for k in range(pose.shape[0]):
            X[j, wide + k] = P[k]
        for k in range(velocity.shape[1]):
            if fresh:
                UV[j, k] = velocity[j, k]
            V[j, k] = keep * V[j, k] + mix * (velocity[j, k] + UV[j, k])
            UV[j, k] = velocity[j, k]
            X[j, wide + pose.shape[0] + k] = V[j, k]
    return X, r
