"""A motion on its way: it runs as given until it is told to brake, and then comes to rest along its own path.

Braking slows the motion's own time s down, so that the arm never leaves the path that was checked:

    q(t) = f(s(t)),   ds/dt = v = 1 − 3·x² + 2·x³,   x = (t − t_0)/T        from t_0 on, until v = 0 at x = 1

    q̇ = f'·v      q̈ = f''·v² + f'·v̇      q⃛ = f'''·v³ + 3·f''·v·v̇ + f'·v̈

T is the shortest with which no joint passes its limits of acceleration and jerk (or 1.05 times what the motion itself
asks where that is more); it is found for all instants of the motion beforehand, so that nothing is left to compute when
it counts. Velocity only falls. Where v̇ = 0 the torque lies between that of standing and that of the motion; what
braking adds is bounded by the limits of acceleration.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Limits
from armload.errors import MotionError
from armload.motion.motion import Motion
from armload.motion.random_fourier import filled_limits

_GRID = 2e-3  # [s] of path time between the instants that are looked at
_STARTS = 10e-3  # [s] between instants for which the braking time is found; between two of them the longer counts
_TIMES = 0.02 * 1.08 ** np.arange(72)  # [s] braking times tried: 20 ms to 4.7 s
_X = np.linspace(0.0, 1.0, 33)
_OWN = 1.05  # of the motion's own acceleration and jerk are allowed where that is more than the limit


class Course(Motion):
    """A motion that can be braked.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> course = Course(taie2024(), arm("panda").limits)
    >>> rest = course.brake(2.0)
    >>> bool(2.0 < rest < 2.5), bool(abs(course.velocity([rest])).max() < 1e-12), rest == course.duration
    (True, True, True)

    Args:
        motion: from rest to rest.
        limits: of the arm; what its maker does not give is assumed (`filled_limits`).

    Attributes:
        motion: as given.
        braked: when braking began, or the arm stood [s]; None: it did not.
    """

    def __init__(self, motion: Motion, limits: Limits) -> None:
        self.motion, self.name = motion, motion.name
        self.braked: float | None = None
        self._stood: float | None = None
        self._lasting = 0.0
        self._starts, self._times = _braking_times(motion, filled_limits(limits))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.motion.n

    @property
    def duration(self) -> float:
        """When the arm is at rest for good [s]."""
        if self._stood is not None:
            return self._stood
        return self.motion.duration if self.braked is None else min(self.motion.duration, self.braked) + self._lasting

    def braking_time(self, t: float) -> float:
        """How long it takes to come to rest from the instant t on [s]."""
        k = int(np.searchsorted(self._starts, t))
        return float(np.max(self._times[max(0, k - 1) : k + 1])) if t < self.motion.duration else 0.0

    def brake(self, t: float) -> float:
        """Come to rest from the instant t on; returns when that is reached [s]. What has begun is not begun again."""
        if self.braked is None:
            self._lasting = self.braking_time(t)
            self.braked = float(t)
        return self.duration

    def stand(self, t: float) -> None:
        """Stay where it is at the instant t, without a way to rest: for an arm that stands there already."""
        self._stood = min(float(t), self.duration)
        self.braked = self._stood if self.braked is None else self.braked

    def progress(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """The motion's own time s at times t (N,) [s]."""
        return self._clock(np.asarray(t, dtype=float))[0]

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        if order > 3:
            raise MotionError(f"derivative of order {order} of a course: expected at most 3")
        if self.braked is None:
            return self.motion._at(t, order)
        s, v, a, j = (x[:, None] if k else x for k, x in enumerate(self._clock(np.asarray(t, dtype=float))))
        if order == 0:
            return self.motion._at(s, 0)
        first = self.motion._at(s, 1)
        if order == 1:
            return first * v
        second = self.motion._at(s, 2)
        if order == 2:
            return second * v**2 + first * a
        return self.motion._at(s, 3) * v**3 + 3.0 * second * v * a + first * j

    def _clock(self, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """s and its first three derivatives at times t (N,)."""
        if self._stood is None:
            return self._under_way(t)
        s, *rates = self._under_way(np.minimum(t, self._stood))
        return s, *(np.where(t <= self._stood, rate, 0.0) for rate in rates)

    def _under_way(self, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        if self.braked is None or self._lasting == 0.0:
            return np.minimum(t, self.motion.duration), np.ones_like(t), np.zeros_like(t), np.zeros_like(t)
        T, start = self._lasting, self.braked
        x = np.clip((t - start) / T, 0.0, 1.0)
        early, inside = t <= start, (t > start) & (t < start + T)
        s = np.where(early, t, start + T * _passed(x))
        v = np.where(early, 1.0, 1.0 - 3.0 * x**2 + 2.0 * x**3)
        a = np.where(inside, -6.0 * x * (1.0 - x) / T, 0.0)
        return s, v, a, np.where(inside, (12.0 * x - 6.0) / T**2, 0.0)


def _passed(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """The integral of v over x."""
    return x - x**3 + 0.5 * x**4


def _braking_times(motion: Motion, limits: Limits) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Instants (K,) and the shortest braking time from each, (K,) [s]."""
    t = motion.instants(1.0 / _GRID)
    step = float(t[1])
    d1, d2, d3 = (motion._at(t, order) for order in (1, 2, 3))
    push = np.maximum(limits.acceleration, _OWN * np.abs(d2).max(axis=0))
    jerk = np.maximum(limits.jerk, _OWN * np.abs(d3).max(axis=0))
    rows = np.unique(np.append(np.arange(0, len(t), max(1, round(_STARTS / step))), len(t) - 1))
    times, left = np.full(len(rows), _TIMES[-1]), np.arange(len(rows))
    v = (1.0 - 3.0 * _X**2 + 2.0 * _X**3)[None, :, None]
    for T in _TIMES.tolist():
        a = (-6.0 * _X * (1.0 - _X) / T)[None, :, None]
        j = ((12.0 * _X - 6.0) / T**2)[None, :, None]
        at = np.minimum(rows[left][:, None] + np.rint(T * _passed(_X) / step).astype(int), len(t) - 1)
        f1, f2, f3 = d1[at], d2[at], d3[at]
        hard = np.any(np.abs(f2 * v**2 + f1 * a) > push, axis=(1, 2))
        hard |= np.any(np.abs(f3 * v**3 + 3.0 * f2 * v * a + f1 * j) > jerk, axis=(1, 2))
        times[left[~hard]] = T
        left = left[hard]
        if not len(left):
            break
    return t[rows], times
