"""Rows of the acceleration-free filtered regression, from one sample or many: the one maker for every method.

The load torque tau_L = tau_J − tau_bare equals d/dt(Y_p·phi) + (Y_g − Y_c)·phi. The first-order lag F = λ/(s + λ) on
both sides removes the derivative:

    r = F[tau_J − tau_bare] = W·phi,      W = λ·(Y_p − F[Y_p]) + F[Y_g − Y_c] = λ·Y_p + F[Y_g − Y_c − λ·Y_p]

exactly, if F[Y_p] starts at Y_p(0) and the other lags at 0. The bare arm enters the same way through its momentum, so
neither q̈ nor a derivative of a measured signal occurs. What else a row may hold passes the same lag:

    r = W·phi + Z·eta + G·g + e        X = [W Z G] (n, 10 + p + R)

eta is the arm's rigid mismatch (`mismatch.py`), g are each joint's weights of its smooth features (`features.py`). The
lag is discretised by the bilinear rule; torque is lagged at its full rate, the rest at the rate of the rows
(`row_kernels.py`).

Sources: Hsu, Bodson, Sastry, Paden 1987; Middleton & Goodwin 1988; Slotine & Li 1989.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.arms.momentum_row import MomentumRow
from armload.errors import IdentificationError
from armload.recording import JITTERED
from armload.regression.features import JointFeatures
from armload.regression.lag import GAIN, checked_gain
from armload.regression.mismatch import Correction
from armload.regression.row_kernels import FRESH, lag_torque, lag_torques, make_row, make_rows

REGRESSOR_RATE = 200.0  # [Hz] rows are made no more often where a rate is set: they hold nothing above a few hertz
SPACING = JITTERED / REGRESSOR_RATE  # [s] between rows at least


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

    Raises:
        IdentificationError: see `checked_gain`.
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
        self.arm, self.gain = arm, checked_gain(gain)
        self._momentum = MomentumRow(arm)
        self._torque_gain = None if mismatch is None else mismatch.gain
        self._links = np.ascontiguousarray(arm.link_parameters.ravel())
        self._turned = np.cross(arm.horizontal, arm.gravity)  # how gravity changes with each angle
        self._waves, self._velocity_waves = np.zeros((0, arm.n)), np.zeros(0)
        if features is not None and features.size:
            self._waves, self._velocity_waves = features.waves, features.velocity_waves
        self._wide = 10 + (0 if mismatch is None else mismatch.size)
        apart = -1.0 if rate is None else SPACING * REGRESSOR_RATE / rate
        known = np.zeros((2, arm.n)) if mismatch is None else np.array([mismatch.presliding, mismatch.least_friction])
        self._settings = np.array([gain, apart, settling, *known.ravel()])
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next sample is the first."""
        n, pose, velocity = self.arm.n, 2 * len(self._waves), 2 * len(self._velocity_waves)
        # times of the last sample, of the last row; how long the pose of rest was seen; what the last row stands for
        self._clock = np.full(4, -np.inf)
        self._joints = np.full((5, n), np.nan)  # lagged torque, last torque; of the bare arm; the pose of rest
        self._regressor = np.zeros((2, n, self._wide))  # states of the lags, their last inputs
        self._pose, self._velocity = np.zeros((2, pose)), np.zeros((2, n, velocity))

    @property
    def presliding(self) -> NDArray[np.float64]:
        """By how much the variance (n,) of each joint's residual is larger at rest; it may be set."""
        return self._settings[3 : 3 + self.arm.n]

    @property
    def state(self) -> tuple[NDArray[np.float64], ...]:
        """A copy of all that is remembered of the samples so far; set it, and the next samples go on from there."""
        return tuple(x.copy() for x in (self._clock, self._joints, self._regressor, self._pose, self._velocity))

    @state.setter
    def state(self, state: tuple[NDArray[np.float64], ...]) -> None:
        self._clock, self._joints, self._regressor, self._pose, self._velocity = (x.copy() for x in state)

    def rows(self, t: ArrayLike, q: ArrayLike, dq: ArrayLike, tau: ArrayLike) -> Rows:
        """The rows that the next N samples complete: t (N,) rising [s]; q, dq, tau (N, n) [rad, rad/s, N·m].

        Raises:
            IdentificationError: arrays of other shapes.
        """
        times = np.require(np.atleast_1d(t), float, ["C", "W"])
        poses, dq, tau = (np.require(np.atleast_2d(x), float, ["C", "W"]) for x in (q, dq, tau))
        self._check((len(times), self.arm.n), poses, dq, tau)
        index, steps, fresh, torque = lag_torques(times, tau, self._settings, self._clock, self._joints)
        times, poses = times[index], poses[index]
        return Rows(times, poses, *self._scaled(*make_rows(poses, dq[index], torque, steps, fresh, *self._known())))

    def row(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> Row | None:
        """The row that a sample completes, if it does; q, dq, tau (n,).

        Raises:
            IdentificationError: arrays of other shapes.
        """
        self._check((self.arm.n,), q, dq, tau)
        done = lag_torque(t, _writable(tau), self._settings, self._clock, self._joints)
        if not done:
            return None
        q, dq = _writable(q), _writable(dq)
        return Row(t, q, *self._scaled(*make_row(q, dq, done == FRESH, *self._known())))

    def __call__(
        self, t: ArrayLike, q: ArrayLike, dq: ArrayLike, tau: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """r (M, n) [N·m] and X (M, n, size) of the rows that the next N samples complete."""
        rows = self.rows(t, q, dq, tau)
        return rows.r, rows.X

    def _check(self, shape: tuple[int, ...], q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Compiled code reads as many numbers as there should be."""
        if not q.shape == dq.shape == tau.shape == shape:
            raise IdentificationError(
                f"q, dq and tau have shapes {q.shape}, {dq.shape} and {tau.shape}: expected {shape}, a number for each "
                f"joint of {self.arm.name} at each time"
            )

    def _known(self) -> tuple:
        """What the kernels of rows need besides samples: settings, the arm, and the states of the lags."""
        arm = (*self._momentum.chain, self._turned, self._links, self._waves, self._velocity_waves)
        return self._settings, *arm, self._clock, self._joints, self._regressor, self._pose, self._velocity

    def _scaled(self, h: Any, X: NDArray, r: NDArray, weights: NDArray) -> tuple:
        """Rows with the payload's torque as the joints' sensors show it."""
        if self._torque_gain is not None:
            X[..., :10] *= self._torque_gain[:, None]
        return h, X, r, weights


def _writable(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compiled code is compiled once: for arrays that can be written."""
    return x if x.flags.writeable else x.copy()
