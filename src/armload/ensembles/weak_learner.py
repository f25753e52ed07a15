"""A bag: the rows each member of an ensemble sees, the scaling of the columns, and what a learner makes of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator

from armload.ensembles.compiled import Compiled
from armload.ensembles.progress import Report
from armload.errors import ModelError

SCALES = ("standard", "none")

# Every random draw has its own stream, keyed (seed, member, purpose, ...): member i draws the same numbers however many
# members there are, and a resumed training draws what the uninterrupted one would have drawn.
BOOTSTRAP, BOOTSTRAP_VALIDATION, HOLD_OUT, INITIAL_WEIGHTS, SHUFFLE, TIES = range(6)


class Scaling(NamedTuple):
    """Centre and scale of features (d,) and outputs (k,), taken from the training rows.

    A constant column has the scale 0 and is 0 when scaled.
    """

    x_mean: NDArray[np.float64]
    x_scale: NDArray[np.float64]
    y_mean: NDArray[np.float64]
    y_scale: NDArray[np.float64]

    @classmethod
    def of(cls, X: NDArray, y: NDArray, scale: str) -> Scaling:
        """Mean and standard deviation ("standard"), or 0 and 1 ("none")."""
        if scale not in SCALES:
            raise ModelError(f"unknown scale {scale!r}: expected one of {', '.join(SCALES)}")
        parts = []
        for a in (X, y):
            if scale == "none":
                parts += [np.zeros(a.shape[1]), np.ones(a.shape[1])]
                continue
            mean, std = a.mean(axis=0), a.std(axis=0)
            constant = std <= 1e-12 * np.abs(a).max(axis=0)  # what rounding leaves of a constant column is no scale
            parts += [mean, np.where(constant, 0.0, std)]
        return cls(*parts)

    def features(self, X: NDArray) -> NDArray[np.float64]:
        """X (N, d) scaled."""
        return (X - self.x_mean) * self.per_x

    def outputs(self, y: NDArray) -> NDArray[np.float64]:
        """y (N, k) scaled; back again: y_mean + y_scale·scaled."""
        return (y - self.y_mean) * _inverse(self.y_scale)

    @property
    def per_x(self) -> NDArray[np.float64]:
        """1 / x_scale (d,), 0 where that is 0."""
        return _inverse(self.x_scale)


def _inverse(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)


@dataclass(frozen=True, eq=False)
class Bag:
    """The rows of M members.

    X: (N, d), y: (N, k) training rows; rows: (M, N) which of them each member sees, with repetition.
    X_val, y_val: validation rows; rows_val: (M, N_val), likewise.
    """

    X: NDArray[np.float64]
    y: NDArray[np.float64]
    rows: NDArray[np.int64]
    X_val: NDArray[np.float64]
    y_val: NDArray[np.float64]
    rows_val: NDArray[np.int64]
    scaling: Scaling
    seed: int


class Fitted(NamedTuple):
    """Fitted members; for networks also the epochs each took and validation losses (epochs, M), NaN once stopped."""

    compiled: Compiled
    epochs: NDArray[np.int64] | None = None
    losses: NDArray[np.float64] | None = None


class Learner(BaseEstimator, ABC):
    """A weak learner's recipe: settings as constructor arguments, and how to fit all members of a bag."""

    kind: str
    validates: bool  # whether it needs validation rows

    @abstractmethod
    def fit_bag(self, bag: Bag, report: Report, checkpoint: Path | None = None) -> Fitted:
        """Fit one member per row of `bag.rows`."""


def draw_bag(
    X: NDArray,
    y: NDArray,
    validation: tuple[NDArray, NDArray] | None,
    *,
    members: int,
    seed: int,
    bootstrap: bool,
    scale: str,
    hold_out: float,
) -> Bag:
    """Sample training and validation rows with replacement for every member (Taie et al. 2024, Section IV).

    Args:
        validation: rows given for validation. None: `hold_out` of the training rows, drawn once without replacement
            and taken out of training; with fewer than 10 rows, or hold_out = 0, the training rows themselves.
    """
    scaling = Scaling.of(X, y, scale)
    if validation is None:
        X_val, y_val = X, y
        count = min(round(hold_out * len(X)), len(X) - 1)
        if len(X) >= 10 and count:
            order = np.random.default_rng([seed, 0, HOLD_OUT]).permutation(len(X))
            held, kept = np.sort(order[:count]), np.sort(order[count:])
            X_val, y_val, X, y = X[held], y[held], X[kept], y[kept]
    else:
        X_val, y_val = validation

    def draw(n: int, purpose: int) -> NDArray[np.int64]:
        if not bootstrap:
            return np.tile(np.arange(n), (members, 1))
        return np.array([np.random.default_rng([seed, m, purpose]).integers(n, size=n) for m in range(members)])

    rows, rows_val = draw(len(X), BOOTSTRAP), draw(len(X_val), BOOTSTRAP_VALIDATION)
    return Bag(X, y, rows, X_val, y_val, rows_val, scaling, seed)
