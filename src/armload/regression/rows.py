"""Rows of the acceleration-free filtered regression, from one sample or many: the one kernel of every method.

The load torque tau_L = tau_J − tau_bare equals d/dt(Y_p·phi) + (Y_g − Y_c)·phi. The first-order lag F = λ/(s + λ) on
both sides removes the derivative:

    r = F[tau_J − tau_bare] = W·phi,      W = λ·(Y_p − F[Y_p]) + F[Y_g − Y_c] = λ·Y_p + F[Y_g − Y_c − λ·Y_p]

exactly, if F[Y_p] starts at Y_p(0) and the other lags at 0. The bare arm enters the same way through its momentum, so
neither q̈ nor a derivative of a measured signal occurs. What else a row may hold passes the same lag:

    r = W·phi + Z·eta + G·g + e        X = [W Z G] (n, 10 + p + R)

eta is the arm's rigid mismatch (`mismatch.py`), g are each joint's weights of its smooth features (`features.py`). The
lag is discretised by the bilinear rule; torque is lagged at its full rate, the rest at the rate of the rows.

Sources: Hsu, Bodson, Sastry, Paden 1987; Middleton & Goodwin 1988; Slotine & Li 1989.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import FRICTION_WIDTH, Arm
from armload.arms.momentum_row import MomentumRow, leaning_row, momentum_rows
from armload.kernels import kernel
from armload.recording import GAP, JITTERED
from armload.regression.features import JointFeatures, features_of_sample
from armload.regression.lag import GAIN
from armload.regression.mismatch import TILTS, Correction

REGRESSOR_RATE = 200.0  # [Hz] rows are made no more often where a rate is set: they hold nothing above a few hertz
SPACING = JITTERED / REGRESSOR_RATE  # [s] between rows at least
# [rad] an arm that stays so near shows one value of its stiction: more of it tells nothing new. Above what encoders and
# a controller at rest show (test_a_pose_of_a_standing_arm_counts_no_longer_than_it_settles)
_STILL = 1e-3


class Row(NamedTuple):
    """One row of each joint, at t [s] and q (n,): X (n, size), r (n,), what it stands for h [s], its weights (n,)."""

    t: float
    q: NDArray[np.float64]
    h: float
    X: NDArray[np.float64]
    r: NDArray[np.float64]
    weights: NDArray[np.float64]


class Rows(NamedTuple):
    """M rows of each joint: t (M,), q (M, n), h (M,) [s], X (M, n, size), r (M, n), weights (M, n)."""

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    h: NDArray[np.float64]
    X: NDArray[np.float64]
    r: NDArray[np.float64]
    weights: NDArray[np.float64]

    @classmethod
    def of(cls, rows: Sequence[Row]) -> Rows:
        """Single rows put together, one at least."""
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))


class FilteredRegression:
    """Turns samples (t, q, dq, tau) into rows of the regression, one at a time or many; after a gap it starts anew.

    >>> from armload.arms import arm
    >>> r, W = FilteredRegression(arm("panda"))([0.0], np.zeros((1, 7)), np.zeros((1, 7)), np.zeros((1, 7)))
    >>> r.shape, W.shape
    ((1, 7), (1, 7, 10))

    Args:
        arm: the bare arm (with whatever is `attached`).
        gain: λ of the lag [1/s]; the observer gain of a momentum observer.
        mismatch: the arm's rigid unknowns eta; None: the rows have none.
        features: of each joint's smooth mismatch; None: the rows have none.
        rate: rows per second at most [Hz]; None: every sample gives one.
        settling: [s] that one pose of a standing arm counts; beyond it a row stands for no time.
    """

    def __init__(
        self,
        arm: Arm,
        gain: float = GAIN,
        mismatch: Correction | None = None,
        features: JointFeatures | None = None,
        rate: float | None = None,
        settling: float = np.inf,
    ) -> None:
        self.arm, self.gain = arm, gain
        self._momentum = MomentumRow(arm)
        self._torque_gain = None if mismatch is None else mismatch.gain
        self._links = np.ascontiguousarray(arm.link_parameters.ravel())
        self._turned = np.cross(arm.horizontal, arm.gravity)  # how gravity changes with each angle
        self._waves, self._velocity_waves = np.zeros((0, arm.n)), np.zeros(0)
        if features is not None and features.size:
            self._waves, self._velocity_waves = features.waves, features.velocity_waves
        self._wide = 10 + (0 if mismatch is None else mismatch.size)
        apart = -1.0 if rate is None else SPACING * REGRESSOR_RATE / rate
        known = [0.0] if mismatch is None else [mismatch.presliding, *mismatch.least_friction]
        self._settings = np.array([gain, apart, settling, *known])
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next sample is the first."""
        n, pose, velocity = self.arm.n, 2 * len(self._waves), 2 * len(self._velocity_waves)
        # times of the last sample, of the last row, since when the arm rests; what the last row stands for
        self._clock = np.full(4, -np.inf)
        self._joints = np.full((5, n), np.nan)  # lagged torque, last torque; of the bare arm; the pose of rest
        self._regressor = np.zeros((2, n, self._wide))  # states of the lags, their last inputs
        self._pose, self._velocity = np.zeros((2, pose)), np.zeros((2, n, velocity))

    @property
    def state(self) -> tuple[NDArray[np.float64], ...]:
        """A copy of all that is remembered of the samples so far; set it, and the next samples go on from there."""
        return tuple(x.copy() for x in (self._clock, self._joints, self._regressor, self._pose, self._velocity))

    @state.setter
    def state(self, state: tuple[NDArray[np.float64], ...]) -> None:
        self._clock, self._joints, self._regressor, self._pose, self._velocity = (x.copy() for x in state)

    def rows(self, t: ArrayLike, q: ArrayLike, dq: ArrayLike, tau: ArrayLike) -> Rows:
        """The rows that the next N samples complete: t (N,) rising [s]; q, dq, tau (N, n) [rad, rad/s, N·m]."""
        times = np.require(np.atleast_1d(t), float, ["C", "W"])
        poses, dq, tau = (np.require(np.atleast_2d(x), float, ["C", "W"]) for x in (q, dq, tau))
        index, steps, fresh, torque = _lag_torques(times, tau, self._settings, self._clock, self._joints)
        times, poses = times[index], poses[index]
        return Rows(times, poses, *self._made(times, poses, dq[index], torque, steps, fresh))

    def row(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> Row | None:
        """The row that a sample completes, if it does; q, dq, tau (n,)."""
        done = _lag_torque(t, _writable(tau), self._settings, self._clock, self._joints)
        if not done:
            return None
        q, dq = _writable(q), _writable(dq)
        step, fresh = self._clock[3:], np.array([done == _FRESH])
        h, X, r, weights = self._made(np.array([t]), q[None], dq[None], self._joints[:1], step, fresh)
        return Row(t, q, h[0], X[0], r[0], weights[0])

    def __call__(
        self, t: ArrayLike, q: ArrayLike, dq: ArrayLike, tau: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """r (M, n) [N·m] and X (M, n, size) of the rows that the next N samples complete."""
        rows = self.rows(t, q, dq, tau)
        return rows.r, rows.X

    def _made(self, t: NDArray, q: NDArray, dq: NDArray, torque: NDArray, steps: NDArray, fresh: NDArray) -> tuple:
        states = (self._clock, self._joints, self._regressor, self._pose, self._velocity)
        arm = (*self._momentum.chain, self._turned, self._links, self._waves, self._velocity_waves)
        made = _make(t, q, dq, torque, steps, fresh, self._settings, *arm, *states)
        if self._torque_gain is not None:
            made[1][:, :, :10] *= self._torque_gain[:, None]
        return made


def _writable(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compiled code is compiled once: for arrays that can be written."""
    return x if x.flags.writeable else x.copy()


_FRESH = (
    2  # what `_lag_torque` says of a sample at which the lags start; 1: of another that completes a row, 0: of others
)


@kernel
def _lag_torque(t, tau, settings, clock, joints):  # pragma: no cover - compiled
    """Take one sample's torque (n,) into its lag; whether a row is due, and in clock[3] what it stands for [s]."""
    gain, apart = settings[0], settings[1]
    fresh = t - clock[0] > GAP
    x = gain * (t - clock[0])
    for j in range(tau.shape[0]):
        if fresh:
            joints[0, j] = 0.0
        else:
            joints[0, j] += x / (2.0 + x) * (tau[j] + joints[1, j] - 2.0 * joints[0, j])
        joints[1, j] = tau[j]
    clock[0] = t
    if not fresh and t - clock[1] < apart:
        return 0
    clock[3] = 0.0 if fresh else t - clock[1]
    clock[1] = t
    return _FRESH if fresh else 1


@kernel
def _lag_torques(t, tau, settings, clock, joints):  # pragma: no cover - compiled
    """The same of N samples: index, step, whether the lags start, and lagged torque of those that complete a row."""
    N, count = len(t), 0
    index, steps, fresh, torque = np.empty(N, np.int64), np.empty(N), np.empty(N, np.bool_), np.empty(tau.shape)
    for k in range(N):
        done = _lag_torque(t[k], tau[k], settings, clock, joints)
        if done:
            index[count], steps[count], fresh[count] = k, clock[3], done == _FRESH
            for j in range(tau.shape[1]):
                torque[count, j] = joints[0, j]
            count += 1
    return index[:count], steps[:count], fresh[:count], torque[:count]


@kernel
def _make(
    t,
    q,
    dq,
    torque,
    steps,
    fresh,
    settings,
    rotations,
    translations,
    axes,
    turning,
    gravity,
    turned,
    links,
    waves,
    velocity_waves,
    clock,
    joints,
    regressor,
    pose_lag,
    velocity_lag,
):  # pragma: no cover - compiled
    """M rows from the samples that complete them: h, X, r and weights."""
    gain, settling, excess = settings[0], settings[2], settings[3]
    count, n = q.shape
    size = regressor.shape[2] + pose_lag.shape[1] + velocity_lag.shape[2]
    h, X, r, weights = np.empty(count), np.empty((count, n, size)), np.empty((count, n)), np.empty((count, n))
    for m in range(count):
        momentum, drift = momentum_rows(rotations, translations, axes, turning, gravity, q[m], dq[m])
        pose, velocity = features_of_sample(q[m], dq[m], waves, velocity_waves)
        leaning = leaning_row(rotations, translations, axes, turning, turned, links, q[m])
        inputs = (momentum, drift, leaning, links, dq[m], torque[m], pose, velocity, settings[4:])
        _lagged(inputs, gain, steps[m], fresh[m], joints, regressor, pose_lag, velocity_lag, X[m], r[m])
        for j in range(n):
            weights[m, j] = 1.0 / (1.0 + excess * (1.0 - np.tanh(abs(dq[m, j]) / FRICTION_WIDTH) ** 2))
        moved = not np.isfinite(clock[2])
        for j in range(n):
            moved |= abs(q[m, j] - joints[4, j]) > _STILL
        if moved:
            clock[2] = t[m]
            for j in range(n):
                joints[4, j] = q[m, j]
        h[m] = 0.0 if t[m] - clock[2] > settling else steps[m]
    return h, X, r, weights


@kernel
def _lagged(inputs, gain, h, fresh, joints, regressor, pose_lag, velocity_lag, X, r):  # pragma: no cover - compiled
    """One row from what goes into its lags, h seconds after the last; `fresh`: the lags start here."""
    momentum, drift, leaning, links, dq, torque, pose, velocity, least_friction = inputs
    n, few, many, wide = dq.shape[0], velocity.shape[1], pose.shape[0], regressor.shape[2]
    own = wide - 10 - TILTS - links.shape[0]  # unknowns of the joints, where there are any
    S, U, P, UP, V, UV = regressor[0], regressor[1], pose_lag[0], pose_lag[1], velocity_lag[0], velocity_lag[1]
    B, UB = joints[2], joints[3]
    x = gain * h
    keep, mix = (2.0 - x) / (2.0 + x), x / (2.0 + x)
    for k in range(many):
        if fresh:
            P[k], UP[k] = 0.0, pose[k]
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
            elif i < own:  # offset, Coulomb and viscous friction, rotor, load: `Correction.regressor`
                Y = D = 0.0
                if i % n == j:
                    if i < n:
                        D = 1.0
                    elif i < 2 * n:
                        D = np.tanh(dq[j] / FRICTION_WIDTH)
                    elif i < 3 * n:
                        D = dq[j]
                    elif i < 4 * n:
                        Y = dq[j]
                    else:
                        D = np.tanh(dq[j] / FRICTION_WIDTH)
                        D *= abs(torque[j] - least_friction[j] * D)
            elif i < own + TILTS:
                Y, D = 0.0, leaning[j, i - own]
            else:
                i += 10 - own - TILTS
                Y, D = momentum[j, i], drift[j, i]
            u = D - gain * Y
            if fresh:
                S[j, k], U[j, k] = -gain * Y, u
            S[j, k] = keep * S[j, k] + mix * (u + U[j, k])
            U[j, k] = u
            X[j, k] = gain * Y + S[j, k]
        for k in range(many):
            X[j, wide + k] = P[k]
        for k in range(few):
            if fresh:
                V[j, k], UV[j, k] = 0.0, velocity[j, k]
            V[j, k] = keep * V[j, k] + mix * (velocity[j, k] + UV[j, k])
            UV[j, k] = velocity[j, k]
            X[j, wide + many + k] = V[j, k]
