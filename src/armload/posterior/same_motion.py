"""A tare along the run's own motion: what the arm does wrong in both logs, their difference is free of.

Fed with the rows of the run, beside the posterior (`estimators.DifferenceLeastSquares`): it costs little to ask whether
the tare shows the motion, and where it does, its evidence takes the posterior's place.
"""

from __future__ import annotations

from copy import copy
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.estimators import DifferenceLeastSquares
from armload.recording import Recording
from armload.recording.alignment import LEAST
from armload.regression.rows import Rows


class Difference(NamedTuple):
    """What the torque difference says: Λ (10, 10) and Λ·phi_ML (10,), from the rows up to t [s]."""

    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    t: float


class SameMotion:
    """Asks of every run whether the tare shows its motion.

    Args:
        arm: the bare arm. tare: an earlier log of it. gain: λ of the lag [1/s], as of the rows that will come.
    """

    def __init__(self, arm: Arm, tare: Recording, gain: float) -> None:
        self._difference = DifferenceLeastSquares(arm, tare, gain)
        self._began: float | None = None
        self._last = -np.inf

    def fresh(self) -> Self:
        """The same question for another run."""
        other = copy(self)
        other._difference = self._difference.fresh()
        other._began, other._last = None, -np.inf
        return other

    def take(self, rows: Rows) -> None:
        """Take the next rows of the run."""
        if not len(rows.t):
            return
        if self._began is None:
            self._began = float(rows.t[0])
        self._last = float(rows.t[-1])
        self._difference.take_rows(rows)

    def better(self, covariance: NDArray[np.float64]) -> Difference | None:
        """The difference's evidence, if the tare shows half of the run and tells every parameter better.

        Args:
            covariance: of the posterior (10, 10), to compare with.
        """
        elapsed = 0.0 if self._began is None else self._last - self._began
        if not self._difference.seconds >= LEAST * elapsed > 0.0:
            return None
        found = self._difference._estimate(self._last)
        if np.any(np.diag(found.covariance) > np.diag(covariance)):
            return None  # too few rows yet
        information = np.asarray(np.linalg.inv(found.covariance), dtype=float)
        return Difference(information, information @ found.phi, self._last)
