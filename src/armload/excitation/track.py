"""Motions as control points: a base, a pose or a task's own path, plus quintic splines on stretches of it.

    q(t) = base(t) + Σ_k c_k·B_k(t)

Each stretch has splines of its own that end at rest with it (`motion.spline`): between stretches, and at their ends,
the base stays what it is, up to its acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.motion import Motion
from armload.motion.spline import spline_basis

_FEWEST_SAMPLES = 40


class Sampled(NamedTuple):
    """At evenly spaced instants t (N,), by order of the derivative 0 … 3: the base (N, n) and the splines (N, K)."""

    t: NDArray[np.float64]
    step: float
    base: list[NDArray[np.float64]]
    basis: list[NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Track:
    """A base, how long it lasts [s], and stretches: from, to [s], control points of each joint."""

    base: Motion | NDArray[np.float64]
    lasting: float
    stretches: Sequence[tuple[float, float, int]]

    @property
    def count(self) -> int:
        """Control points K of each joint."""
        return sum(count for _, _, count in self.stretches)

    def basis(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of the splines at times t (N,); (N, K)."""
        out, first = np.zeros((len(t), self.count)), 0
        for begin, end, count in self.stretches:
            within = (t >= begin) & (t <= end)
            out[within, first : first + count] = spline_basis(count, end - begin, t[within] - begin, order)
            first += count
        return out

    def base_at(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of the base at times t (N,); (N, n)."""
        if isinstance(self.base, Motion):
            return self.base.derivative(t, order)
        return np.tile(self.base if order == 0 else np.zeros_like(self.base), (len(t), 1))

    def sampled(self, rate: float) -> Sampled:
        """At `rate` samples per second, more of a short one."""
        t = np.linspace(0.0, self.lasting, round(self.lasting * max(rate, _FEWEST_SAMPLES / self.lasting)) + 1)
        return Sampled(t, float(t[1]), [self.base_at(t, k) for k in range(4)], [self.basis(t, k) for k in range(4)])
