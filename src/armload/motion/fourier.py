"""Fourier excitation: every joint moves on a finite sum of sines and cosines of one base frequency.

    q_i(t) = q_i0 + sum_k rho_ik·sin(2·pi·k·f·t) + delta_ik·cos(2·pi·k·f·t),   f = 1/T, k = 1 … K

Source: Taie et al., RA-L 2024, equations (5) and (6). Starting and stopping at rest needs no extra blending: it is a
property of the coefficients. At t = 0 and t = T the velocity is 2·pi·f·sum_k k·rho_ik and the acceleration
−(2·pi·f)²·sum_k k²·delta_ik, so both vanish on the linear subspace

    sum_k k·rho_ik = 0        sum_k k²·delta_ik = 0        for every joint i.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion
from armload.runtime.real_numbers import own_reals


@dataclass(frozen=True, eq=False)
class FourierMotion(Motion):
    """One period of the excitation of equations (5) and (6).

    >>> motion = FourierMotion(np.zeros(1), np.array([[0.2, -0.1]]), np.zeros((1, 2)), period=6.0)
    >>> [float(x[0, 0].round(4)) for x in motion([1.5])]
    [0.2, 0.2094, -0.2193]
    >>> bool(abs(motion([6.0])[1]).max() < 1e-12)  # sum_k k·rho_k = 0: at rest at the end
    True

    Args:
        offset: q_0, shape (n,) [rad].
        sine, cosine: rho and delta, shape (n, K) [rad].
        period: T [s]; the motion lasts one period.
        name: what the motion is called in logs, artefacts and exports.
        note: where it comes from, in a sentence.

    Raises:
        MotionError: shapes that do not fit, a number that is not finite, a period that is not positive.
    """

    offset: NDArray[np.float64]
    sine: NDArray[np.float64]
    cosine: NDArray[np.float64]
    period: float
    name: str = "fourier"
    note: str = ""

    def __post_init__(self) -> None:
        for name, dims in (("offset", 1), ("sine", 2), ("cosine", 2)):
            value = own_reals(getattr(self, name), f"{name} of the motion {self.name!r}", MotionError)
            if value.ndim != dims or value.size == 0 or not np.all(np.isfinite(value)):
                expected = "(n,)" if dims == 1 else "(n, K)"
                raise MotionError(
                    f"{name} of the motion {self.name!r} has shape {value.shape}: expected {expected}, finite, in rad"
                )
            object.__setattr__(self, name, value)
        if self.sine.shape != self.cosine.shape or len(self.sine) != len(self.offset):
            raise MotionError(
                f"the motion {self.name!r} has {self.offset.shape} offsets, {self.sine.shape} sine and "
                f"{self.cosine.shape} cosine coefficients: expected (n,), (n, K) and (n, K)"
            )
        if not (np.isfinite(self.period) and self.period > 0):
            raise MotionError(
                f"the motion {self.name!r} has period {self.period}: expected a positive number of seconds"
            )
        object.__setattr__(self, "period", float(self.period))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.offset)

    @property
    def harmonics(self) -> int:
        """Number of harmonics K."""
        return self.sine.shape[1]

    @property
    def duration(self) -> float:
        """One period T [s]."""
        return self.period

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of any order ≥ 0 at times t (N,); (N, n).

        Each derivative multiplies by omega_k = 2·pi·k·f and turns the phase by a quarter:
        d^m/dt^m sin(omega·t) = omega^m·sin(omega·t + m·pi/2).
        """
        omega = 2.0 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        angle = np.multiply.outer(np.asarray(t, dtype=float), omega)  # (N, K)
        s, c = np.sin(angle), np.cos(angle)
        s, c = ((s, c), (c, -s), (-s, -c), (-c, s))[order % 4]
        scale = omega**order
        out = (s * scale) @ self.sine.T + (c * scale) @ self.cosine.T
        return out + self.offset if order == 0 else out

    def smooth(self) -> FourierMotion:
        """The nearest motion (least change of the coefficients) that starts and stops at rest with no acceleration."""
        sine, cosine = start_and_stop_at_rest(self.sine, self.cosine)
        return replace(self, sine=sine, cosine=cosine)

    def scaled(self, factor: float | ArrayLike) -> FourierMotion:
        """The motion with all amplitudes, or each joint's (n,), multiplied; offsets and rest at the ends stay."""
        factor = own_reals(factor, "the factor", MotionError)
        if factor.shape not in ((), (self.n,)):
            raise MotionError(
                f"the factor has shape {factor.shape}: expected one number or {self.n}, one for each joint"
            )
        factor = np.broadcast_to(factor, (self.n,))[:, None]
        return replace(self, sine=self.sine * factor, cosine=self.cosine * factor)


def start_and_stop_at_rest(sine: ArrayLike, cosine: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Project coefficients (n, K) orthogonally onto sum_k k·rho_ik = 0 and sum_k k²·delta_ik = 0.

    >>> start_and_stop_at_rest([[1.0, 0.0]], [[0.0, 0.0]])[0].round(3)
    array([[ 0.8, -0.4]])

    Raises:
        MotionError: other shapes, or no numbers.
    """
    sine, cosine = (own_reals(x, "a table of coefficients", MotionError) for x in (sine, cosine))
    if sine.ndim != 2 or sine.size == 0 or cosine.shape != sine.shape:
        raise MotionError(f"coefficients of shapes {sine.shape} and {cosine.shape}: expected (n, K) of both")
    k = np.arange(1.0, sine.shape[-1] + 1.0)
    return sine - np.outer(sine @ k, k) / (k @ k), cosine - np.outer(cosine @ k**2, k**2) / (k**2 @ k**2)
