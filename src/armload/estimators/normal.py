"""Least squares from normal equations in constant memory: ordinary and weighted, on any rows y = Y·phi.

    phi = (Σ_j w_j·A_j + P_0⁻¹)⁻¹·Σ_j w_j·b_j,      A_j = Σ Y_jᵀ·Y_j,  b_j = Σ Y_jᵀ·y_j  over the rows of joint j

P_0 is so wide (`UNKNOWN`) that it only keeps the first samples finite. Ordinary least squares (OLS) has w_j = 1,
weighted least squares (WLS) w_j = 1/s_j², s_j² the variance of joint j's residual, found from the data by solving twice
more. What the rows are is a subclass's choice; `ols` and `wls` take the acceleration-free ones (`regression.rows`).

Sources: Atkeson, An & Hollerbach, IJRR 1986 (OLS); Gautier & Poignet, Control Engineering Practice 2001 (WLS).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.estimators.contract import Estimate, Identifier
from armload.recording import GAP
from armload.regression import BlockMeans, FilteredRegression
from armload.regression.lag import GAIN

# [kg, kg·m, kg·m²] standard deviations of what a payload may be before anything is known: far beyond what any arm
# carries: the first samples stay finite, and nothing is drawn (test_ols_is_the_batch_solution_of_the_filtered_rows)
UNKNOWN = np.array([100.0] + [10.0] * 3 + [3.0] * 6)
# [N·m] no joint's torque is known better; of exact logs the weights stay finite
RESOLUTION = 1e-3
# solutions after the first, each with the weights of the one before: the weights need phi to a few per cent only
_PASSES = 2


class NormalLeastSquares(Identifier):
    """Accumulates rows y = Y·phi joint by joint and solves for phi; a subclass says what y and Y are.

    The covariance is G·(Σ_j w_j²·S_j·A_j + P_0⁻¹)·G with G = (Σ_j w_j·A_j + P_0⁻¹)⁻¹ and S_j the long-run variance of
    the residual per row (batch means): neighbouring residuals are not independent. It is P_0 while that is unknown.

    Args:
        arm: the bare arm.
        weighted: weigh each joint by the inverse of its residual's variance.
    """

    def __init__(self, arm: Arm, weighted: bool = False) -> None:
        self.arm, self.weighted = arm, weighted
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        n = self.arm.n
        self._A, self._b, self._c = np.zeros((n, 10, 10)), np.zeros((n, 10)), np.zeros(n)  # ΣYᵀY, ΣYᵀy, Σy²
        self._rows_seen, self._count = 0, 0
        self._blocks = BlockMeans((n, 11))  # of [Y, y]
        self._last_t = self._last_row = -np.inf
        self._restart()

    def weighted_solution(self, phi: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """phi (10,) and G (10, 10) with the weights that an estimate (10,) asks for, and the rows per second."""
        w = 1.0 / self._residual_variance(phi) if self._rows_seen else np.ones(self.arm.n)
        return *self._solve(w), self._blocks.rate

    @abstractmethod
    def _restart(self) -> None:
        """Forget the signal processing's past, as after a gap in the log."""

    @abstractmethod
    def _rows(
        self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Times (M,), y (M, n) and Y (M, n, 10) of the rows that the next N samples complete."""

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        for part in self._between_gaps(t):
            self._add(*self._rows(t[part], q[part], dq[part], tau[part]))

    def _between_gaps(self, t: NDArray) -> Iterator[slice]:
        """The parts of times t (N,) between gaps; the filters begin anew before each part that follows a gap."""
        edges = np.flatnonzero(np.diff(t, prepend=self._last_t) > GAP)
        for start, stop in zip([0, *edges], [*edges, len(t)], strict=True):
            if start in edges:
                self._restart()
                self._last_row = t[start]
            if stop > start:
                yield slice(start, stop)
        if len(t):
            self._last_t, self._count = t[-1], self._count + len(t)

    def _add(self, t: NDArray, y: NDArray, Y: NDArray) -> None:
        if not len(t):
            return
        for j in range(self.arm.n):
            self._A[j] += Y[:, j].T @ Y[:, j]
            self._b[j] += Y[:, j].T @ y[:, j]
        self._c += np.sum(y**2, axis=0)
        self._rows_seen += len(t)
        for h, row in zip(np.diff(t, prepend=self._last_row), np.concatenate([Y, y[..., None]], axis=2), strict=True):
            self._blocks.add(h, row)
        self._last_row = t[-1]

    def _estimate(self, t: float) -> Estimate:
        w = np.ones(self.arm.n)
        phi, G = self._solve(w)
        for _ in range(_PASSES if self.weighted and self._rows_seen else 0):
            w = 1.0 / self._residual_variance(phi)
            phi, G = self._solve(w)
        return Estimate(float(t), phi, self._covariance(phi, G, w), self._count, str(self.arm.frame))

    def _solve(self, w: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi (10,) and G (10, 10) for weights w (n,)."""
        A, b = np.einsum("j,jab->ab", w, self._A), w @ self._b
        scale = UNKNOWN  # the columns' units do not mix
        G = np.linalg.inv(scale[:, None] * A * scale + np.eye(10))
        G = scale[:, None] * (0.5 * (G + G.T)) * scale
        return G @ b, G

    def _residual_variance(self, phi: NDArray) -> NDArray[np.float64]:
        """s_j² (n,) [N²·m²]: mean square of each joint's residual at phi."""
        square = self._c - 2.0 * self._b @ phi + np.einsum("a,jab,b->j", phi, self._A, phi)
        return np.maximum(square / self._rows_seen, RESOLUTION**2)

    def _covariance(self, phi: NDArray, G: NDArray, w: NDArray) -> NDArray[np.float64]:
        means, times, _ = self._blocks.means()
        if not self._blocks.ready:
            return np.diag(UNKNOWN**2)
        residual = means[..., 10] - means[..., :10] @ phi
        freedom = max(1.0 - 10.0 / residual.size, 0.2)  # ten of the residual's degrees of freedom went into phi
        S = np.mean(residual**2 * times[:, None], axis=0) / freedom * self._blocks.rate
        S = np.maximum(S, RESOLUTION**2)  # two copies of one log leave no residual at all
        noise = np.einsum("j,jab->ab", w**2 * S, self._A) + np.diag(UNKNOWN**-2)
        C = G @ noise @ G
        return 0.5 * (C + C.T)


class OrdinaryLeastSquares(NormalLeastSquares):
    """OLS on the acceleration-free filtered regression r = W·phi: the plainest estimate that is exact for an exact arm.

    >>> from armload.arms import arm
    >>> OrdinaryLeastSquares(arm("panda")).name
    'ols'

    Args:
        arm: the bare arm.
        gain: λ of the lag [1/s].
    """

    name = "ols"

    def __init__(self, arm: Arm, gain: float = GAIN) -> None:
        self._regression = FilteredRegression(arm, gain)
        super().__init__(arm)

    def _restart(self) -> None:
        self._regression.reset()

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        return t, *self._regression(t, q, dq, tau)


class WeightedLeastSquares(NormalLeastSquares):
    """WLS on the same rows as `OrdinaryLeastSquares`: a joint whose torque fits badly counts less.

    >>> from armload.arms import arm
    >>> WeightedLeastSquares(arm("panda")).name
    'wls'

    Args:
        arm: the bare arm.
        gain: λ of the lag [1/s].
    """

    name = "wls"

    def __init__(self, arm: Arm, gain: float = GAIN) -> None:
        self._regression = FilteredRegression(arm, gain)
        super().__init__(arm, weighted=True)

    def _restart(self) -> None:
        self._regression.reset()

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        return t, *self._regression(t, q, dq, tau)
