"""Where the payload changes within a log.

The log is cut in two at several places. With the part before a cut as the tare of the part after it
(`posterior.solve`), phi is what was added at the cut, and

    T = phi_MLᵀ·Λ·phi_ML / overrated

is small where nothing was: Λ, phi_ML what the two parts say of it, all that is unknown about the arm integrated out.
The cut with the largest T is sought more finely, and both parts are cut again.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from armload.arms import Arm
from armload.identification.thresholds import CUT, CUTS_LEAST, CUTS_MOST, PART_LEAST, PAYLOAD_CHANGED, SETTLED
from armload.posterior import SmoothPosteriorLeastSquares
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import solution_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.regression.rows import Rows

_ITERATIONS = 3  # of expectation–maximisation: the scales change little after
_FINER = 4  # cuts on either side of the best one, twice


def changes_of_payload(recording: Recording, arm: Arm) -> list[float]:
    """Times [s, on the log's clock] at which the payload changes; none: it is the same throughout."""
    found = _Search.of(recording, arm).all()
    if found and not arm.motor_torque:  # friction of gears that nobody knew of looks like a change
        physics = SmoothPosteriorLeastSquares(arm)
        physics.run(recording)
        if physics.posterior.torque == "motor":
            found = _Search.of(recording, replace(arm, motor_torque=True)).all()
    return found


class _Search:
    """The rows of a log, and the cuts in them."""

    def __init__(self, physics: SmoothPosteriorLeastSquares, rows: Rows) -> None:
        self.physics, self.rows = physics, rows
        self.weak = solution_prior_std(physics.arm)

    @classmethod
    def of(cls, recording: Recording, arm: Arm) -> _Search:
        physics = SmoothPosteriorLeastSquares(arm)
        return cls(physics, physics.stream.rows_of(recording.t, recording.q, recording.dq, recording.tau))

    def all(self) -> list[float]:
        """Changes of the whole log."""
        return self.within(0, len(self.rows.t))

    def within(self, start: int, stop: int) -> list[float]:
        """Changes between two rows."""
        t = self.rows.t
        if stop - start < 3 or t[stop - 1] - t[start] < 2.0 * PART_LEAST:
            return []
        first, last = np.searchsorted(t, [t[start] + PART_LEAST, t[stop - 1] - PART_LEAST])
        count = int(np.clip((t[last - 1] - t[first]) / CUT, CUTS_LEAST, CUTS_MOST))
        best, most = self._best(start, stop, np.unique(np.linspace(first, last - 1, count).astype(int)))
        if most <= PAYLOAD_CHANGED:
            return []
        spacing = max((last - first) // max(count - 1, 1), 1)
        for _ in range(2):
            spacing = max(spacing // _FINER, 1)
            near = best + spacing * np.arange(-_FINER, _FINER + 1)
            best, _ = self._best(start, stop, np.unique(np.clip(near, first, last - 1)))
        after = int(np.searchsorted(t, t[best] + SETTLED))  # the rows' lag still holds what was there before
        return [*self.within(start, best), float(t[best]) - 1.0 / GAIN, *self.within(after, stop)]

    def _best(self, start: int, stop: int, cuts: np.ndarray) -> tuple[int, float]:
        """The cut with the largest T, and T."""
        edges = [start, *cuts.tolist(), stop]
        stretches = [self._data(slice(a, b)) for a, b in pairwise(edges)]
        found = [self._statistic(stretches[:k], stretches[k:]) for k in range(1, len(stretches))]
        best = int(np.argmax(found))
        return int(cuts[best]), found[best]

    def _data(self, part: slice) -> RegressionData:
        data = self.physics.empty_data()
        data.take(Rows(*(value[part] for value in self.rows)))
        return data

    def _statistic(self, before: list[RegressionData], after: list[RegressionData]) -> float:
        parts = [RegressionData.joined(before), RegressionData.joined(after)]
        said = solve(parts, self.weak, None, SMOOTH, _ITERATIONS)
        wide = np.diag(self.weak**-2.0)  # directions that neither part tells
        return float(said.vector @ np.linalg.solve(said.information + wide, said.vector)) / SMOOTH.overrated
