"""Prediction without scikit-learn or JAX: trees as flat arrays walked by numba, networks as stacked matrix products.

Every trained ensemble predicts through one of these, so a saved model, a loaded one and a live stream give the same
numbers. One row costs microseconds, where the training libraries' own `predict` costs most of a millisecond.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import ModelError
from armload.runtime.kernels import kernel

_CHUNK = 2048  # rows predicted at once: bounds the memory of a wide hidden layer


class Compiled(ABC):
    """The fitted members of an ensemble, M predictors of k outputs from d features."""

    n_features: int
    n_outputs: int
    n_members: int

    @abstractmethod
    def members(self, X: ArrayLike) -> NDArray[np.float64]:
        """The prediction of each member: (M, N, k) for rows X (N, d)."""

    def row(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The prediction of each member for one row x (d,): (M, k), as `members` to rounding, and faster."""
        return self.members(x[None])[:, 0]

    @abstractmethod
    def validate(self) -> None:
        """Raise ValueError unless the arrays fit together; for arrays that come from a file."""

    @overload
    def predict(self, X: ArrayLike, return_std: Literal[False] = False) -> NDArray[np.float64]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[True]) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def predict(self, X, return_std=False):
        """Mean over the members, K = Σᵢ Kᵢ / M (Taie et al. 2024, eq. 8), and their spread.

        Args:
            X: (N, d).
            return_std: also return the sample standard deviation of the members (M − 1 in the denominator; infinite
                for a single member). It says how far the members disagree, not how far they are from the truth.

        Returns:
            mean (N, k), or mean and spread (N, k) each.
        """
        X = np.asarray(X, dtype=float)
        mean, spread = np.empty((len(X), self.n_outputs)), np.empty((len(X), self.n_outputs))
        for start in range(0, len(X), _CHUNK):
            rows = slice(start, start + _CHUNK)
            predictions = self.members(X[rows])
            mean[rows] = predictions.mean(axis=0)
            if return_std:
                spread[rows] = member_spread(predictions)
        return (mean, spread) if return_std else mean


