"""The acceleration-free filtered regression r = W·phi.

The load torque tau_L = tau_J − tau_bare equals d/dt(Y_p·phi) + (Y_g − Y_c)·phi. The first-order lag F = λ/(s + λ) on
both sides removes the derivative:

    r = F[tau_J − tau_bare] = W·phi,      W = λ·(Y_p − F[Y_p]) + F[Y_g − Y_c] = λ·Y_p + F[Y_g − Y_c − λ·Y_p]

exactly, if F[Y_p] starts at Y_p(0) and the other lags at 0. The bare arm enters the same way through its momentum, so
neither q̈ nor a derivative of a measured signal occurs. The lag is discretised by the bilinear rule.

Sources: Hsu, Bodson, Sastry, Paden 1987; Middleton & Goodwin 1988; Slotine & Li 1989.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm, momentum_regressor


@njit(cache=True)
def _lag(u: NDArray, h: NDArray, gain: float, state: NDArray, last: NDArray) -> NDArray:
    out = np.empty_like(u)
    for k in range(u.shape[0]):
        x = gain * h[k]
        for i in range(u.shape[1]):
            state[i] = ((2.0 - x) * state[i] + x * (u[k, i] + last[i])) / (2.0 + x)
            last[i] = u[k, i]
            out[k, i] = state[i]
    return out


class Lag:
    """A first-order lag y = λ/(s + λ)·u fed in pieces, at any sample times (bilinear rule, constant memory).

    Args:
        gain: λ [1/s].
    """

    def __init__(self, gain: float) -> None:
        self.gain = gain
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next sample is the first."""
        self._state: NDArray | None = None

    def __call__(self, t: ArrayLike, u: ArrayLike, initial: ArrayLike | None = None) -> NDArray[np.float64]:
        """The lagged signal at the times t (N,) of u (N, ...); `initial` (...) is y at the very first sample."""
        t, u = np.asarray(t, dtype=float), np.asarray(u, dtype=float)
        flat = np.ascontiguousarray(u.reshape(len(u), -1))
        if self._state is None:
            self._t = t[0]
            self._last = flat[0].copy()
            self._state = np.zeros(flat.shape[1]) if initial is None else np.array(initial, dtype=float).ravel()
        h = np.diff(t, prepend=self._t)
        out = _lag(flat, h, self.gain, self._state, self._last)
        self._t = t[-1]
        return out.reshape(u.shape)


def first_order_lag(t: ArrayLike, u: ArrayLike, gain: float, initial: ArrayLike | None = None) -> NDArray[np.float64]:
    """F[u] for a whole signal: y' = λ·(u − y), bilinear rule, y(t₀) = initial (default 0).

    Args:
        t: (N,) [s], increasing, not necessarily even.
        u: (N, ...).
        gain: λ [1/s].
        initial: shape of u[0].

    >>> t = np.arange(0, 1, 1e-3)
    >>> float(first_order_lag(t, np.ones((len(t), 1)), gain=10.0)[-1, 0].round(4))  # 1 − e^(−λt)
    1.0
    """
    return Lag(gain)(t, u, initial)


class FilteredRegression:
    """Turns samples (t, q, dq, tau) into rows (r, W) of the regression r = W·phi, a piece at a time.

    Args:
        arm: the bare arm (with whatever is `attached`).
        gain: λ of the lag [1/s]; the observer gain of a momentum observer.
    """

    def __init__(self, arm: Arm, gain: float = 20.0) -> None:
        self.arm, self.gain = arm, gain
        self._torque, self._regressor = Lag(gain), Lag(gain)

    def reset(self) -> None:
        """Start anew, as after a gap in the log."""
        self._torque.reset()
        self._regressor.reset()

    def __call__(
        self, t: ArrayLike, q: ArrayLike, dq: ArrayLike, tau: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """r (N, n) [N·m] and W (N, n, 10) of the next N samples."""
        t, q, dq, tau = np.atleast_1d(t), np.atleast_2d(q), np.atleast_2d(dq), np.atleast_2d(tau)
        p, drift = self.arm.momentum(q, dq)
        r = self._torque(t, tau - drift + self.gain * p, initial=self.gain * p[0]) - self.gain * p
        Y = momentum_regressor(self.arm.frame_motion(q), dq)
        W = filtered_regressor(t, Y.momentum, Y.drift, self._regressor)
        return r, W


def filtered_regressor(t: ArrayLike, momentum: NDArray, drift: NDArray, lag: Lag) -> NDArray[np.float64]:
    """W = λ·Y_p + F[Y_g − Y_c − λ·Y_p] for any momentum form (payload, link parameters, motor inertia)."""
    gain = lag.gain
    return gain * momentum + lag(t, drift - gain * momentum, initial=-gain * momentum[0])
