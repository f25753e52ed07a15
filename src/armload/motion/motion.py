"""A motion: where the joints are to be at every instant, with the derivatives the dynamics needs."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import MotionError
from armload.runtime.real_numbers import reals

# of a piece, where a check looks: half way a quintic from rest to rest is fastest, near a fifth it accelerates most
_WITHIN = np.array([0.0, 0.2, 0.5, 0.8])
SAME_PLACE, SAME_SPEED = 1e-3, 1e-2  # [rad, rad/s] jumps that a controller does not notice


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

        Raises:
            MotionError: the rate is not a positive number of Hz.
        """
        if not (0.0 < rate < np.inf):
            raise MotionError(f"a rate of {rate!r} Hz: expected a positive number")
        return np.linspace(0.0, self.duration, max(2, round(self.duration * rate) + 1))

    def looked_at(self, rate: float) -> NDArray[np.float64]:
        """Times (N,) [s], rising, at which a check looks: `instants`, and the seams and within each piece.

        Between two points of a table an arm may be faster than at either.
        """
        seams = self.seams()
        pieces = seams[:-1, None] + np.diff(seams)[:, None] * _WITHIN
        return np.unique(np.concatenate([self.instants(rate), pieces.ravel()]))

    def seams(self) -> NDArray[np.float64]:
        """Times (K,) [s], rising, of the points between which the motion is made of pieces; none, if it is not."""
        return np.empty(0)

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
        try:
            t = np.atleast_1d(reals(t))
        except ValueError as error:
            raise MotionError(f"the times are {error}: expected seconds (N,)") from None
        if t.ndim != 1 or np.isnan(t).any():
            raise MotionError(f"the times have shape {t.shape} or hold one that is no number: expected seconds (N,)")
        inside = np.clip(t, 0.0, self.duration)
        out = self.derivative(inside, order)
        if order:
            out[t != inside] = 0.0  # the arm waits at the first and at the last position
        return out
