"""Joint arm-and-payload identification: the whole arm anew, from tare and run together, without priors.

    r_tare = Z·eta + e,      r_run = W·phi + Z·eta + e,      Z·eta = Z·B·beta

eta are the deviations of the arm from its model: ten inertial parameters per link, friction, offsets, motor inertia
(`regression.mismatch`). Most of them never show alone; B spans what shows, the base parameters, found as the right
singular vectors of Z at random states. [phi, beta] then follow from weighted least squares, joints weighed by the
long-run variance of their residual. Directions that the two motions leave unexcited are held at zero by a ridge of 1e-8
of the largest information, and have the covariance that goes with it: where they reach phi, nothing is known.

What was mounted at the tare is part of the last link; the answer is what was added since. Sources: Khalil, Gautier &
Lemoine, ICRA 2007 (arm and load together); Gautier, J. Robotic Systems 1991 (base parameters numerically).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.estimators.contract import Estimate, Identifier
from armload.estimators.normal import UNKNOWN
from armload.recording import Recording, Sample
from armload.regression import Correction, payload_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import RIGID
from armload.runtime.one_thread import one_thread

_STATES = 200  # random states that show which directions of eta ever act
_STRUCTURAL = 1e-8  # of the largest singular value: below it a direction never acts
_UNSEEN = 1e-8  # of the largest information: as much is added to every direction, so that none is without any
_PASSES = 2  # solutions, the first with the residual as expected before


class JointLeastSquares(Identifier):
    """Weighted least squares for the payload and for all base parameters of the arm, from a tare and a run.

    The covariance is that of phi among all unknowns: what the arm may be instead widens it.

    Args:
        arm: the bare arm.
        tare: an earlier log of the same arm, on a motion that moves all joints widely; tens of seconds are better.
        gain: λ of the lag [1/s].
        refresh: solved anew at most this often [s] while streaming.
    """

    name = "joint"

    def __init__(self, arm: Arm, tare: Recording, gain: float = GAIN, refresh: float = 0.02) -> None:
        self.arm, self.gain, self.refresh = arm, gain, refresh
        self._check(tare)
        self._correction = Correction(arm, rated_effort(arm))
        self._base = base_parameters(self._correction)
        self._tare = RegressionData(self._correction, gain)
        self._tare.add(tare.t, tare.q, tare.dq, tare.tau)
        self.reset()

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._run = RegressionData(self._correction, self.gain)
        self._solved_at, self._count = -np.inf, 0
        self._phi, self._covariance = np.zeros(10), np.diag(UNKNOWN**2)

    @property
    def base_size(self) -> int:
        """Number of base parameters of the arm, friction and offsets among them."""
        return self._base.shape[1]

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far, at most `refresh` old."""
        self._check_sample(sample)
        if sample.t - self._solved_at >= self.refresh:
            return super().update(sample)
        self._take(np.array([sample.t]), sample.q[None], sample.dq[None], sample.tau[None])
        return self._last(sample.t)

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        self._run.add(t, q, dq, tau)
        self._count += len(t)

    def _estimate(self, t: float) -> Estimate:
        with one_thread():  # matrices of a hundred rows: BLAS threads cost more than they bring
            self._phi, self._covariance = self._solve()
        self._solved_at = t
        return self._last(t)

    def _last(self, t: float) -> Estimate:
        return Estimate(float(t), self._phi.copy(), self._covariance.copy(), self._count, str(self.arm.frame))

    def _solve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi (10,) and its covariance; unknowns z = [phi, beta] in units in which they are near 1."""
        p, b = self._correction.size, self._base.shape[1]
        with_payload = np.zeros((10 + p, 10 + b))
        with_payload[:10, :10] = np.diag(payload_prior_std(self.arm))
        with_payload[10:, 10:] = self._base
        without = with_payload.copy()
        without[:10] = 0.0
        parts = [(self._tare, without), (self._run, with_payload)]
        expected = (RIGID.residual * self._correction.effort) ** 2 * self._tare.blocks.block
        S = [expected for _ in parts]
        z, C = np.zeros(10 + b), np.eye(10 + b)
        for _ in range(_PASSES):
            A, v = np.zeros((10 + b, 10 + b)), np.zeros(10 + b)
            for (data, E), s in zip(parts, S, strict=True):
                A += E.T @ np.tensordot(1.0 / s, data.A, 1) @ E
                v += E.T @ (1.0 / s @ data.b)
            A[np.diag_indices_from(A)] += max(_UNSEEN * A.diagonal().max(), 1e-12)
            C = np.linalg.inv(A)
            z = C @ v
            S = [data.residual_variance(E @ z, expected) for data, E in parts]
        scale = np.diag(with_payload)[:10]
        C = scale[:, None] * C[:10, :10] * scale
        return scale * z[:10], 0.5 * (C + C.T)


def base_parameters(correction: Correction) -> NDArray[np.float64]:
    """B (p, b): the directions of eta that any motion can show, eta = B·beta, in units of eta's prior spread.

    A direction never acts if its momentum and its drift vanish at all states; the right singular vectors of both,
    stacked over random states, tell.
    """
    rng, limits = np.random.default_rng(0), correction.arm.limits
    low, high = np.maximum(limits.position_low, -np.pi), np.minimum(limits.position_high, np.pi)
    q = rng.uniform(low, high, size=(_STATES, correction.arm.n))
    dq = rng.normal(size=q.shape)
    Z = correction.regressor(q, dq, correction.effort * rng.normal(size=q.shape))
    scale = correction.prior_std
    rows = np.concatenate(
        [part.reshape(-1, correction.size) / np.tile(correction.effort, len(q))[:, None] * scale for part in Z]
    )
    _, singular, right = np.linalg.svd(rows, full_matrices=False)
    return scale[:, None] * right[singular > _STRUCTURAL * singular[0]].T