def member_spread(predictions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sample standard deviation over the first axis; infinite for a single member."""
    return predictions.std(axis=0, ddof=1) if len(predictions) > 1 else np.full(predictions.shape[1:], np.inf)


@dataclass(frozen=True, eq=False)
class CompiledTrees(Compiled):
    """Regression trees in one set of arrays; node k of all trees together, children after their parent.

    roots: (M,) first node of each tree.
    feature: (nodes,) column compared at the node; −1 at a leaf.
    threshold: (nodes,) float32; a row goes left if x ≤ threshold, x rounded to float32 as scikit-learn does.
    left, right: (nodes,) children; at a leaf, left is the row of `values`.
    values: (rows, k) the distinct leaf outputs. A bag over few payloads has far fewer of them than leaves.
    n_features: d.
    """

    roots: NDArray[np.int32]
    feature: NDArray[np.int32]
    threshold: NDArray[np.float32]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    values: NDArray[np.float64]
    n_features: int

    @property
    def n_members(self) -> int:  # type: ignore[override]
        return len(self.roots)

    @property
    def n_outputs(self) -> int:  # type: ignore[override]
        return self.values.shape[1]

    def validate(self) -> None:
        """Every walk ends at a leaf: children come after their parent, leaves have a row, columns exist."""
        types = {"roots": "i4", "feature": "i4", "threshold": "f4", "left": "i4", "right": "i4", "values": "f8"}
        for name, kind in types.items():
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype != np.dtype(kind) or array.size == 0:
                raise ValueError(f"{name} of the trees is not an array of type {kind}")
        nodes, inner = np.arange(len(self.feature)), self.feature >= 0
        for child in (self.left, self.right):
            if (
                child.shape != nodes.shape
                or np.any((child <= nodes)[inner])
                or child[inner].max(initial=0) >= len(nodes)
            ):
                raise ValueError("a node of the trees has a child that does not come after it")
        leaf = self.left[~inner]
        if self.values.ndim != 2 or np.any(leaf < 0) or np.any(leaf >= len(self.values)):
            raise ValueError("a leaf of the trees has no value")
        if self.threshold.shape != nodes.shape or self.feature.max() >= self.n_features:
            raise ValueError("a node of the trees compares a feature that does not exist")
        if np.any(self.roots < 0) or np.any(self.roots >= len(nodes)):
            raise ValueError("a tree has no root")

    def members(self, X: ArrayLike) -> NDArray[np.float64]:
        X = np.ascontiguousarray(X, dtype=np.float32)
        if X.shape[1:] != (self.n_features,):  # compiled code reads as many numbers
            raise ModelError(f"X has shape {X.shape}: expected {self.n_features} columns")
        return _walk(X, self.roots, self.feature, self.threshold, self.left, self.right, self.values)


@kernel
def _walk(X, roots, feature, threshold, left, right, values):  # pragma: no cover - compiled
    out = np.empty((roots.shape[0], X.shape[0], values.shape[1]))
    for m in range(roots.shape[0]):
        for row in range(X.shape[0]):
            node = roots[m]
            while feature[node] >= 0:
                node = left[node] if X[row, feature[node]] <= threshold[node] else right[node]
            for j in range(values.shape[1]):
                out[m, row, j] = values[left[node], j]
    return out


@dataclass(frozen=True, eq=False)
class CompiledNetworks(Compiled):
    """Networks with one hidden layer, y = relu(x·W1 + b1)·W2 + b2, any scaling of x and y folded into the weights.

    W1: (M, d, h); b1: (M, h); W2: (M, h, k); b2: (M, k). Double precision: folding a mean that is large beside its
    spread (gravity torque) into b1 would cost digits in single precision, and one row then equals its row in a batch to
    rounding.
    """

    W1: NDArray[np.float64]
    b1: NDArray[np.float64]
    W2: NDArray[np.float64]
    b2: NDArray[np.float64]

    @property
    def n_features(self) -> int:  # type: ignore[override]
        return self.W1.shape[1]

    @property
    def n_members(self) -> int:  # type: ignore[override]
        return self.W1.shape[0]

    @property
    def n_outputs(self) -> int:  # type: ignore[override]
        return self.W2.shape[2]

    def validate(self) -> None:
        """Shapes agree and every weight is finite."""
        for name, ndim in {"W1": 3, "b1": 2, "W2": 3, "b2": 2}.items():
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype != np.float64 or array.ndim != ndim:
                raise ValueError(f"{name} of the networks is not a {ndim}-dimensional array of doubles")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} of the networks holds a number that is not finite")
        (M, _, h), k = self.W1.shape, self.n_outputs
        if self.b1.shape != (M, h) or self.W2.shape != (M, h, k) or self.b2.shape != (M, k) or M == 0:
            raise ValueError("the networks' weights do not fit together")

    @cached_property
    def _stacked(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        M, d, h = self.W1.shape
        return np.ascontiguousarray(self.W1.transpose(1, 0, 2).reshape(d, M * h)), self.b1.reshape(M * h)

    def members(self, X: ArrayLike) -> NDArray[np.float64]:
        X = np.asarray(X, dtype=float)
        W1, b1 = self._stacked
        hidden = X @ W1  # (N, M·h): the hidden layers of all members in one product
        hidden += b1
        np.maximum(hidden, 0.0, out=hidden)
        hidden = hidden.reshape(len(X), self.n_members, -1).swapaxes(0, 1)  # (M, N, h)
        return hidden @ self.W2 + self.b2[:, None, :]

    @cached_property
    def _weights(self) -> NDArray[np.float64]:
        """For one row, (M, d + 1 + k, h'): of each member W1, b1 and W2ᵀ below each other; b2 weighs a unit always 1.

        One array costs less to hand over than four. Each row of it begins on a 64-byte line of the cache, units of
        zeros added: one row's prediction takes a sixth longer where reading the weights straddles lines.
        """
        (M, d, h), k = self.W1.shape, self.n_outputs
        shape = (M, d + 1 + k, (h + 8) // 8 * 8)
        size = math.prod(shape)
        room = np.zeros(size + 8)
        start = -room.ctypes.data // 8 % 8
        weights = room[start : start + size].reshape(shape)
        weights[:, :d, :h], weights[:, d, :h], weights[:, d, h] = self.W1, self.b1, 1.0
        weights[:, d + 1 :, :h], weights[:, d + 1 :, h] = self.W2.swapaxes(1, 2), self.b2
        return weights

    def row(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return _forward(x, self._weights)


# BLAS takes twice as long for a single row, and may wake other threads for it. The order of each sum is left to the
# compiler, which then adds several numbers at once.
@kernel(fastmath={"reassoc", "contract", "nsz"})
def _forward(x, weights):  # pragma: no cover - compiled
    (M, rows, h), d = weights.shape, x.shape[0]
    out, hidden = np.empty((M, rows - 1 - d)), np.empty(h)
    for m in range(M):
        for u in range(h):
            hidden[u] = weights[m, d, u]
        for i in range(0, d - 1, 2):  # two at a time: half as many passes over the hidden layer
            for u in range(h):
                hidden[u] += x[i] * weights[m, i, u] + x[i + 1] * weights[m, i + 1, u]
        if d % 2:
            for u in range(h):
                hidden[u] += x[d - 1] * weights[m, d - 1, u]
        for u in range(h):
            hidden[u] = 0.0 if hidden[u] < 0.0 else hidden[u]
        for j in range(out.shape[1]):
            total = 0.0
            for u in range(h):
                total += hidden[u] * weights[m, d + 1 + j, u]
            out[m, j] = total
    return out


@dataclass(eq=False)
class CombinedEnsembles(Compiled):
    """Several ensembles as one; their predictions (M, N, k) are concatenated along `axis`.

    Subclasses name the axis and `joined`, the count that adds up along it; the other counts must agree.
    """

    parts: Sequence[Compiled]
    axis: ClassVar[int]
    joined: ClassVar[str]

    def __post_init__(self) -> None:
        self.parts = tuple(self.parts)
        for name in ("n_features", "n_members", "n_outputs"):
            counts = [getattr(part, name) for part in self.parts]
            if name != self.joined and len(set(counts)) != 1:
                raise ValueError(f"parts differ in {name}: {counts}")
            setattr(self, name, sum(counts) if name == self.joined else counts[0])

    def validate(self) -> None:
        for part in self.parts:
            part.validate()

    def members(self, X: ArrayLike) -> NDArray[np.float64]:
        return np.concatenate([part.members(X) for part in self.parts], axis=self.axis)

    def row(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([part.row(x) for part in self.parts], axis=self.axis)


class StackedOutputs(CombinedEnsembles):
    """Ensembles of different outputs of the same rows, outputs side by side: the two stages of two-stage training."""

    axis, joined = -1, "n_outputs"


class AveragedMembers(CombinedEnsembles):
    """Ensembles of the same outputs as one ensemble of all their members: trees and networks averaged."""

    axis, joined = 0, "n_members"
