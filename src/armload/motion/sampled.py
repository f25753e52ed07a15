"""A motion given as a table: position, velocity and acceleration at instants, with a quintic between two of them.

On each interval [t_k, t_{k+1}] of length h every joint follows the one polynomial of degree five that has the given q,
q̇ and q̈ at both ends: with u = (t − t_k)/h and a column y = (q_k, h·q̇_k, h²·q̈_k, q_{k+1}, h·q̇_{k+1}, h²·q̈_{k+1}), its
coefficients are `_HERMITE`·y.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion

# rows: coefficients of 1, u, … u⁵; columns: y
_HERMITE = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)


@dataclass(frozen=True, eq=False)
class SampledMotion(Motion):
    """A motion through a table's rows.

    >>> from armload.motion import taie2024
    >>> whole = taie2024()
    >>> table = SampledMotion.of(whole, 0.01)
    >>> bool(np.abs(table.position([1.234]) - whole.position([1.234])).max() < 1e-9)
    True

    Args:
        times: (K,) [s], the first of them 0, rising.
        q, dq, ddq: (K, n) [rad, rad/s, rad/s²].
        name: what the motion is called.

    Raises:
        MotionError: shapes that do not fit, times that do not rise from 0, numbers that are not finite.
    """

    times: ArrayLike
    q: ArrayLike
    dq: ArrayLike
    ddq: ArrayLike
    name: str = "sampled"

    def __post_init__(self) -> None:
        for name in ("times", "q", "dq", "ddq"):
            value = np.array(getattr(self, name), dtype=float)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        times, shape = np.asarray(self.times), np.shape(self.q)
        fits = times.ndim == 1 and len(times) >= 2 and len(shape) == 2 and shape[0] == len(times)
        if not fits or not np.shape(self.dq) == np.shape(self.ddq) == shape:
            raise MotionError(
                f"the motion {self.name!r} has times of shape {times.shape} and positions of shape {shape}: expected "
                "(K,), and (K, n) of position, velocity and acceleration"
            )
        if times[0] != 0 or np.any(np.diff(times) <= 0):
            raise MotionError(f"the times of the motion {self.name!r} do not rise from 0")
        if not all(np.all(np.isfinite(x)) for x in (times, self.q, self.dq, self.ddq)):
            raise MotionError(f"the motion {self.name!r} has numbers that are not finite")

    @classmethod
    def of(cls, motion: Motion, step: float = 4e-3) -> Self:
        """A motion as a table with rows about `step` seconds apart."""
        times = np.linspace(0.0, motion.duration, max(2, round(motion.duration / step) + 1))
        return cls(times, *motion(times), motion.name)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """The table that `export_motion` writes as CSV: a header, then t, q1 … qn, dq1 … dqn, ddq1 … ddqn.

        Raises:
            MotionError: the file is missing or is not such a table.
        """
        try:
            with open(path, newline="", encoding="utf-8") as file:
                header, *rows = list(csv.reader(file))
            table = np.array(rows, dtype=float)
        except OSError as error:
            raise MotionError(f"motion file {path} cannot be read: {error.strerror}") from None
        except ValueError:
            raise MotionError(f"motion file {path} is not a table of numbers under a header") from None
        n = (len(header) - 1) // 3
        names = ["t", *(f"{kind}{joint + 1}" for kind in ("q", "dq", "ddq") for joint in range(n))]
        if n < 1 or header != names or table.ndim != 2:
            raise MotionError(
                f"motion file {path} has the columns {', '.join(header)[:80]}: expected t, q1 …, dq1 …, ddq1 … as "
                "`armload motion export --format csv` writes them"
            )
        return cls(table[:, 0], table[:, 1 : n + 1], table[:, n + 1 : 2 * n + 1], table[:, 2 * n + 1 :], str(path))

    @property
    def n(self) -> int:
        """Number of joints."""
        return np.shape(self.q)[1]

    @property
    def duration(self) -> float:
        """Time of the last row [s]."""
        return float(np.asarray(self.times)[-1])

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 5) at times t (N,); (N, n)."""
        times, t = np.asarray(self.times), np.asarray(t, dtype=float)
        k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        h = times[k + 1] - times[k]
        u = (t - times[k]) / h
        powers = np.zeros((6, len(t)))
        for p in range(order, 6):
            powers[p] = np.prod(np.arange(p - order + 1, p + 1)) * u ** (p - order) / h**order
        return np.einsum("pt,tpj->tj", powers, self._coefficients[k])

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        """(K − 1, 6, n)."""
        h = np.diff(np.asarray(self.times))[:, None]
        q, dq, ddq = (np.asarray(x) for x in (self.q, self.dq, self.ddq))
        ends = (q[:-1], h * dq[:-1], h**2 * ddq[:-1], q[1:], h * dq[1:], h**2 * ddq[1:])
        return np.einsum("py,ykj->kpj", _HERMITE, np.stack(ends))
