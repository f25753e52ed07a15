"""The rows of a run, accumulated beside its stream, and when the scales are found anew from them.

A second thread adds rows to the accumulated information and now and then makes a solution of it, which replaces the
running one a fixed number of rows later. What counts when depends on the samples alone, never on how fast the machine
is: a replay at any speed gives the same numbers.

The last rows join the accumulated information late: until then they can be taken back, as those of a payload that was
there before anyone noticed. Were they kept, a cycle that returns to the same pose would teach them to the arm's model.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable
from copy import deepcopy

from numpy.typing import NDArray

from armload.posterior.handover import Handover, Result
from armload.posterior.same_motion import Difference, SameMotion
from armload.posterior.solve import Solution
from armload.regression.information import RegressionData
from armload.regression.rows import Row, Rows
from armload.runtime.one_thread import one_thread

# [rows] after which the scales are found anew (0.1, 0.3, … 30 s): they change with the logarithm of the time. And after
# every so many, 20 s: another arm, which is asked for then, is to be told within a minute
_REFITS = (20, 60, 100, 150, 200, 300, 400, 600, 800, 1200, 1600, 2400, 6000)
_REFIT_EVERY = 4000
# [rows] handed over at once in between, 1 s: the fewer times a run's squares (3.5 MB) are read and written, the less it
# costs; where the tare may show the same motion that is asked so often, 0.25 s
_CHUNK, _COMPARED = 200, 50
_LATE = 100  # [rows] that can be taken back, 0.5 s: a slow hand-over begins so long before it is noticed


class Accumulation:
    """What the rows of a run say together.

    Args:
        empty: of the kind to accumulate; it becomes the run. same_motion: asks whether the tare shows the run's motion.

    Attributes:
        run: all rows but those that can still be taken back (`finish`, `all_rows` add them).
    """

    def __init__(self, empty: RegressionData, same_motion: SameMotion | None) -> None:
        self.run, self._same_motion = empty, same_motion
        self._chunk = _CHUNK if same_motion is None else _COMPARED
        self._waiting: list[Row] = []
        self._handover = Handover()

    def reset(self, empty: RegressionData) -> None:
        """Forget the run; the next row is the first of another one."""
        self._handover.abandon()
        if self._same_motion is not None:
            self._same_motion = self._same_motion.fresh()
        self.run, self._waiting = empty, []

    def take(
        self, rows: list[Row], as_one: Row, count: int, covariance: NDArray, solve: Callable[[RegressionData], Solution]
    ) -> Result | None:
        """Take the next rows; at fixed numbers of rows some are handed over, a solution is begun, or a result counts.

        Args:
            as_one: what the rows say together (`pooled`). count: rows of the run, these among them.
            covariance: of the posterior (10, 10), to compare with.
            solve: makes a solution of a run, on the second thread.

        Returns:
            The result that counts from this row on; None: there is none.
        """
        work, result = self._handover, None
        self._waiting += rows
        work.follow(as_one)
        first = count - len(rows)
        due = bisect(_REFITS, count) > bisect(_REFITS, first) or count // _REFIT_EVERY > first // _REFIT_EVERY
        if work.pending:
            if count < work.adopt_at and not due:
                return None
            result = work.take()
            if result[0] is not None:
                return result
        if due or len(self._waiting) >= self._chunk + _LATE:
            early, self._waiting = self._waiting[:-_LATE], self._waiting[-_LATE:]
            if due:
                work.begin_solution(count, self._solved, early, self._waiting.copy(), covariance, solve)
            else:
                work.begin(count, self._handed_over, early, covariance)
        return result

    def add_late(self, row: Row) -> None:
        """Take a row for which nothing is begun; it can be taken back."""
        self._waiting.append(row)

    def take_many(self, rows: Rows) -> None:
        """Take many rows at once, which are not taken back."""
        self._add_waiting()
        self._add(rows)

    def conclude(self) -> RegressionData:
        """The run with all rows so far; what is under way counts no more."""
        self._handover.abandon()
        self._add_waiting()
        return self.run

    def finish(self, until: float) -> list[Row]:
        """The same up to a time [s], and the rows from then on, as far as they are still to be had: they never were."""
        self._handover.abandon()
        rows, self._waiting = self._waiting, []
        kept = [row for row in rows if row.t < until]
        if kept:
            self._add(Rows.of(kept))
        return rows[len(kept) :]

    def remember(self, seconds: float) -> None:
        """Let all rows so far count for at most so long, however many they are; after `finish`."""
        if (so_far := self.run.blocks.duration) > seconds:
            self.run.discount(seconds / so_far)

    def all_rows(self) -> RegressionData:
        """A copy of the run with all rows so far; `hold` first."""
        return self._with(self._waiting)

    def better(self, covariance: NDArray) -> Difference | None:
        """What the difference with the tare says, if it tells every parameter better (`SameMotion.better`)."""
        return None if self._same_motion is None else self._same_motion.better(covariance)

    def hold(self) -> None:
        """Wait for what is done on the second thread; nothing is from then on, until the next rows."""
        self._handover.hold()

    def close(self) -> None:
        """Stop the second thread."""
        self._handover.abandon()
        self._handover.close()

    def _add(self, rows: Rows) -> None:
        self.run.take(rows)
        if self._same_motion is not None:
            self._same_motion.take(rows)

    def _add_waiting(self) -> None:
        rows, self._waiting = self._waiting, []
        if rows:
            self._add(Rows.of(rows))

    def _with(self, late: list[Row]) -> RegressionData:
        run = deepcopy(self.run, {id(self.run.correction): self.run.correction})
        if late:
            run.take(Rows.of(late))
        return run

    # ------------------------------------------------------------------ on the second thread

    @one_thread()
    def _handed_over(self, rows: list[Row], covariance: NDArray) -> Result:
        if rows:
            self._add(Rows.of(rows))
        return None, self.better(covariance)

    @one_thread()
    def _solved(
        self, rows: list[Row], late: list[Row], covariance: NDArray, solve: Callable[[RegressionData], Solution]
    ) -> Result:
        _, difference = self._handed_over(rows, covariance)
        return solve(self._with(late)), difference
