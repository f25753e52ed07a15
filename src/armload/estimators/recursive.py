"""Recursive least squares (RLS), the paper's benchmark: on differentiated acceleration, and behind an observer's lag.

Both fit y = Y·phi sample by sample,

    K = P·Yᵀ·(μ·1 + Y·P·Yᵀ)⁻¹,   phi ← phi + K·(y − Y·phi),   P ← (P − K·Y·P)/μ,

with forgetting factor μ. They differ in what y and Y are. Sources: Atkeson, An, Hollerbach, IJRR 1986 (least squares);
Kurdas et al., ICRA 2022, doi 10.1109/ICRA46639.2022.9811691 (observer, matched filter; their virtual calibration is
`armload.estimators.contract.Tared`).
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, payload_regressor
from armload.errors import IdentificationError
from armload.estimators.contract import Estimate, Identifier
from armload.inertia.cholesky import factor, solve
from armload.recording import GAP
from armload.regression import BlockMeans
from armload.regression.lag import GAIN, Lag
from armload.runtime.kernels import kernel

AT_REST = 0.01  # [rad/s] of any joint: slower is noise of the velocity, and tells nothing of an inertia
_TRANSIENT = 5.0  # time constants after which an observer started in motion has settled
# Initial P: standard deviations of 10 kg, 1 kg·m and 0.3 kg·m², so that the columns' units do not mix.
_INITIAL_STD = np.array([10.0] + [1.0] * 3 + [0.3] * 6)


class _Recursive(Identifier):
    """The recursion and its uncertainty; a subclass says what y and Y are.

    The covariance is A⁻¹·(Σ_j S_j·A_j)·A⁻¹, where A_j is joint j's part of the information A = Σ YᵀY and S_j the
    long-run variance of its residual (batch means): naive least squares would take residuals for independent.
    """

    def __init__(self, arm: Arm, forgetting: float = 1.0) -> None:
        """
        Args:
            arm: the bare arm.
            forgetting: μ in (0, 1]; 1 remembers everything.
        """
        if not 0.0 < forgetting <= 1.0:
            raise IdentificationError(f"forgetting is {forgetting}: expected a factor above 0 and at most 1")
        self.arm, self.forgetting = arm, forgetting
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        n = self.arm.n
        self._phi, self._P = np.zeros(10), np.diag(_INITIAL_STD**2)
        self._information = np.zeros((n, 10, 10))  # A_j
        self._residual = BlockMeans(n)
        self._count, self._last_t = 0, None
        self._restart()

    @abstractmethod
    def _equations(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray]:
        """y (N, n) and Y (N, n, 10) of the next N samples; NaN rows where a sample gives no equation."""

    @abstractmethod
    def _restart(self) -> None:
        """Forget the signal processing's past."""

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        gaps = np.flatnonzero(np.diff(t, prepend=t[0] if self._last_t is None else self._last_t) > GAP)
        for start, stop in zip([0, *gaps], [*gaps, len(t)], strict=True):
            if start in gaps:
                self._restart()
                self._last_t = None
            if stop > start:
                self._segment(t[start:stop], q[start:stop], dq[start:stop], tau[start:stop])

    def _segment(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Take samples without a gap between them."""
        y, Y = self._equations(t, q, dq, tau)
        residual = _recursion(self._phi, self._P, self._information, y, Y, self.forgetting)
        h = np.diff(t, prepend=t[0] if self._last_t is None else self._last_t)
        for step, e in zip(h, residual, strict=True):
            if step > 0 and np.isfinite(e[0]):
                self._residual.add(step, e)
        self._last_t, self._count = t[-1], self._count + len(t)

    def _estimate(self, t: float) -> Estimate:
        return Estimate(float(t), self._phi.copy(), self._covariance(), self._count, str(self.arm.frame))

    def _covariance(self) -> NDArray[np.float64]:
        if not self._residual.ready:
            return np.diag(_INITIAL_STD**2)
        per_sample = self._residual.long_run_variance() * self._residual.rate
        noise = np.einsum("j,jab->ab", per_sample, self._information) + np.diag(_INITIAL_STD**-2)
        return self._P @ noise @ self._P


@kernel
def _recursion(phi: NDArray, P: NDArray, A: NDArray, y: NDArray, Y: NDArray, mu: float) -> NDArray:
    """The recursion over N samples, in place; returns the residuals (N, n) after each update."""
    N, n = y.shape
    residual = np.full(y.shape, np.nan)
    PYt, K, S, L, e = np.empty((10, n)), np.empty((10, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for k in range(N):
        if not np.isfinite(y[k, 0]):
            continue
        Yk = Y[k]
        for a in range(10):
            for j in range(n):
                PYt[a, j] = 0.0
                for b in range(10):
                    PYt[a, j] += P[a, b] * Yk[j, b]
        for i in range(n):
            for j in range(n):
                S[i, j] = mu if i == j else 0.0
                for a in range(10):
                    S[i, j] += Yk[i, a] * PYt[a, j]
        factor(S, L, 0.0)
        for a in range(10):
            solve(L, PYt[a], K[a])  # row by row: S is symmetric
        _misfit(phi, y[k], Yk, e)
        for a in range(10):
            for j in range(n):
                phi[a] += K[a, j] * e[j]
        for a in range(10):
            for b in range(a + 1):
                both = P[a, b] + P[b, a]
                for j in range(n):
                    both -= K[a, j] * PYt[b, j] + K[b, j] * PYt[a, j]
                P[a, b] = P[b, a] = both / (2.0 * mu)
        _misfit(phi, y[k], Yk, residual[k])
        for j in range(n):
            for a in range(10):
                for b in range(10):
                    A[j, a, b] = mu * A[j, a, b] + Yk[j, a] * Yk[j, b]
    return residual


@kernel
def _misfit(phi: NDArray, y: NDArray, Y: NDArray, e: NDArray) -> None:
    """e (n,) = y − Y·phi."""
    for j in range(len(y)):
        e[j] = y[j]
        for a in range(10):
            e[j] -= Y[j, a] * phi[a]


class RecursiveLeastSquares(_Recursive):
    """RLS with joint acceleration from differences of the measured velocity: the plain benchmark.

    y = tau − tau_bare(q, dq, ddq), Y = Y(q, dq, ddq), ddq = (dq_k − dq_(k−1))/(t_k − t_(k−1)).

    >>> from armload.arms import arm
    >>> RecursiveLeastSquares(arm("panda")).name
    'rls'

    Args:
        arm: the bare arm.
        forgetting: μ in (0, 1], the weight that a row keeps with each that follows; 1 remembers everything.

    Raises:
        IdentificationError: another forgetting.
    """

    name = "rls"

    def _restart(self) -> None:
        self._last: tuple[float, NDArray] | None = None

    def _equations(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray]:
        before = (np.nan, np.full(dq.shape[1], np.nan)) if self._last is None else self._last
        self._last = (t[-1], dq[-1])
        ddq = np.diff(dq, axis=0, prepend=before[1][None]) / np.diff(t, prepend=before[0])[:, None]
        known = np.where(np.isfinite(ddq), ddq, 0.0)
        y = tau - self.arm.torque(q, dq, known)
        y[~np.isfinite(ddq[:, 0])] = np.nan  # the first sample has no acceleration yet
        return y, payload_regressor(self.arm.frame_motion(q), dq, known)


class FilteredRecursiveLeastSquares(_Recursive):
    """RLS on a momentum observer's torque, with q and dq passed through the observer's own lag.

    y = r = F[tau − tau_bare] from the momentum observer with gain λ (no acceleration), Y = Y(F[q], F[dq], d/dt F[dq]).
    F[Y(q, dq, ddq)] is not Y(F[q], F[dq], F[ddq]): the method keeps that error, as published; a gain of 50 1/s and
    above makes it small.

    Args:
        arm: the bare arm.
        gain: λ of the observer and of the filter [1/s].
        forgetting: as in `RecursiveLeastSquares`.

    Raises:
        IdentificationError: another forgetting.
    """

    name = "rls-filter"

    def __init__(
        self,
        arm: Arm,
        gain: float = GAIN,
        forgetting: float = 1.0,
    ) -> None:
        self.gain = gain
        super().__init__(arm, forgetting)

    def _restart(self) -> None:
        self._observer, self._filter = Lag(self.gain), Lag(self.gain)
        self._from: float | None = None  # time from which the observer is trusted

    def _equations(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray]:
        p, drift = self.arm.momentum(q, dq)
        # both lags start at their first input: exact from rest; after a start in motion the transient is left out
        if self._from is None:
            self._from = t[0] + (_TRANSIENT / self.gain if np.abs(dq[0]).max() > AT_REST else 0.0)
        u = tau - drift + self.gain * p
        r = self._observer(t, u, initial=u[0]) - self.gain * p
        signal = np.stack([q, dq], axis=1)  # (N, 2, n)
        lagged = self._filter(t, signal, initial=signal[0])
        ddq = self.gain * (dq - lagged[:, 1])  # the derivative of the lag's output, exactly
        r[t < self._from] = np.nan
        return r, payload_regressor(self.arm.frame_motion(lagged[:, 0]), lagged[:, 1], ddq)
