"""Prediction of support-vector machines with a Gaussian kernel, without scikit-learn.

    y(x) = y_mean + y_scale·(Σ_i a_i·exp(−γ·|z − z_i|²) + b),      z = (x − x_mean)/x_scale

The rows z_i are shared by the outputs of one member; a_i is zero where a row supports one output and not another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.ensembles.compiled import Compiled

_BLOCK = 256  # rows at a time: bounds the memory of the kernel's matrix


@dataclass(frozen=True, eq=False)
class CompiledSupportVectors(Compiled):
    """Support-vector machines of M members, k outputs each, in shared arrays.

    rows: (M, R, d) support vectors z, scaled; a member with fewer than R has rows of zeros, with weights of zero.
    weights: (M, R, k) a; bias: (M, k) b; both in units of the outputs, y_scale included.
    gamma: (M,) γ. x_mean, per_x: (d,) centre and inverse scale of the features, 0 for a constant one.
    """

    rows: NDArray[np.float64]
    weights: NDArray[np.float64]
    bias: NDArray[np.float64]
    gamma: NDArray[np.float64]
    x_mean: NDArray[np.float64]
    per_x: NDArray[np.float64]

    @property
    def n_features(self) -> int:  # type: ignore[override]
        return self.rows.shape[2]

    @property
    def n_members(self) -> int:  # type: ignore[override]
        return self.rows.shape[0]

    @property
    def n_outputs(self) -> int:  # type: ignore[override]
        return self.weights.shape[2]

    def validate(self) -> None:
        """Shapes agree and every number is finite."""
        for name, ndim in {"rows": 3, "weights": 3, "bias": 2, "gamma": 1, "x_mean": 1, "per_x": 1}.items():
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype != np.float64 or array.ndim != ndim:
                raise ValueError(f"{name} of the support vectors is not a {ndim}-dimensional array of doubles")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} of the support vectors holds a number that is not finite")
        M, R, d = self.rows.shape
        expected = ((M, R, self.n_outputs), (M, self.n_outputs), (M,), (d,), (d,))
        found = tuple(x.shape for x in (self.weights, self.bias, self.gamma, self.x_mean, self.per_x))
        if found != expected or M == 0 or np.any(self.gamma <= 0):
            raise ValueError("the support vectors' arrays do not fit together")

    def members(self, X: ArrayLike) -> NDArray[np.float64]:
        Z = (np.asarray(X, dtype=float) - self.x_mean) * self.per_x
        out = np.empty((self.n_members, len(Z), self.n_outputs))
        for m, rows in enumerate(self.rows):
            own = np.sum(rows**2, axis=1)
            for start in range(0, len(Z), _BLOCK):
                part = Z[start : start + _BLOCK]
                square = np.sum(part**2, axis=1)[:, None] + own - 2.0 * part @ rows.T
                kernel = np.exp(-self.gamma[m] * np.maximum(square, 0.0))
                out[m, start : start + _BLOCK] = kernel @ self.weights[m] + self.bias[m]
        return out
