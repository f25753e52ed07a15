"""Blending in and out: a motion that runs at speed, made to start and stop at rest.

    q(t) = f(0) + b(t/d)·(f(t) − f(0))        b(x) = 10·x³ − 15·x⁴ + 6·x⁵ for 0 ≤ x ≤ 1, then 1

and in the same way, backwards in time, at the end. b starts and ends with no slope and no curvature, so that the arm
starts at rest, with no jump of velocity or acceleration, and is on f after d seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion

QUINTIC = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])  # b


@dataclass(frozen=True, eq=False)
class BlendedMotion(Motion):
    """A motion f, from rest with a blend-in and back to rest with a blend-out, `lasting` seconds together.

    >>> from armload.motion import FourierMotion
    >>> f = FourierMotion(np.zeros(1), np.array([[0.3, 0.1]]), np.zeros((1, 2)), period=6.0)
    >>> motion = BlendedMotion(f, lasting=6.5)
    >>> [bool(abs(motion([t])[1]).max() < 1e-12) for t in (0.0, 3.0, 6.5)]
    [True, False, True]

    Args:
        inner: f; its `derivative` is asked for times up to `lasting`, which a Fourier motion has beyond its period.
        lasting: from start to end [s].
        blend: d, how long it takes to come from rest to f, and back [s].

    Raises:
        MotionError: the duration does not hold both blends.
    """

    inner: Motion
    lasting: float
    blend: float = 0.5

    def __post_init__(self) -> None:
        if not (np.isfinite(self.lasting) and self.blend > 0 and self.lasting >= 2 * self.blend):
            raise MotionError(
                f"a motion of {self.lasting} s with blends of {self.blend} s: expected positive times, the motion at "
                "least as long as both blends"
            )

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of f."""
        return self.inner.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.inner.n

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return self.lasting

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,), by Leibniz' rule; (N, n)."""
        t = np.asarray(t, dtype=float)
        out = self.inner.derivative(t, order)
        for rows, edge, sign in ((t < self.blend, 0.0, 1.0), (t > self.duration - self.blend, self.duration, -1.0)):
            if not np.any(rows):
                continue
            at = t[rows]
            rest = self.inner.derivative(np.array([edge]), 0)
            parts = [self.inner.derivative(at, k) for k in range(order + 1)]
            parts[0] = parts[0] - rest
            x, slope = sign * (at - edge) / self.blend, sign / self.blend
            weights = [QUINTIC.deriv(k)(x) * slope**k for k in range(order + 1)]
            mixed = sum(comb(order, k) * weights[k][:, None] * parts[order - k] for k in range(order + 1))
            out[rows] = mixed + rest if order == 0 else mixed
        return out
