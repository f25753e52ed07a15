"""A motion: where the joints are to be at every instant, with the derivatives the dynamics needs."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Motion(ABC):
    """A joint motion q(t) of an arm with n joints, at rest before t = 0 and after t = duration.

    Subclasses implement `derivative`; calling the motion gives position, velocity and acceleration at once:

    >>> from armload.motion import taie2024
    >>> q, dq, ddq = taie2024()([0.0, 3.0])
    >>> q.shape
    (2, 7)
    """

    name: str

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of joints."""

    @property
    @abstractmethod
    def duration(self) -> float:
        """Time from the start to the end [s]."""

    @abstractmethod
    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,) within [0, duration]; (N, n)."""

    def __call__(self, t: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Position, velocity and acceleration at times t (N,) [s]; each (N, n) [rad, rad/s, rad/s²]."""
        return self._at(t, 0), self._at(t, 1), self._at(t, 2)

    def instants(self, rate: float) -> NDArray[np.float64]:
        """Evenly spaced times (N,) [s] from the start to the end, both among them, `rate` a second or nearly so [Hz].

        >>> from armload.motion import taie2024
        >>> taie2024().instants(0.5).tolist()
        [0.0, 2.0, 4.0, 6.0]
        """
        return np.linspace(0.0, self.duration, max(2, round(self.duration * rate) + 1))

    def position(self, t: ArrayLike) -> NDArray[np.float64]:
        """q at times t (N,) [s]; (N, n) [rad]."""
        return self._at(t, 0)

    def velocity(self, t: ArrayLike) -> NDArray[np.float64]:
        """dq at times t (N,) [s]; (N, n) [rad/s]."""
        return self._at(t, 1)

    def jerk(self, t: ArrayLike) -> NDArray[np.float64]:
        """Third derivative of q at times t (N,) [s]; (N, n) [rad/s³]."""
        return self._at(t, 3)

    def _at(self, t: ArrayLike, order: int) -> NDArray[np.float64]:
        t = np.atleast_1d(np.asarray(t, dtype=float))
        inside = np.clip(t, 0.0, self.duration)
        out = self.derivative(inside, order)
        if order:
            out[t != inside] = 0.0  # the arm waits at the first and at the last position
        return out
