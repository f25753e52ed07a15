"""The first-order lag F = λ/(s + λ), discretised by the bilinear rule."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import IdentificationError
from armload.runtime.kernels import kernel

# λ [1/s], a lag of 50 ms: slow against the joints' vibration (15 Hz and more) and the sensors' skew, fast against the
# motion and a change of payload. What the lag takes from r it takes from W, exactly: the choice costs noise, no bias
GAIN = 20.0


@kernel
def _lag(u: NDArray, h: NDArray, gain: float, state: NDArray, last: NDArray) -> NDArray:
    out = np.empty_like(u)
    for k in range(u.shape[0]):
        x = gain * h[k]
        for i in range(u.shape[1]):
            state[i] = ((2.0 - x) * state[i] + x * (u[k, i] + last[i])) / (2.0 + x)
            last[i] = u[k, i]
            out[k, i] = state[i]
    return out


def checked_gain(gain: float) -> float:
    """λ [1/s] of a lag, as it was given.

    Raises:
        IdentificationError: it is no finite number above zero.
    """
    if not (isinstance(gain, Real) and 0.0 < gain < np.inf):
        raise IdentificationError(f"gain is {gain!r}: expected the lag's λ, a number above 0 [1/s]")
    return float(gain)


class Lag:
    """A first-order lag y = λ/(s + λ)·u fed in pieces, at any sample times (bilinear rule, constant memory).

    Args:
        gain: λ [1/s].

    Raises:
        IdentificationError: see `checked_gain`.
    """

    def __init__(self, gain: float) -> None:
        self.gain = checked_gain(gain)
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
