"""The columns of a log (t, q1…qn, dq1…dqn, tau1…taun) and the checks every reader shares."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.aliases import QUANTITIES
from armload.recording.recording import Recording


def column_names(n: int) -> list[str]:
    """The names of all columns of an n-joint log, in the order they are written.

    >>> column_names(2)
    ['t', 'q1', 'q2', 'dq1', 'dq2', 'tau1', 'tau2']
    """
    return ["t", *(f"{quantity}{j}" for quantity in QUANTITIES for j in range(1, n + 1))]


def check_joint_count(n: int, where: str, arm: Arm, also: str = "") -> None:
    """Raise RecordingError if the log's n joints are not the arm's; `also`: another way to mend it."""
    if n != arm.n:
        has = "1 joint (q1)" if n == 1 else f"{n} joints (q1..q{n})"
        raise RecordingError(
            f"{where}: log has {has}, {arm.name} has {arm.n} up to its frame {arm.frame!r}: name the robot that made "
            f"the log, or its flange with --frame{also}"
        )


class RowCheck:
    """Sees that the rows of a log are valid, some at a time, in their order.

    Rows that repeat the row before them exactly are dropped, with a note: some loggers write every sample twice.

    Args:
        where: the log. names: how to call its columns in a message.
    """

    def __init__(self, where: str, names: Sequence[str]) -> None:
        self._where, self._names = where, names
        self._before: tuple[NDArray[np.float64], str] | None = None  # the last row (1, 1 + 3n), and what it is called
        self._dropped, self._first = 0, ""
        self.given = 0

    def rows(self, table: NDArray[np.float64], row_name: Callable[[int], str]) -> NDArray[np.float64]:
        """The next rows (N, 1 + 3n), without those that repeat.

        Args:
            row_name: how to call row k of these in a message ("line 7").

        Raises:
            RecordingError: a number that is not finite, times out of order; names row and column.
        """
        where = self._where
        if not np.isfinite(table).all():
            row, column = np.argwhere(~np.isfinite(table))[0]
            kind = "NaN" if np.isnan(table[row, column]) else "infinite"
            raise RecordingError(
                f"{where}, {row_name(row)}: {self._names[column]} is {kind}: expected a finite number; remove or "
                "repair the row"
            )
        if not len(table):
            return table
        self.given += len(table)
        first, before = (table[:1], "") if self._before is None else self._before
        self._before = table[-1:].copy(), row_name(len(table) - 1)
        step = np.diff(table[:, 0], prepend=first[:, 0])
        if not before:
            step[0] = np.inf
        if np.all(step > 0):
            return table
        repeated = (step == 0) & (table == np.r_[first, table[:-1]]).all(axis=1)
        late = np.flatnonzero((step <= 0) & ~repeated)
        if len(late):
            k = int(late[0])
            there, last = (before, first[0, 0]) if k == 0 else (row_name(k - 1), table[k - 1, 0])
            what, do = "repeats the time of", "write them with more digits, or drop the row"
            if step[k] < 0:
                what, do = (
                    "goes back in time from",
                    "sort rows out of order, or cut the log where its clock was set",
                )
            raise RecordingError(
                f"{where}, {row_name(k)}: t = {table[k, 0]:.6f} s {what} {there} "
                f"(t = {last:.6f} s): expected strictly increasing times; {do}"
            )
        self._first = self._first or row_name(int(np.flatnonzero(repeated)[0]))
        self._dropped += int(repeated.sum())
        return table[~repeated]

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done to the rows so far."""
        if not self._dropped:
            return ()
        first = self._first
        return (f"{self._where}: dropped {self._dropped} row(s) that repeat the row before exactly (first: {first})",)


def checked_recording(
    table: NDArray[np.float64],
    where: str,
    row_name: Callable[[int], str],
    *,
    labels: Sequence[str] | None = None,
    channel: str = "measured",
    joint_names: tuple[str, ...] | None = None,
    notes: tuple[str, ...] = (),
    epoch: float = 0.0,
) -> Recording:
    """A Recording from a table (N, 1 + 3n) in the order of `column_names`, if every row of it is valid (`RowCheck`).

    Args:
        row_name: how to call row k in a message ("line 7").
        labels: how to call the columns in a message; None: by `column_names`.

    Raises:
        RecordingError: fewer than two rows, a number that is not finite, times out of order; names row and column.
    """
    check = RowCheck(where, labels or column_names((table.shape[1] - 1) // 3))
    table = check.rows(table, row_name)
    check_count(len(table), check, where)
    return recording_of(table, where, channel, joint_names, (*notes, *check.notes), epoch)


def check_count(count: int, check: RowCheck, where: str) -> None:
    """Raise RecordingError if a log has fewer than two rows, those that repeat not counted."""
    if count < 2:
        rows = "no rows of data" if count == 0 else "only 1 row of data"
        if check.given > 1:
            rows += f", {check.given} times"
        raise RecordingError(f"{where} holds {rows}: expected at least 2, one per sample")


def recording_of(
    table: NDArray[np.float64],
    where: str,
    channel: str,
    joint_names: tuple[str, ...] | None,
    notes: tuple[str, ...],
    epoch: float,
) -> Recording:
    """A Recording from a table (N, 1 + 3n) of valid rows."""
    q, dq, tau = np.split(table[:, 1:], 3, axis=1)
    return Recording(table[:, 0], q, dq, tau, channel, joint_names, where, notes, epoch)
