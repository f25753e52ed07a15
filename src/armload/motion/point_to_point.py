"""Point-to-point motion: from pose to pose with stops, what robots do all day.

Every segment moves all joints together along a straight line in joint space, q = a + s(x)·(b − a), x = 0 … 1, with a
trapezoid of speed whose ramps are smooth:

    s'(x) = V·(3u² − 2u³), u = x/r, on the ramp x ≤ r;   V = 1/(1 − r) after it;   mirrored at the end

so that speed and acceleration start and end at zero. r = ½ leaves no time at full speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion
from armload.runtime.real_numbers import own_reals

_RAMP = np.polynomial.Polynomial([0.0, 0.0, 0.0, 1.0, -0.5])  # the integral of 3u² − 2u³


@dataclass(frozen=True, eq=False)
class PointToPoint(Motion):
    """Straight segments in joint space from pose to pose, and waiting in between.

    >>> motion = PointToPoint(np.array([[0.0], [1.0]]), starts=np.array([0.5]), ends=np.array([1.5]))
    >>> [round(float(motion([t])[0][0, 0]), 3) for t in (0.0, 1.0, 2.0)]
    [0.0, 0.5, 1.0]

    Args:
        poses: (S + 1, n) [rad].
        starts, ends: when the arm leaves pose k and when it is at pose k + 1, (S,) each [s].
        ramp: r, share of a segment's time to come to speed, and again to come to rest: above 0, at most ½.
        name: what the motion is called.

    Raises:
        MotionError: shapes that do not fit, numbers that are not finite, segments out of order, or a ramp out of range.
    """

    poses: NDArray[np.float64]
    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    ramp: float = 0.4
    name: str = "point-to-point"

    def __post_init__(self) -> None:
        for name in ("poses", "starts", "ends"):
            value = own_reals(getattr(self, name), f"{name} of the motion {self.name!r}", MotionError)
            object.__setattr__(self, name, value)
        segments = len(self.poses) - 1
        if self.poses.ndim != 2 or segments < 1 or not self.starts.shape == self.ends.shape == (segments,):
            raise MotionError(
                f"the motion {self.name!r} has poses of shape {self.poses.shape}, {self.starts.shape} starts and "
                f"{self.ends.shape} ends: expected (S + 1, n), (S,) and (S,)"
            )
        times = np.stack([self.starts, self.ends], axis=1).ravel()
        if not (np.all(np.isfinite(self.poses)) and times[0] >= 0 and np.all(np.diff(times)[::2] > 0)):
            raise MotionError(f"the motion {self.name!r} has a pose or a time that cannot be: expected finite numbers")
        if np.any(np.diff(times) < 0):
            raise MotionError(f"the motion {self.name!r} leaves a pose before it is there: expected times in order")
        if not 0 < self.ramp <= 0.5:
            raise MotionError(
                f"the motion {self.name!r} has a ramp of {self.ramp}: expected a share above 0, at most ½"
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.poses.shape[1]

    @property
    def duration(self) -> float:
        """From the start to the last arrival [s]."""
        return float(self.ends[-1])

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n). Waiting, all but q are zero."""
        t = np.asarray(t, dtype=float)
        k = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, None)
        lasts = self.ends[k] - self.starts[k]
        x = np.clip((t - self.starts[k]) / lasts, 0.0, 1.0)
        a, b = self.poses[k], self.poses[k + 1]
        if order == 0:
            return a + self._progress(x, 0)[:, None] * (b - a)
        moving = (x > 0) & (x < 1)
        return (np.where(moving, self._progress(x, order), 0.0) / lasts**order)[:, None] * (b - a)

    def _progress(self, x: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of s of the given order at x (N,)."""
        r, speed = self.ramp, 1.0 / (1.0 - self.ramp)
        early = x <= 0.5
        u = np.where(early, x, 1.0 - x)  # s(x) = 1 − s(1 − x)
        cruise = (speed * (u - r / 2), np.full_like(u, speed))[order] if order < 2 else np.zeros_like(u)
        out = np.where(u < r, speed * r ** (1 - order) * _RAMP.deriv(order)(u / r), cruise)
        if order == 0:
            return np.where(early, out, 1.0 - out)
        return np.where(early, out, (-1) ** (order + 1) * out)
