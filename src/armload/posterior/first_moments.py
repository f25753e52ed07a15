"""The first moments of a run, so short that the residual shows one value all the while.

What counts as noise then grows with the run, so its rows count anew with each: from the posterior of the tares alone,
with less noise the shorter the run is (`regression.noise.share_of_noise`).
"""

from __future__ import annotations

from collections.abc import Sequence

from armload.posterior.checked_solver import CheckedSolver
from armload.posterior.scales import Posterior, Scales
from armload.posterior.sequential import SequentialPosterior
from armload.regression import Correction, JointFeatures
from armload.regression.information import RegressionData
from armload.regression.noise import MOMENT, share_of_noise
from armload.regression.rows import Row


class FirstMoments:
    """The posterior of a run of at most `MOMENT` seconds.

    Args:
        solver: makes the posterior of the tares. correction, features, gain: see `StreamingPosterior`.
        tares: what earlier runs said. start: the scales found from them.
    """

    def __init__(
        self,
        solver: CheckedSolver,
        correction: Correction,
        features: JointFeatures,
        gain: float,
        tares: Sequence[RegressionData],
        start: Scales | None,
    ) -> None:
        self._solver, self._about, self._tares, self._start = solver, (correction, gain, features), tares, start
        self._of_tares: Posterior | None = None
        self._base: SequentialPosterior | None = None
        self._rows: list[Row] = []

    def no_rows(self) -> RegressionData:
        """The run before its first row."""
        return RegressionData(*self._about, self._solver.noise.block, self._solver.session)

    @property
    def of_tares(self) -> Posterior:
        """What the tares alone say."""
        if self._of_tares is None:
            self.begun()
        assert self._of_tares is not None
        return self._of_tares

    def begun(self) -> SequentialPosterior:
        """The state before any row, not to be changed; made again after `leave`, as the tares are what they were."""
        if self._base is None:
            first = self._solver.solve([*self._tares, self.no_rows()], self._start, 1)
            self._of_tares, self._base = first.posterior, first.state
            self._base.noise = self._whole = first.posterior.scales.noise[-1] / share_of_noise(0.0)
        return self._base

    def reset(self) -> None:
        """Forget the rows."""
        self._rows = []

    def leave(self) -> None:
        """They are over: hold nothing that is large."""
        self._rows, self._base = [], None

    def take(self, row: Row, seconds: float) -> bool:
        """One more row, the last of so many seconds; False: they are over with it."""
        self._rows.append(row)
        return seconds < MOMENT

    def state(self, seconds: float) -> SequentialPosterior:
        """After all rows so far, which stand for so many seconds."""
        state = self.begun().copy()
        state.noise = self._whole * share_of_noise(seconds)
        for row in self._rows:
            state.take(row)
        return state
