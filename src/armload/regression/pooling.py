"""Rows that come sooner than anybody asks are taken together: one row of all they say, at half of the work or less.

Rows of the same unknowns x, of joint j and with noise of unit variance, are y_k = X_k·x + e_k, e_k ~ N(0, 1/(h_k·w_k)).
Where X hardly changes between them, their mean by h·w says of x what they say one after another:

    w·h = Σ h_k·w_k,    X = Σ h_k·w_k·X_k / (w·h),    y likewise,    h = Σ h_k

It leaves out how X changes within hundredths of a second. Source: generalised least squares, grouped observations.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from armload.regression.rows import Row
from armload.runtime.kernels import kernel

LATE = 1.05  # of the time within which rows or answers are asked for: clocks jitter


class Pooling:
    """Collects rows until the next one would come too late.

    Args:
        seconds: what comes within so long [s] is taken together; 0: each row is taken alone.

    Attributes:
        last: time of the last row [s].
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = LATE * seconds
        self.reset()

    def reset(self) -> None:
        """Forget the rows."""
        self._given = self.last = -np.inf
        self._waiting: list[Row] = []

    def take(self, row: Row) -> list[Row]:
        """Take the next row; those that are due with it, none or all that wait."""
        step, self.last = row.t - self.last, row.t
        self._waiting.append(row)
        if row.t + step <= self._given + self._seconds:
            return []
        self._given = row.t
        return self.release()

    def release(self) -> list[Row]:
        """Those that wait, and wait no more."""
        rows, self._waiting = self._waiting, []
        return rows


def pooled(rows: Sequence[Row]) -> Row:
    """One row of all that some say, one at least: where the last one is, and for as long as all of them.

    Of an arm that stands, whose rows stand for no time, each counts as much as all before it.
    """
    return reduce(_both, rows)


def _both(a: Row, b: Row) -> Row:
    return Row(b.t, b.q, a.h + b.h, *_mean(a.h, a.weights, a.X, a.r, b.h, b.weights, b.X, b.r))


@kernel
def _mean(h, w, X, r, later_h, later_w, later_X, later_r):  # pragma: no cover - compiled
    """X (n, size), r (n,) and weights (n,) of two rows as one."""
    out_X, out_r, out_w = np.empty_like(X), np.empty_like(r), np.empty_like(w)
    total = h + later_h
    share, later = (h / total, later_h / total) if total > 0.0 else (0.5, 0.5)
    for j in range(len(w)):
        out_w[j] = share * w[j] + later * later_w[j]
        a, b = share * w[j] / out_w[j], later * later_w[j] / out_w[j]
        out_r[j] = a * r[j] + b * later_r[j]
        for k in range(X.shape[1]):
            out_X[j, k] = a * X[j, k] + b * later_X[j, k]
    return out_X, out_r, out_w
