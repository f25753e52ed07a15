"""A straight line in joint space from rest to rest, as slow as wanted: the way to where a motion begins.

    q(t) = a + b(t/T)·(z − a)        b(x) = 10·x³ − 15·x⁴ + 6·x⁵

b' is at most 15/8, |b''| at most 10/√3 and |b'''| at most 60, so that a joint that goes d with at most the velocity v,
the acceleration a and the jerk j needs T ≥ 15/8·d/v, T² ≥ 10/√3·d/a and T³ ≥ 60·d/j.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import MotionError
from armload.motion.blended import QUINTIC
from armload.motion.motion import Motion
from armload.motion.random_fourier import filled_limits
from armload.runtime.real_numbers import own_reals

_FASTEST, _HARDEST, _SHARPEST = 15.0 / 8.0, 10.0 / np.sqrt(3.0), 60.0  # the largest |b'|, |b''| and |b'''|
_SHORTEST = 1.0  # [s] also of a way of no length


@dataclass(frozen=True, eq=False)
class StraightMotion(Motion):
    """A straight line in joint space, at rest at both ends.

    >>> way = StraightMotion([0.0, 1.0], [1.0, 1.0], 2.0)
    >>> way.position([1.0]).tolist()
    [[0.5, 1.0]]

    Args:
        start, stop: (n,) [rad].
        lasting: T [s].
        name: what the motion is called.

    Raises:
        MotionError: poses of different shapes, numbers that are not finite, a time that is not positive.
    """

    start: ArrayLike
    stop: ArrayLike
    lasting: float
    name: str = "straight"

    def __post_init__(self) -> None:
        for name in ("start", "stop"):
            value = own_reals(getattr(self, name), f"{name} of the way {self.name!r}", MotionError)
            object.__setattr__(self, name, value)
        start, stop = np.asarray(self.start), np.asarray(self.stop)
        if start.ndim != 1 or stop.shape != start.shape or not np.all(np.isfinite(start + stop)):
            raise MotionError(f"the way {self.name!r} leads from {self.start} to {self.stop}: expected two poses (n,)")
        if not (np.isfinite(self.lasting) and self.lasting > 0):
            raise MotionError(f"the way {self.name!r} lasts {self.lasting} s: expected a positive time")

    @classmethod
    def slow(cls, arm: Arm, start: ArrayLike, stop: ArrayLike, share: float = 0.2, name: str = "straight") -> Self:
        """The way with at most this share of the arm's limits of velocity, acceleration and jerk.

        Args:
            start, stop: (n,) [rad].
            share: of each limit; what the maker does not give is assumed.
        """
        limits = filled_limits(arm.limits)
        far = np.abs(np.asarray(stop, dtype=float) - np.asarray(start, dtype=float))
        by_speed = np.max(_FASTEST * far / (share * limits.velocity))
        by_push = np.sqrt(np.max(_HARDEST * far / (share * limits.acceleration)))
        by_jerk = np.cbrt(np.max(_SHARPEST * far / (share * limits.jerk)))
        return cls(start, stop, max(float(by_speed), float(by_push), float(by_jerk), _SHORTEST), name)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(np.asarray(self.start))

    @property
    def duration(self) -> float:
        """T [s]."""
        return self.lasting

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        way = np.asarray(self.stop) - np.asarray(self.start)
        out = np.multiply.outer(QUINTIC.deriv(order)(np.asarray(t) / self.lasting) / self.lasting**order, way)
        return out + np.asarray(self.start) if order == 0 else out
