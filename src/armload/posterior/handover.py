"""Work on a second thread whose result counts from a fixed row of the stream on, however fast the machine is."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

from armload.posterior.same_motion import Difference
from armload.posterior.solve import Solution
from armload.posterior.worker import Worker
from armload.regression.rows import Row

ADOPTED = 20  # [rows] after it was begun, 0.1 s: when the result of a piece of work counts

Result = tuple[Solution | None, Difference | None]


class Handover:
    """One piece of work at a time: begun at one row, adopted a fixed number of rows later.

    A new solution is behind the stream when it is ready. So it is given the rows that came since it was begun.

    Attributes:
        pending: something was begun and has not been taken.
        adopt_at: [rows] of the stream at which it is to be taken.
    """

    def __init__(self) -> None:
        self._worker = Worker()
        self.adopt_at = 0
        self._clear()

    def _clear(self) -> None:
        self._future: Future[Result] | None = None
        self._following: SimpleQueue[Row | None] | None = None  # rows since a solution was begun
        self._result: Result | None = None  # what is ready and waits to be adopted

    @property
    def pending(self) -> bool:
        return self._future is not None or self._result is not None

    def begin(self, rows: int, task: Callable[..., Result], *arguments: Any) -> None:
        """Begin `task(*arguments)` at this number of rows."""
        self.adopt_at = rows + ADOPTED
        self._future = self._worker.submit(task, *arguments)

    def begin_solution(self, rows: int, task: Callable[..., Result], *arguments: Any) -> None:
        """Begin `task(*arguments)`, a new solution; it is brought up to date with the rows given to `follow`."""
        self._following = SimpleQueue()
        self.begin(rows, _up_to_date, self._following, task, arguments)

    def follow(self, row: Row) -> None:
        """A row that came after a solution was begun."""
        if self._following is not None:
            self._following.put(row)
        elif self._result is not None and self._result[0] is not None:
            self._result[0].state.take(row)

    def hold(self) -> None:
        """Wait for what is being done; nothing is until the next `begin`. When it is adopted stays."""
        if self._future is not None:
            self._end_following()
            self._result, self._future = self._future.result(), None

    def take(self) -> Result:
        """The result, waited for."""
        self.hold()
        assert self._result is not None
        result, self._result = self._result, None
        return result

    def abandon(self) -> None:
        """Let what is under way go nowhere. It is waited for: the rows it accumulates are part of the run."""
        if self._future is not None:
            solves = self._following is not None
            self._end_following()
            error = self._future.exception()
            if error is not None and not solves:
                raise error
        self._clear()

    def close(self) -> None:
        """Stop the second thread."""
        self._worker.stop()

    def _end_following(self) -> None:
        if self._following is not None:
            self._following.put(None)
            self._following = None


def _up_to_date(following: SimpleQueue[Row | None], task: Callable[..., Result], arguments: tuple[Any, ...]) -> Result:
    """The solution of a task, with the rows that came while it was worked on."""
    solution, difference = task(*arguments)
    assert solution is not None
    while (row := following.get()) is not None:
        solution.state.take(row)
    return solution, difference
