"""The MAP posterior of a live stream: every row counts at once, the scales are found anew beside it.

Rows go two ways. The sequential posterior takes each as it comes: its answer is never older than a row. Beside it they
are accumulated (`accumulation.py`), and now and then a step of expectation–maximisation is made of them on a second
thread; the posterior at the new scales, brought up to date, replaces the running one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.posterior.accumulation import Accumulation
from armload.posterior.another_arm import found_so_far
from armload.posterior.checked_solver import CheckedSolver
from armload.posterior.first_moments import FirstMoments
from armload.posterior.joint_gains import spread
from armload.posterior.same_motion import Difference, SameMotion
from armload.posterior.scales import AnotherArm, Drift, Posterior, Scales, Tilt
from armload.posterior.sequential import SequentialPosterior
from armload.posterior.solve import Solution
from armload.posterior.under_prior import under_prior
from armload.recording import GAP
from armload.regression import Correction, JointFeatures
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.pooling import Pooling, pooled
from armload.regression.rows import REGRESSOR_RATE, FilteredRegression, Row


class StreamingPosterior:
    """What a stream says about the payload, sample by sample, and once more when it ends.

    Args:
        correction: the unknowns eta of the arm. features: of each joint's nonparametric part.
        solver: makes full solutions of it: with the priors, the noise and the run's session.
        tares: what earlier runs said, all with the same mounted; `start`: the scales found from them.
        gain: λ of the lag [1/s]. iterations: of expectation–maximisation in the last solution.
        same_motion: asks whether the tare shows the run's motion; None: not tested.
        together: rows that come within so long [s] count once they are complete, as one.

    Attributes:
        posterior: the last full solution; its scales, ratios and torque side hold until the next.
        difference: what the torque difference with a tare along the same motion says, where it is the better evidence.
        drift: by how much the arm differs from what it was at the tare; None: not asked yet.
        another: whether the arm is another one than at its tare; None: not asked yet.
        without_tare: whether the last solution does without what the tare says of the arm.
        tilt: by how much gravity is turned from what was given; None: not asked yet.
        restlessness: how restless the torques are in the run, of what they were at the tare; 0 where that is not known.
        solutions: full solutions so far. rows: how many. row: the last that counted. seconds: what all stand for [s].
    """

    _allows: bool | None = None  # `allows_for_sticking`; None: not asked yet

    def __init__(
        self,
        correction: Correction,
        features: JointFeatures,
        solver: CheckedSolver,
        tares: Sequence[RegressionData] = (),
        start: Scales | None = None,
        gain: float = GAIN,
        iterations: int = 5,
        same_motion: SameMotion | None = None,
        together: float = 0.0,
    ) -> None:
        self.correction, self.features, self.noise = correction, features, solver.noise
        self._solver, self._iterations = solver, iterations
        prior, std = solver.prior, solver.prior_std
        mean, root = (np.zeros(10), np.diag(std)) if prior is None else (prior.mean.copy(), prior.root)
        self._gaussian = mean, np.ascontiguousarray(root), np.ascontiguousarray(root.T)
        self.tares, self.gain, self.start = tuple(tares), gain, start
        self._regression = self.regression()
        self._first = FirstMoments(solver, correction, features, gain, self.tares, start)
        self._accumulation = Accumulation(self._first.no_rows(), same_motion)
        self._pooling, self._looked = Pooling(together), Pooling(together)
        self.reset()

    def __getstate__(self) -> dict[str, Any]:
        """For a copy: the second thread changes nothing while it is made."""
        self.hold()
        return vars(self)

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._accumulation.reset(self._first.no_rows())
        self._regression.reset()
        self._pooling.reset()
        self._looked.reset()
        self._first.reset()
        self._early = True  # in the first moments
        self._state: SequentialPosterior | None = None  # made when it is asked for, meanwhile
        self.rows, self.seconds, self.solutions = 0, 0.0, 0
        self.row: Row | None = None
        self.difference: Difference | None = None
        self.drift: Drift | None = None
        self.another: AnotherArm | None = None
        self.without_tare = False
        self.tilt: Tilt | None = None
        self.restlessness = 0.0
        self._posterior: Posterior | None = None

    def prepare(self) -> None:
        """Do now what the first answer would have to wait for: the posterior of the tares alone."""
        if self._early:
            self._first.begun()

    @property
    def posterior(self) -> Posterior:
        """The last full solution: of the tares alone before there was one."""
        return self._first.of_tares if self._posterior is None else self._posterior

    def allow_for_sticking(self, variance: NDArray[np.float64]) -> None:
        """Joints at rest are held by friction of this variance (n,) [N²·m²]: the next rows weigh less while they are.

        Of a block of rows, in units of the noise expected of one: never less than is expected of any arm.
        """
        noise = self._first.of_tares.scales.noise[-1] / self.noise.block
        self._regression.presliding[:] = np.maximum(self.correction.presliding, variance / noise)
        self._allows = None

    @property
    def allows_for_sticking(self) -> bool:
        """Whether its rows weigh less than expected of any arm while joints are slow."""
        if self._allows is None:  # it is asked at each row
            self._allows = bool((self.presliding != self.correction.presliding).any())
        return self._allows

    @property
    def presliding(self) -> NDArray[np.float64]:
        """By how much the variance (n,) of a joint's residual is larger at rest, as the rows have it."""
        return self._regression.presliding

    def take(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> bool:
        """Take one sample (n,); times rise. True if it completed rows that count now, that is, if something is new."""
        self.prepare()
        row = self._regression.row(t, q, dq, tau)
        if row is not None and row.t - self._pooling.last > GAP:  # what waits is of the time before the pause
            self._take_waiting()
        if row is None or not (rows := self._pooling.take(row)):
            return False
        self.rows += len(rows)
        self.row = row = pooled(rows)
        self.seconds += row.h
        if self._early:
            self._early = self._first.take(row, self.seconds)
            self._state = None if self._early else self._first.state(self.seconds)
            if not self._early:
                self._first.leave()
        else:
            self._current.take(row)
        result = self._accumulation.take(rows, row, self.rows, self.posterior.covariance, self._step)
        if result is not None:
            solution, self.difference = result
            if solution is not None:
                self._adopt(solution)
        return True

    def take_many(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Take samples (N,), (N, n) of a log: their rows are accumulated, and count once the stream is concluded."""
        rows = self._regression.rows(t, q, dq, tau)
        self._take_waiting()
        if len(rows.t):
            self._accumulation.take_many(rows)
            self.rows += len(rows.t)
            self.seconds += float(rows.h.sum())

    def regression(self) -> FilteredRegression:
        """What makes rows as this stream does, for rows that count for nothing here."""
        arm, settling = self.correction.arm, self.noise.block
        return FilteredRegression(arm, self.gain, self.correction, self.features, REGRESSOR_RATE, settling)

    def look(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> Row | None:
        """Pass a sample over: the rows it completes, if it does, as one; they count for nothing here."""
        row = self._regression.row(t, q, dq, tau)
        if row is None:
            return None
        if row.t - self._looked.last > GAP:  # none has been looked at for long: what waits is of another time
            self._looked.reset()
        rows = self._looked.take(row)
        return pooled(rows) if rows else None

    @property
    def state(self) -> SequentialPosterior | None:
        """The posterior's state after the last row, with what that row said; None in the first moments."""
        return None if self._early else self._state

    @property
    def stands(self) -> bool:
        """Whether the last row stands for no time: more of an arm at rest tells nothing new."""
        return self.row is not None and self.row.h <= 0.0

    @property
    def information(self) -> NDArray[np.float64]:
        """Λ (10, 10): what the logs alone say, all else integrated out."""
        return self._current.information

    @property
    def information_of_known_arm(self) -> NDArray[np.float64]:
        """Λ (10, 10) of the run's accumulated rows, were nothing of the arm unknown: Σ_j ∫ W_jᵀ·W_j dt / S_j."""
        return np.einsum("jab,j->ab", self._accumulation.run.A[:, :10, :10], 1.0 / self.posterior.scales.noise[-1])

    @property
    def vector(self) -> NDArray[np.float64]:
        """Λ·phi_ML (10,)."""
        return self._current.vector

    def answer(self, louder: float = 1.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi (10,) and its covariance (10, 10) under the Gaussian prior, as `solve` gives them; noise is `louder`."""
        state, about = self._current, (louder * self.noise.overrated, self.posterior.gain_std**2)
        phi, covariance = under_prior(state.information, state.vector, *self._gaussian, *about)
        moved = self.posterior.moved
        return phi, covariance if moved is None else covariance + spread(moved, phi)

    @property
    def _current(self) -> SequentialPosterior:
        if self._state is None:
            self._state = self._first.state(self.seconds)
        return self._state

    def conclude(self) -> None:
        """A last solution from all rows so far, as no more will come; it begins with the scales found from the tare."""
        self._take_waiting()
        runs = [*self.tares, self._accumulation.conclude()]
        self.drift = self.another = None
        self._adopt(self._solver.conclude(runs, self.start, self._iterations))
        changed = self.drift is not None and self.drift.changed  # then the difference is of two arms, too
        self.difference = None if changed or self.without_tare else self._accumulation.better(self.posterior.covariance)

    def _step(self, run: RegressionData) -> Solution:
        """The next solution, from the last one's scales."""
        return self._solver.go_on([*self.tares, run], self.posterior.scales if self.solutions else self.start)

    def _adopt(self, solution: Solution) -> None:
        self._early, self.without_tare = False, False
        if solution.finite:  # else the last one goes on
            self._posterior, self._state = solution.posterior, solution.state
            self.solutions += 1
            self.drift = None if solution.posterior.gears else solution.drift or self.drift
            self.tilt = solution.tilt
            self.another = found_so_far(self.another, solution.another)
            self.restlessness, self.without_tare = solution.restlessness, solution.without_tare
        elif self._state is None:
            self._state = self._first.state(self.seconds)

    def _take_waiting(self) -> None:
        """Accumulate rows that wait for others, as none will come soon: the next solution knows them."""
        for row in self._pooling.release():
            self.rows += 1
            self.seconds += row.h
            self._accumulation.add_late(row)

    def hold(self) -> None:
        """Wait for what the second thread does; nothing is done from then on, until the next rows."""
        self._accumulation.hold()

    def finish(self, until: float = np.inf) -> RegressionData:
        """All rows so far, accumulated, for another run to take as its tare; this one may go on later.

        Args:
            until: rows from this time on [s], as far as they are still to be had, never were.
        """
        self._take_waiting()
        taken_back = self._accumulation.finish(until)
        if taken_back:
            self.rows -= len(taken_back)
            self.seconds -= sum(row.h for row in taken_back)
            self._adopt(self._step(self._accumulation.run))
        return self._accumulation.run

    def remember(self, seconds: float) -> None:
        """Let all rows so far count for at most so long, from the next solution on; after `finish`."""
        self._accumulation.remember(seconds)

    def accumulated(self) -> RegressionData:
        """All rows so far, accumulated in a copy; `hold` first."""
        return self._accumulation.all_rows()

    def close(self) -> None:
        """Stop the second thread."""
        self._accumulation.close()
