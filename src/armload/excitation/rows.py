"""Rows of the filtered regression along a motion, and how a function of them changes with the motion.

The rows are those of `regression.rows`, X = λ·Y + F[D − λ·Y], evenly sampled and of the arm that follows the motion
exactly. The way back is the adjoint of the same steps: of the lag F (the same recursion, run backwards in time), and of
the momentum form (Y, D), whose change with each joint's position and velocity at one instant is a difference quotient
in compiled code. A gradient costs 2·n + 1 evaluations of the momentum form at each sample, whatever the number of
variables of the motion.

Source: Griewank & Walther, Evaluating Derivatives, 2008 (the adjoint of a recursion).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from armload.arms import FRICTION_WIDTH
from armload.arms.momentum_row import MomentumRow, momentum_rows
from armload.regression import Correction, JointFeatures
from armload.regression.mismatch import TILTS
from armload.runtime.kernels import kernel

_STEP = 1e-7  # [rad, rad/s] of the difference quotients: the rounding of 1e-16 shows as 1e-9


@dataclass(eq=False)
class MotionRows:
    """What a motion gives at N instants: rows X (N, n, size), weights (N, n) and the momentum form of all bodies."""

    q: NDArray[np.float64]
    dq: NDArray[np.float64]
    step: float
    momentum: NDArray[np.float64]  # Y of payload and links (N, n, 10 + 10·n)
    drift: NDArray[np.float64]
    torque: NDArray[np.float64]  # of the bare arm, lagged (N, n) [N·m]
    X: NDArray[np.float64]
    weights: NDArray[np.float64]


@dataclass(eq=False)
class RowAdjoint:
    """How some function changes with q and dq (N, n), and with the momentum form, to be filled in by several."""

    q: NDArray[np.float64]
    dq: NDArray[np.float64]
    momentum: NDArray[np.float64]
    drift: NDArray[np.float64]

    @classmethod
    def zero(cls, rows: MotionRows) -> RowAdjoint:
        """Nothing changes."""
        return cls(*(np.zeros_like(x) for x in (rows.q, rows.dq, rows.momentum, rows.drift)))


class RowModel:
    """The rows of one arm, forwards and backwards.

    Args:
        correction: the arm's unknowns.
        features: of each joint's smooth mismatch.
        gain: λ of the lag [1/s].
    """

    def __init__(self, correction: Correction, features: JointFeatures, gain: float) -> None:
        self.correction, self.features, self.gain, self.arm = correction, features, gain, correction.arm
        self.chain = MomentumRow(self.arm).chain
        self.links = self.arm.link_parameters.ravel()
        self._own = correction.own
        self._wide = 10 + correction.size
        self.sensitivity = np.ones(self.arm.n) if correction.gain is None else correction.gain

    def forward(self, q: NDArray[np.float64], dq: NDArray[np.float64], step: float) -> MotionRows:
        """The rows at q, dq (N, n), `step` seconds apart."""
        q, dq = np.array(q, order="C"), np.array(dq, order="C")
        momentum, drift = _forms(*self.chain, q, dq)
        N, n = q.shape
        s = np.tanh(dq / FRICTION_WIDTH)
        torque = self._lagged(momentum[:, :, 10:] @ self.links, drift[:, :, 10:] @ self.links, step)
        Y, D = np.zeros((N, n, self._wide)), np.zeros((N, n, self._wide))
        Y[:, :, :10], D[:, :, :10] = (x[:, :, :10] * self.sensitivity[:, None] for x in (momentum, drift))
        j = np.arange(n)
        D[:, j, 10 + j] = 1.0
        D[:, j, 10 + n + j] = s
        D[:, j, 10 + 2 * n + j] = dq
        Y[:, j, 10 + 3 * n + j] = dq
        if self.correction.loss_std > 0.0:
            D[:, j, 10 + 4 * n + j] = np.abs(torque - self.correction.least_friction * s) * s
        links = 10 + self._own + TILTS
        Y[:, :, links:], D[:, :, links:] = momentum[:, :, 10:], drift[:, :, 10:]
        pose, velocity = self.features.of_pose(q), self.features.of_velocity(dq)
        pose = self._lagged(np.zeros_like(pose), pose, step)
        parts = [
            self._lagged(Y, D, step),
            np.broadcast_to(pose[:, None], (N, n, pose.shape[1])),
            self._lagged(np.zeros_like(velocity), velocity, step),
        ]
        weights = 1.0 / (1.0 + self.correction.presliding * (1.0 - s**2))
        return MotionRows(q, dq, step, momentum, drift, torque, np.concatenate(parts, axis=2), weights)

    def backward(self, rows: MotionRows, X: NDArray, weights: NDArray, out: RowAdjoint) -> None:
        """Add to `out` how a function changes that changes with the rows by X (N, n, size), with weights by (N, n)."""
        n, j, wide = self.arm.n, np.arange(self.arm.n), self._wide
        Y, D = self._back(X[:, :, :wide], rows.step)
        s = np.tanh(rows.dq / FRICTION_WIDTH)
        slope = (1.0 - s**2) / FRICTION_WIDTH
        direction = D[:, j, 10 + n + j] + weights * rows.weights**2 * self.correction.presliding * 2.0 * s
        out.momentum[:, :, :10] += Y[:, :, :10] * self.sensitivity[:, None]
        out.drift[:, :, :10] += D[:, :, :10] * self.sensitivity[:, None]
        out.dq += D[:, j, 10 + 2 * n + j] + Y[:, j, 10 + 3 * n + j]
        links = 10 + self._own + TILTS
        out.momentum[:, :, 10:] += Y[:, :, links:]
        out.drift[:, :, 10:] += D[:, :, links:]
        if self.correction.loss_std > 0.0:
            load, c = D[:, j, 10 + 4 * n + j], self.correction.least_friction
            through = rows.torque - c * s
            sign = np.sign(through)
            direction += load * (np.abs(through) - s * sign * c)
            p, bare = self._back(load * s * sign, rows.step)
            out.momentum[:, :, 10:] += p[:, :, None] * self.links
            out.drift[:, :, 10:] += bare[:, :, None] * self.links
        out.dq += direction * slope
        self._features_back(rows, X[:, :, wide:], out)

    def at_joints(self, rows: MotionRows, change: RowAdjoint) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How the function changes with q and with dq (N, n) each, the momentum form's part included."""
        momentum, drift = (np.ascontiguousarray(x) for x in (change.momentum, change.drift))
        q, dq = _forms_back(*self.chain, rows.q, rows.dq, rows.momentum, rows.drift, momentum, drift, _STEP)
        return change.q + q, change.dq + dq

    def _features_back(self, rows: MotionRows, X: NDArray, out: RowAdjoint) -> None:
        half, few = len(self.features.waves), len(self.features.velocity_waves)
        if half:
            pose = self._back(X[:, :, : 2 * half].sum(axis=1), rows.step)[1] / np.sqrt(half)
            angle = rows.q @ self.features.waves.T
            out.q += (np.cos(angle) * pose[:, half:] - np.sin(angle) * pose[:, :half]) @ self.features.waves
        if few:
            velocity = self._back(X[:, :, 2 * half :], rows.step)[1] / np.sqrt(few)
            waves = self.features.velocity_waves
            unit, rate = self.features.stretched(rows.dq)
            angle = unit[:, :, None] * waves
            by_angle = np.cos(angle) * velocity[:, :, few:] - np.sin(angle) * velocity[:, :, :few]
            out.dq += (by_angle @ waves) * rate

    def _lagged(self, Y: NDArray, D: NDArray, step: float) -> NDArray[np.float64]:
        """λ·Y + F[D − λ·Y] along the first axis; F starts at −λ·Y(0)."""
        keep, mix = self._lag(step)
        u = D - self.gain * Y
        first = (-self.gain * Y[0] - mix * u[0])[None]
        out, _ = lfilter([mix, mix], [1.0, -keep], u, axis=0, zi=first)
        return self.gain * Y + out

    def _back(self, X: NDArray, step: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How a function changes with Y and D that changes with the lagged rows by X."""
        keep, mix = self._lag(step)
        later = np.asarray(lfilter([1.0], [1.0, -keep], X[::-1], axis=0))[::-1]
        u = np.zeros_like(later)
        u[1:] = mix * later[1:]
        u[:-1] += mix * later[1:]
        Y = self.gain * (X - u)
        Y[0] -= self.gain * later[0]
        return Y, u

    def _lag(self, step: float) -> tuple[float, float]:
        x = self.gain * step
        return (2.0 - x) / (2.0 + x), x / (2.0 + x)


@kernel
def _forms(rotations, translations, axes, turning, gravity, q, dq):  # pragma: no cover - compiled
    N, n = q.shape
    momentum, drift = np.empty((N, n, 10 * n + 10)), np.empty((N, n, 10 * n + 10))
    for t in range(N):
        Y, D = momentum_rows(rotations, translations, axes, turning, gravity, q[t], dq[t])
        for j in range(n):
            for k in range(Y.shape[1]):
                momentum[t, j, k], drift[t, j, k] = Y[j, k], D[j, k]
    return momentum, drift


@kernel
def _forms_back(
    rotations, translations, axes, turning, gravity, q, dq, momentum, drift, by_momentum, by_drift, step
):  # pragma: no cover - compiled
    N, n = q.shape
    out_q, out_dq = np.zeros((N, n)), np.zeros((N, n))
    at, rate = np.empty(n), np.empty(n)
    for t in range(N):
        for i in range(n):
            at[i], rate[i] = q[t, i], dq[t, i]
        for c in range(2 * n):
            i = c % n
            if c < n:
                at[i] += step
            else:
                rate[i] += step
            Y, D = momentum_rows(rotations, translations, axes, turning, gravity, at, rate)
            total = 0.0
            for j in range(n):
                for k in range(Y.shape[1]):
                    total += by_momentum[t, j, k] * (Y[j, k] - momentum[t, j, k])
                    total += by_drift[t, j, k] * (D[j, k] - drift[t, j, k])
            if c < n:
                out_q[t, i], at[i] = total / step, q[t, i]
            else:
                out_dq[t, i], rate[i] = total / step, dq[t, i]
    return out_q, out_dq
