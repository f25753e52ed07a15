"""A commanded motion that can be changed while the robot runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.motion import Motion

_KEPT = 1.0  # [s] for which what was commanded can still be asked for: samples are published up to 0.04 s after


class CommandedMotion(Motion):
    """A motion without an end that can be replaced by another at any time.

    A simulator asks ahead, for a piece at a time: what it has asked for is not changed any more, and a new order begins
    there. What was commanded during the last second can be asked for again.

    >>> from armload.motion import taie2024
    >>> commanded = CommandedMotion(taie2024())
    >>> commanded.position([0.0, 1.0]).shape, commanded.order(taie2024())
    ((2, 7), 1.0)

    Args:
        motion: the first order, from t = 0 on; after its end the robot stands.

    Attributes:
        asked: up to when the simulator has asked for it [s].
    """

    name = "commanded"

    def __init__(self, motion: Motion) -> None:
        self._orders: list[tuple[float, Motion]] = [(0.0, motion)]
        self.asked = 0.0

    @property
    def n(self) -> int:
        """Number of joints."""
        return self._orders[0][1].n

    @property
    def duration(self) -> float:
        """Infinite [s]."""
        return float("inf")

    @property
    def state(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Position, velocity and acceleration (n,) where a new order would begin [rad, rad/s, rad/s²]."""
        q, dq, ddq = self([self.asked])
        return q[0], dq[0], ddq[0]

    def order(self, motion: Motion) -> float:
        """Do this from now on; returns when that is [s]. It should begin as `state` says."""
        begun = [each for each in self._orders if each[0] < self.asked]  # what never began is forgotten
        over = sum(end < self.asked - _KEPT for end, _ in begun[1:])
        self._orders = [*begun[over:], (self.asked, motion)]
        return self.asked

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        self.asked = max(self.asked, float(np.max(t)))
        out = np.empty((len(t), self.n))
        for k, (begin, motion) in enumerate(self._orders):
            rows = t >= begin if k else np.full(len(t), True)
            out[rows] = motion._at(t[rows] - begin, order)
        return out
