"""Recursive total least squares (RTLS): the regressor carries errors too, and they are known in shape.

Differentiating a measured velocity puts an error e = (e_1 … e_n) into the acceleration. Torque and regressor are linear
in it, so that a row of joint j, z_j = [Y_j, y_j] with y = tau − tau_bare, carries the error

    Σ_i e_i·d_ij + (0, …, 0, e_tau),      d_ij = [∂Y_j/∂ddq_i, −M_ji]

with the mass matrix M of the bare arm. Total least squares takes the phi for which v = [phi, −1] makes the residual
smallest in units of its expected error, vᵀ·A·v / vᵀ·B·v, where A = Σ w_j·z_jᵀ·z_j and B is what A expects of the errors
alone: v is the generalised eigenvector of the smallest eigenvalue 1/λ. From it follows

    phi = (A_YY − B_YY/λ)⁻¹·(A_Yy − B_Yy/λ).

A and B accumulate in constant memory, which makes it recursive. Scaling: columns by the size a payload may have, rows
by the residual of each joint. The noise is found from the log: e_i from fourth differences of the acceleration over
every other row, where a smooth motion leaves nothing and neighbours of a differenced signal do not count twice; e_tau
is what the residual holds beyond e.

Sources: Golub & Van Loan, SIAM J. Numer. Anal. 1980 (TLS); Van Huffel & Vandewalle, SIAM 1991 (known error covariance,
nongeneric problems); Kubus, Kröger & Wahl, IROS 2008, doi 10.1109/IROS.2008.4650672 (RTLS for loads; they update a
singular value decomposition of [Y y], with a force/torque sensor and no structure in the errors).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, momentum_regressor, payload_regressor
from armload.estimators.contract import Estimate
from armload.estimators.normal import RESOLUTION, UNKNOWN, NormalLeastSquares

_FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # the fourth difference: what it leaves of a smooth motion is noise
_APART = 2  # rows between its terms: differences of a white velocity are uncorrelated from there on
_PASSES = 4  # the torque's share of the residual follows from phi and the other way round
_LEAST_TORQUE = 0.02  # of the residual's variance is the torque's at least
# Share of a direction of A that may be the regressor's error: beyond it the problem is nongeneric, and the little that
# is left would be blown up
_MOST_ERROR = 0.9


class RecursiveTotalLeastSquares(NormalLeastSquares):
    """RTLS on differentiated velocity: what `RecursiveLeastSquares` does, with its noise accounted for, not filtered.

    Rows stand midway between two samples: ddq = Δdq/Δt, and the mean of q, dq and tau. The covariance is that of
    `NormalLeastSquares` with G = (A_YY − B_YY/λ)⁻¹.

    >>> from armload.arms import arm
    >>> RecursiveTotalLeastSquares(arm("panda")).name
    'rtls'

    Args:
        arm: the bare arm.
    """

    name = "rtls"

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm, weighted=True)

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        n = self.arm.n
        self._D = np.zeros((n, n, 11, 11))  # Σ d_ijᵀ·d_ij: what a unit of noise in the acceleration does to A
        self._noise, self._differences = np.zeros(n), 0  # sum of squared fourth differences, and how many
        super().reset()

    def _restart(self) -> None:
        self._before: tuple[NDArray, ...] | None = None  # t, q, dq, tau of the last sample, each (1, ...)
        self._accelerations = np.zeros((0, self.arm.n))  # the last eight

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        samples: tuple[NDArray, ...] = (t, q, dq, tau)
        if self._before is not None:
            samples = tuple(np.concatenate([b, x]) for b, x in zip(self._before, samples, strict=True))
        self._before = tuple(x[-1:] for x in samples)
        h = np.diff(samples[0])[:, None]
        ddq = np.diff(samples[2], axis=0) / h
        self._listen(ddq)
        t, q, dq, tau = (0.5 * (x[1:] + x[:-1]) for x in samples)
        if not len(t):
            return t, tau, np.zeros((0, self.arm.n, 10))
        motion = self.arm.frame_motion(q)
        M = np.array([self.arm.mass_matrix(pose) for pose in q])
        for i in range(self.arm.n):
            unit = np.zeros_like(q)
            unit[:, i] = 1.0
            # the payload's inertia torque is linear in ddq as its momentum is in dq, with the same matrix
            d = np.concatenate([momentum_regressor(motion, unit).momentum, -M[:, i, :, None]], 2)
            self._D[i] += np.einsum("kja,kjb->jab", d, d, optimize=True)
        return t, tau - self.arm.torque(q, dq, ddq), payload_regressor(motion, dq, ddq)

    def _listen(self, ddq: NDArray) -> None:
        """Take the next accelerations (M, n) into the estimate of their noise."""
        seen = np.concatenate([self._accelerations, ddq])
        last = _APART * (len(_FOURTH) - 1)
        self._accelerations = seen[-last:]
        count = len(seen) - last
        if count > 0:
            terms = (c * seen[_APART * k : _APART * k + count] for k, c in enumerate(_FOURTH))
            self._noise += np.sum(np.sum(list(terms), axis=0) ** 2, axis=0)
            self._differences += count

    def _estimate(self, t: float) -> Estimate:
        if not self._rows_seen:
            return super()._estimate(t)
        phi, _ = self._solve(np.ones(self.arm.n))
        w = 1.0 / self._residual_variance(phi)
        variance = self._noise / (np.sum(_FOURTH**2) * max(self._differences, 1))  # of e_i [rad²/s⁴]
        scale = np.append(UNKNOWN, 1.0)
        error = np.einsum("i,ijab->jab", variance, self._D) * np.outer(scale, scale)
        A = np.einsum("j,jab->ab", w, self._moments()) * np.outer(scale, scale)
        A[:10, :10] += np.eye(10)
        A[10, 10] += self._rows_seen * np.sum(w) * RESOLUTION**2
        x = phi / UNKNOWN
        G = np.eye(10)
        for _ in range(_PASSES):
            v = np.append(x, -1.0)
            total = self._residual_variance(x * UNKNOWN)
            explained = np.einsum("a,jab,b->j", v, error, v) / self._rows_seen
            B = np.einsum("j,jab->ab", w, error)
            B[10, 10] += self._rows_seen * (w @ np.maximum(total - explained, _LEAST_TORQUE * total))
            B /= _relative(B, A)[0][-1]
            share, V = _relative(B[:10, :10], A[:10, :10])  # Vᵀ·A_YY·V = 1, Vᵀ·B_YY·V = diag(share)
            G = (V / (1.0 - np.minimum(share, _MOST_ERROR))) @ V.T
            x = G @ (A[:10, 10] - B[:10, 10])
        phi, G = x * UNKNOWN, G * np.outer(UNKNOWN, UNKNOWN)
        return Estimate(float(t), phi, self._covariance(phi, G, w), self._count, str(self.arm.frame))

    def _moments(self) -> NDArray[np.float64]:
        """Σ z_jᵀ·z_j of each joint's rows (n, 11, 11)."""
        top = np.concatenate([self._A, self._b[:, :, None]], axis=2)
        bottom = np.concatenate([self._b, self._c[:, None]], axis=1)
        return np.concatenate([top, bottom[:, None]], axis=1)


def _relative(B: NDArray[np.float64], A: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """λ (k,), rising, and V (k, k) with Vᵀ·A·V = 1 and Vᵀ·B·V = diag(λ): B·v = λ·A·v, A positive definite."""
    L = np.linalg.cholesky(A)
    half = np.linalg.solve(L, B)
    values, vectors = np.linalg.eigh(np.linalg.solve(L, half.T))
    return values, np.asarray(np.linalg.solve(L.T, vectors), dtype=float)
