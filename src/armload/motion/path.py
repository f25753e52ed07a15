"""A path through many points with their velocities and accelerations: quintics from point to point.

Between two points each joint follows the polynomial of degree 5 with position, velocity and acceleration of both, as
ROS 2's joint trajectory controller does: q, dq and ddq are continuous.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from math import factorial
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.as_written import not_too_long
from armload.motion.motion import Motion
from armload.recording.templates import abridged
from armload.runtime.real_numbers import own_reals


@dataclass(frozen=True, eq=False)
class PathMotion(Motion):
    """Quintics through points.

    >>> still = np.zeros((2, 1))
    >>> motion = PathMotion(np.array([0.0, 2.0]), np.array([[0.0], [1.0]]), still, still)
    >>> [round(float(motion([t])[0][0, 0]), 3) for t in (0.0, 0.5, 1.0, 2.0)]
    [0.0, 0.104, 0.5, 1.0]

    Args:
        times: (K,) [s], from 0, rising.
        positions, velocities, accelerations: (K, n) each [rad, rad/s, rad/s²].
        name, note: what it is called, where it comes from.

    Raises:
        MotionError: fewer than two points, shapes that do not fit, numbers that are not finite, times that do not rise.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]
    name: str = "path"
    note: str = ""

    def __post_init__(self) -> None:
        for name in ("times", "positions", "velocities", "accelerations"):
            value = own_reals(getattr(self, name), f"{name} of the path {self.name!r}", MotionError)
            object.__setattr__(self, name, value)
        points = (self.positions, self.velocities, self.accelerations)
        shape = self.positions.shape
        if self.times.ndim != 1 or len(self.times) < 2 or any(x.shape != shape for x in points):
            raise MotionError(
                f"the path {self.name!r} has {self.times.shape} times and points of shapes {[x.shape for x in points]}"
                ": expected (K,) with K of 2 or more, and (K, n) each"
            )
        if len(shape) != 2 or shape[0] != len(self.times) or shape[1] == 0:
            raise MotionError(f"the path {self.name!r} has {len(self.times)} times for points of shape {shape}")
        if not all(np.all(np.isfinite(x)) for x in (self.times, *points)):
            raise MotionError(f"the path {self.name!r} has a number that is not finite")
        if self.times[0] != 0.0 or np.any(np.diff(self.times) <= 0.0):
            raise MotionError(f"the times of the path {self.name!r} do not rise from 0")

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.positions.shape[1]

    @property
    def duration(self) -> float:
        """Of the last point [s]."""
        return float(self.times[-1])

    @classmethod
    def of(cls, motion: Motion, rate: float = 100.0, name: str | None = None, note: str = "") -> PathMotion:
        """Another motion at so many points per second [Hz]."""
        t = motion.instants(rate)
        q, dq, ddq = (motion.derivative(t, order) for order in range(3))
        return cls(t, q, dq, ddq, motion.name if name is None else name, note)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """The table that `export_motion` writes as CSV: a header, then t, q1 … qn, dq1 … dqn, ddq1 … ddqn.

        Raises:
            MotionError: the file is missing or is not such a table, or lasts more than an hour.
        """
        try:
            with open(path, newline="", encoding="utf-8-sig") as file:
                header, *rows = list(csv.reader(file))
            table = np.array(rows, dtype=float)
        except OSError as error:
            raise MotionError(f"motion file {path} cannot be read: {error.strerror}") from None
        except (ValueError, csv.Error):
            raise MotionError(f"motion file {path} is not a table of numbers under a header") from None
        if not _is_header(header) or table.ndim != 2:
            raise MotionError(
                f"motion file {path} has the columns {abridged(header)}: expected t, q1 …, dq1 …, ddq1 … as "
                "`armload motion export --format csv` writes them; of a log, see `armload motion check`"
            )
        q, dq, ddq = np.split(table[:, 1:], 3, axis=1)
        return not_too_long(cls(table[:, 0], q, dq, ddq, str(path)))

    @staticmethod
    def is_table(path: str | Path) -> bool:
        """Whether a file begins as such a table does: it has accelerations, and no torque as a log has."""
        try:
            with open(path, newline="", encoding="utf-8-sig") as file:
                return _is_header(next(csv.reader(file), []))
        except (OSError, ValueError, csv.Error):
            return False

    def seams(self) -> NDArray[np.float64]:
        """The points' times [s]."""
        return self.times

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of any order ≥ 0 at times t (N,) within 0 … the last; (N, n)."""
        t = np.asarray(t, dtype=float)
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        h, s = (self.times[k + 1] - self.times[k])[:, None], (t - self.times[k])[:, None]
        q, v, a = self.positions[k], self.velocities[k], self.accelerations[k]
        d = self.positions[k + 1] - (q + v * h + a * h**2 / 2)
        e, f = (self.velocities[k + 1] - v - a * h) * h, (self.accelerations[k + 1] - a) * h**2
        parts = [
            q,
            v,
            a / 2,
            (10 * d - 4 * e + f / 2) / h**3,
            (-15 * d + 7 * e - f) / h**4,
            (6 * d - 3 * e + f / 2) / h**5,
        ]
        out = np.zeros((len(t), self.n))
        for power in range(5, order - 1, -1):
            out = out * s + parts[power] * (factorial(power) / factorial(power - order))
        return out


def _is_header(header: list[str]) -> bool:
    n = (len(header) - 1) // 3
    return n > 0 and header == ["t", *(f"{kind}{joint + 1}" for kind in ("q", "dq", "ddq") for joint in range(n))]
