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
    """A Recording from a table (N, 1 + 3n) in the order of `column_names`, if every row of it is valid.

    Rows that repeat the row before them exactly are dropped, with a note: some loggers write every sample twice.

    Args:
        row_name: how to call row k in a message ("line 7").
        labels: how to call the columns in a message; None: by `column_names`.

    Raises:
        RecordingError: fewer than two rows, a number that is not finite, times out of order; names row and column.
    """
    names = labels or column_names((table.shape[1] - 1) // 3)
    if not np.isfinite(table).all():
        row, column = np.argwhere(~np.isfinite(table))[0]
        kind = "NaN" if np.isnan(table[row, column]) else "infinite"
        raise RecordingError(
            f"{where}, {row_name(row)}: {names[column]} is {kind}: expected a finite number; remove or repair the row"
        )
    step, given = np.diff(table[:, 0]), len(table)
    if np.any(step <= 0):
        repeated = np.r_[False, (step == 0) & (table[1:] == table[:-1]).all(axis=1)]
        late = np.flatnonzero((step <= 0) & ~repeated[1:])
        if len(late):
            k = int(late[0])
            what = "repeats the time of" if step[k] == 0 else "goes back in time from"
            raise RecordingError(
                f"{where}, {row_name(k + 1)}: t = {table[k + 1, 0]:.6f} s {what} {row_name(k)} "
                f"(t = {table[k, 0]:.6f} s): expected strictly increasing times; sort the log or drop the row"
            )
        first = row_name(int(np.flatnonzero(repeated)[0]))
        notes = (
            *notes,
            f"{where}: dropped {repeated.sum()} row(s) that repeat the row before exactly (first: {first})",
        )
        table = table[~repeated]
    if len(table) < 2:
        rows = "no rows of data" if len(table) == 0 else "only 1 row of data"
        if given > 1:
            rows += f", {given} times"
        raise RecordingError(f"{where} holds {rows}: expected at least 2, one per sample")
    q, dq, tau = np.split(table[:, 1:], 3, axis=1)
    return Recording(table[:, 0], q, dq, tau, channel, joint_names, where, notes, epoch)
