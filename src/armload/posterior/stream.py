"""The MAP posterior of a live stream: every row counts at once, the scales are found anew beside it.

The rows of the last seconds go two ways. The sequential posterior takes each as it comes: its answer is never older
than a row. A second thread adds them to the accumulated information and now and then makes a step of
expectation–maximisation from it; the posterior at the new scales, brought up to date, replaces the running one a fixed
number of rows later. What is adopted when depends on the samples alone, never on how fast the machine is: a replay at
any speed gives the same numbers.

The last rows join the accumulated information late: until then they can be taken back, as those of a payload that was
there before anyone noticed. Were they kept, a cycle that returns to the same pose would teach them to the arm's model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from copy import deepcopy
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Thread
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from armload.posterior.problem import Posterior, Scales
from armload.posterior.sequential import SequentialPosterior
from armload.posterior.solve import advance
from armload.regression import Correction, JointFeatures
from armload.regression.information import RegressionData
from armload.regression.noise import NoiseModel, share_of_noise, whole_noise
from armload.regression.row_stream import Row, RowStream

_EARLY = 0.1  # [s] until then a slow residual shows one value: the posterior is made of all rows anew
# rows after which the scales are found anew (0.1, 0.3, … 12 s), then every so many; and how many later they are adopted
_REFITS = (20, 60, 100, 150, 200, 300, 400, 600, 800, 1200, 1600, 2400)
_REFIT_EVERY, _ADOPTED = 2000, 20
_CHUNK = 50  # rows handed over at once in between
_LATE = 50  # rows that can be taken back, a quarter of a second: more than a change takes to be noticed


@dataclass(eq=False)
class Solution:
    """A solution and what it rests on: the posterior at the accumulated rows, and brought up to date."""

    posterior: Posterior
    state: SequentialPosterior


class Worker:
    """One thread that does what it is given, in order; a program may end while it waits."""

    def __init__(self) -> None:
        self._tasks: SimpleQueue[tuple[Future, Callable, tuple] | None] = SimpleQueue()
        Thread(target=self._run, name="armload-scales", daemon=True).start()

    def submit(self, task: Callable, *arguments: Any) -> Future:
        future: Future = Future()
        self._tasks.put((future, task, arguments))
        return future

    def stop(self) -> None:
        self._tasks.put(None)

    def _run(self) -> None:
        while (given := self._tasks.get()) is not None:
            future, task, arguments = given
            try:
                future.set_result(task(*arguments))
            except BaseException as error:  # whoever waits for the result gets it
                future.set_exception(error)
            del given, future, task, arguments  # a thread that waits must keep nothing alive


class StreamingPosterior:
    """What a live stream says about the payload, sample by sample.

    Args:
        correction: the unknowns eta of the arm. features: of each joint's nonparametric part. noise: as for `solve`.
        prior_std: of each payload (10,).
        tares: what earlier runs said, all with the same mounted; `start`: the scales found from them.
        gain: λ of the lag [1/s].

    Attributes:
        posterior: the last full solution; its scales, ratios and torque side hold until the next.
            refits: full solutions so far. row: the last row; seconds: what all rows stand for [s].
    """

    def __init__(
        self,
        correction: Correction,
        features: JointFeatures,
        noise: NoiseModel,
        prior_std: NDArray[np.float64],
        tares: Sequence[RegressionData] = (),
        start: Scales | None = None,
        gain: float = 20.0,
    ) -> None:
        self.correction, self.features, self.noise, self.prior_std = correction, features, noise, prior_std
        self.tares, self.gain, self.start = tuple(tares), gain, start
        self._rows = RowStream(correction, gain, features, noise.block)
        self._whole = whole_noise(correction, noise)
        self._base: SequentialPosterior | None = None
        self._worker: Worker | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._abandon()
        self._rows.reset()
        self._run = self._empty()
        if self._base is None:
            self.first, self._base = advance([*self.tares, self._run], self.prior_std, self.noise, self.start, steps=0)
            self._base.noise = self._whole
        self.posterior, self._state = self.first, self._base.copy()
        self._early: list[Row] | None = []
        self._waiting: list[Row] = []
        self.rows, self.seconds, self.refits = 0, 0.0, 0
        self.row: Row | None = None

    def _empty(self) -> RegressionData:
        return RegressionData(self.correction, self.gain, self.features, self.noise.block)

    def take(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> bool:
        """Take one sample (n,); times rise. True if it completed a row, that is, if there is something new."""
        row = self._rows.feed(t, q, dq, tau)
        if row is None:
            return False
        self.rows += 1
        self.seconds += row.h
        self.row = row
        self._waiting.append(row)
        if self._early is not None:
            self._early.append(row)
            self._state_is_old = True
            if self.seconds >= _EARLY:
                self._from_early()
                self._early = None
        else:
            self._state.take(row)
        self._beside(row)
        return True

    def look(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> Row | None:
        """Pass a sample over: the row it completes, if it does, counts for nothing here."""
        return self._rows.feed(t, q, dq, tau)

    @property
    def state(self) -> SequentialPosterior | None:
        """The posterior's state after the last row, with what that row said; None in the first moments."""
        return None if self._early is not None else self._state

    @property
    def information(self) -> NDArray[np.float64]:
        """Λ (10, 10): what the logs alone say, all else integrated out."""
        self._from_early()
        return self._state.information

    @property
    def vector(self) -> NDArray[np.float64]:
        """Λ·phi_ML (10,)."""
        self._from_early()
        return self._state.vector

    def answer(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi (10,) and its covariance (10, 10) under the weak prior, as `solve` gives them."""
        return _answer(self.information, self.vector, self.prior_std, self.noise.overrated, self.posterior.gain_std**2)

    def _from_early(self) -> None:
        """The state of a run so short that the residual shows one value: with less noise the shorter it is."""
        if self._early is None or not self._state_is_old:
            return
        assert self._base is not None
        self._state = self._base.copy()
        self._state.noise = self._whole * share_of_noise(self.seconds)
        for row in self._early:
            self._state.take(row)
        self._state_is_old = False

    # ------------------------------------------------------------------ beside the stream

    def _beside(self, row: Row) -> None:
        """Hand rows over, begin a refit, adopt one: each at fixed numbers of rows."""
        if self._future is not None:
            self._catching_up.put(row)
            if self.rows >= self._adopt_at:
                self.hold()
        elif self._ready is not None:
            self._ready.state.take(row)
        if self._ready is not None and self.rows >= self._adopt_at:
            ready, self._ready = self._ready, None
            self._adopt(ready)
            return
        if self._future is not None or self._ready is not None:
            return
        due = self.rows in _REFITS or self.rows % _REFIT_EVERY == 0
        if due or len(self._waiting) >= _CHUNK + _LATE:
            rows, self._waiting = self._waiting[:-_LATE], self._waiting[-_LATE:]
            if self._worker is None:
                self._worker = Worker()
            if due:
                self._catching_up = SimpleQueue()
                self._adopt_at = self.rows + _ADOPTED
                self._future = self._worker.submit(self._refit, rows, self._waiting.copy(), self._catching_up)
            else:
                self._last = self._worker.submit(_accumulate, self._run, rows)

    def _refit(self, rows: list[Row], late: list[Row], following: SimpleQueue) -> Solution:
        _accumulate(self._run, rows)
        run = deepcopy(self._run, {id(self.correction): self.correction})
        _accumulate(run, late)
        solution = self._solution(run)
        while (row := following.get()) is not None:
            solution.state.take(row)
        return solution

    def _solution(self, run: RegressionData) -> Solution:
        start = self.posterior.scales if self.refits else self.start
        return Solution(*advance([*self.tares, run], self.prior_std, self.noise, start))

    def _adopt(self, solution: Solution) -> None:
        self._early = None
        if np.isfinite(solution.state.information.sum() + solution.state.vector.sum()):  # else the last one goes on
            self.posterior, self._state = solution.posterior, solution.state
            self.refits += 1

    def hold(self) -> None:
        """Wait for what is done beside; nothing is from then on, until the next rows. What is adopted when stays."""
        if self._future is not None:
            self._catching_up.put(None)
            self._ready, self._future = self._future.result(), None
        if self._last is not None:
            self._last.result()
            self._last = None

    def finish(self, taken_back: int = 0) -> RegressionData:
        """All rows so far, accumulated, for another run to take as its tare; this one may go on later.

        Args:
            taken_back: so many of the last rows, as far as they are still to be had, never were.
        """
        self._abandon()
        rows, self._waiting = self._waiting, []
        kept = max(len(rows) - taken_back, 0)
        _accumulate(self._run, rows[:kept])
        if kept < len(rows):
            self.rows -= len(rows) - kept
            self.seconds -= sum(row.h for row in rows[kept:])
            self._adopt(self._solution(self._run))
        return self._run

    def _abandon(self) -> None:
        """Let a solution under way go nowhere."""
        future: Future | None = getattr(self, "_future", None)
        if future is not None:
            self._catching_up.put(None)
            future.exception()  # waited for, whatever became of it: its tare may have gone on meanwhile
        self._future: Future[Solution] | None = None
        self._ready: Solution | None = None  # a solution that waits to be adopted
        last: Future | None = getattr(self, "_last", None)
        if last is not None:
            last.result()
        self._last: Future[None] | None = None

    def close(self) -> None:
        """Stop the second thread."""
        self._abandon()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None


def _accumulate(run: RegressionData, rows: list[Row]) -> None:
    if rows:
        h, X, r, weights = (np.array(column) for column in zip(*rows, strict=True))
        run.take_rows(h, X, r, weights)


@njit(cache=True, nogil=True)
def _answer(information, vector, s, overrated, gain):  # pragma: no cover - compiled
    A = np.eye(10)
    if not np.isfinite(information.sum() + vector.sum()):
        return np.zeros(10), np.diag(s * s)
    for i in range(10):
        for j in range(10):
            A[i, j] += s[i] * information[i, j] * s[j]
    covariance = np.linalg.inv(A)
    for i in range(10):
        for j in range(10):
            covariance[i, j] *= s[i] * s[j]
    phi = covariance @ vector
    out = np.empty((10, 10))
    for i in range(10):
        for j in range(10):
            out[i, j] = 0.5 * overrated * (covariance[i, j] + covariance[j, i]) + gain * phi[i] * phi[j]
    return phi, out
