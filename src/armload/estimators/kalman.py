"""An extended Kalman filter over the joints' state, the payload and the arm's friction: x = [q, q̇, phi, o, c].

Process: the forward dynamics of arm and payload, driven by the measured torque less offset and smooth Coulomb friction,
tau − o − c·tanh(q̇/width); phi, o and c are constant. What the model leaves out of the torque is white noise of
spectral density S, the long-run variance such torque has on real arms. Output: measured q and q̇.

    x⁺ = f(x, tau) (midpoint rule),    P⁺ = F·P·Fᵀ + Q,    K = P⁺·Hᵀ·(H·P⁺·Hᵀ + R)⁻¹,
    P = (1 − K·H)·P⁺·(1 − K·H)ᵀ + K·R·Kᵀ  (Joseph form: symmetric and positive semidefinite whatever the rounding)

q̈ is far from linear in phi where a payload is heavy beside a wrist, so f is linearised at the payload that the step
itself finds (iterated), and at the nearest body while that is none; from there it is extended to phi.
Sources: Bucy & Joseph 1968; Bell & Cathey 1993 (iterated); Simon 2006, ch. 13; for robots, Gautier & Poignet, Control
Engineering Practice 2001.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import FRICTION_WIDTH, Arm, ForwardDynamics, rated_effort
from armload.errors import IdentificationError
from armload.estimators.contract import Estimate, Identifier
from armload.inertia import is_consistent, nearest_consistent
from armload.recording import GAP, Sample
from armload.regression import solution_prior_std
from armload.regression.mismatch import PER_JOINT
from armload.regression.noise import RIGID
from armload.regression.rows import SPACING

_MARGIN = 1e-3  # [kg] how far inside the cone of bodies (lengths in units of 0.1 m) the model is linearised
_ITERATIONS = 6
_SMOOTH = 0.02  # [s] lag of the acceleration at which f is linearised
_NEAR = 1e-3  # of the payload's first spread: linearised no further off, a step is not repeated


class ExtendedKalmanFilter(Identifier):
    """Joint state, payload and friction by an extended Kalman filter on the forward dynamics.

    It needs no lag and no acceleration; a step takes about two milliseconds and stands for five. Samples should come
    at 200 Hz or more: slower ones cost accuracy in the midpoint rule. A tare's
    estimate taken off it (`Tared`) does the inertia harm.

    >>> from armload.arms import arm
    >>> ExtendedKalmanFilter(arm("panda")).name
    'ekf'

    Args:
        arm: the bare arm.
        torque_density: √S of the unmodelled torque per joint (n,) [N·m/√Hz]; None: 0.4 % of the effort limit.
        position_noise, velocity_noise: standard deviations of measured q and q̇ [rad, rad/s].

    Raises:
        IdentificationError: a noise that is not positive.
    """

    name = "ekf"

    def __init__(
        self,
        arm: Arm,
        torque_density: NDArray | float | None = None,
        position_noise: float = 1e-4,
        velocity_noise: float = 2e-3,
    ) -> None:
        if not (position_noise > 0 and velocity_noise > 0):
            raise IdentificationError(
                f"noise of {position_noise} rad and {velocity_noise} rad/s: expected positive numbers"
            )
        self.arm, self.torque_density = arm, torque_density
        self._dynamics = ForwardDynamics(arm)
        self._R = np.repeat([position_noise**2, velocity_noise**2], arm.n)
        self._unit = solution_prior_std(arm)
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        size = 4 * self.arm.n + 10
        self._x, self._P = np.zeros(size), np.zeros((size, size))
        self._last: Sample | None = None
        self._since = 0.0  # time of the last step
        self._input = np.zeros(2 * self.arm.n)  # ∫ [tau, tanh(q̇/width)] dt since then
        self._dq, self._ddq = np.zeros(self.arm.n), np.zeros(self.arm.n)  # measured then; lagged acceleration
        self._count = 0

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        for sample in zip(t.tolist(), q, dq, tau, strict=True):
            self._follow(Sample(*sample))

    def _estimate(self, t: float) -> Estimate:
        phi = slice(2 * self.arm.n, 2 * self.arm.n + 10)
        return Estimate(t, self._x[phi].copy(), self._P[phi, phi].copy(), self._count, str(self.arm.frame))

    def _follow(self, sample: Sample) -> None:
        """Take one sample; a step is made of several."""
        n, last = self.arm.n, self._last
        if self._count == 0:
            self._begin()
        now = Sample(sample.t, sample.q.copy(), sample.dq.copy(), sample.tau.copy())
        if last is None or now.t - last.t > GAP:
            joints = slice(0, 2 * n)
            self._x[joints] = np.concatenate([now.q, now.dq])
            self._P[joints] = self._P[:, joints] = 0.0
            self._P[joints, joints] = np.diag(self._R)
            self._since, self._input = now.t, np.zeros(2 * n)
            self._dq, self._ddq = now.dq, np.zeros(n)
        else:
            self._input = self._input + 0.5 * (now.t - last.t) * (_input(last) + _input(now))
            if now.t - self._since >= SPACING:
                h = now.t - self._since
                tau, moving = np.split(self._input / h, 2)
                self._step(h, tau, moving, np.concatenate([now.q, now.dq]))
                self._since, self._input = now.t, np.zeros(2 * n)
                self._ddq = self._ddq + (1.0 - np.exp(-h / _SMOOTH)) * ((now.dq - self._dq) / h - self._ddq)
                self._dq = now.dq
        self._last = now
        self._count += 1

    def _begin(self) -> None:
        n, effort = self.arm.n, rated_effort(self.arm)
        first = np.concatenate(
            [np.zeros(2 * n), self._unit, PER_JOINT["offset"] * effort, PER_JOINT["coulomb"] * effort]
        )
        self._P = np.diag(first**2)
        density = RIGID.residual * np.sqrt(RIGID.block) * effort if self.torque_density is None else self.torque_density
        self._root_S = np.broadcast_to(np.asarray(density, dtype=float), (n,))

    def _step(self, h: float, tau: NDArray, moving: NDArray, measured: NDArray) -> None:
        """Predict and correct, repeated until the payload found is the one linearised at."""
        n = self.arm.n
        phi = slice(2 * n, 2 * n + 10)
        body = self._nearest_body(self._x[phi], self._P[phi, phi])
        for _ in range(_ITERATIONS):
            x, P = self._predicted(h, tau, moving, body)
            x, P = self._corrected(x, P, measured)
            last, body = body, self._nearest_body(x[phi], P[phi, phi])
            if np.abs((body - last) / self._unit).max() < _NEAR:
                break
        self._x, self._P = x, P

    def _nearest_body(self, phi: NDArray, covariance: NDArray) -> NDArray[np.float64]:
        """The likeliest body: nearest to phi in the metric of what is known of it."""
        if is_consistent(phi, -_MARGIN):
            return phi
        information = np.linalg.inv(covariance / np.outer(self._unit, self._unit)) / np.outer(self._unit, self._unit)
        return nearest_consistent(phi, information, _MARGIN)

    def _predicted(self, h: float, tau: NDArray, moving: NDArray, body: NDArray) -> tuple[NDArray, NDArray]:
        """x⁺ and P⁺ after h seconds, f linearised at a body (10,)."""
        n, x = self.arm.n, self._x
        q, dq, phi, offset, coulomb = np.split(x, np.cumsum([n, n, 10, n]))
        tau = tau - offset - coulomb * moving
        middle = q + 0.5 * h * dq, dq + 0.5 * h * self._dynamics(q, dq, tau, body)
        at = self._dynamics.derivatives(*middle, self._dynamics.inverse(*middle, self._ddq, body), body)
        ddq = self._dynamics(*middle, tau, body) + at.by_phi @ (phi - body)
        by_dq = at.by_dq + 0.5 * h * at.by_q  # at the midpoint
        A = np.concatenate([at.by_q, by_dq, at.by_phi, -at.by_tau, -at.by_tau * moving], axis=1)
        F = np.eye(len(x))
        F[:n, n : 2 * n] += h * np.eye(n)
        F[:n] += 0.5 * h**2 * A
        F[n : 2 * n] += h * A
        push = at.by_tau * self._root_S * np.sqrt(h)  # the step of q̇ for one standard deviation of torque
        G = np.concatenate([0.5 * h * push, push])
        P = F @ self._P @ F.T
        P[: 2 * n, : 2 * n] += G @ G.T
        return np.concatenate([q + h * dq + 0.5 * h**2 * ddq, dq + h * ddq, x[2 * n :]]), P

    def _corrected(self, x: NDArray, P: NDArray, measured: NDArray) -> tuple[NDArray, NDArray]:
        n2, R = 2 * self.arm.n, self._R
        innovation = P[:n2, :n2] + np.diag(R)
        scale = 1.0 / np.sqrt(np.diag(innovation))  # rad and rad/s differ by orders of magnitude
        K = np.linalg.solve(innovation * np.outer(scale, scale), scale[:, None] * P[:n2]).T * scale
        left = np.eye(len(P))
        left[:, :n2] -= K
        P = left @ P @ left.T + (K * R) @ K.T
        return x + K @ (measured - x[:n2]), 0.5 * (P + P.T)


def _input(sample: Sample) -> NDArray[np.float64]:
    return np.concatenate([sample.tau, np.tanh(sample.dq / FRICTION_WIDTH)])
