"""What designed motions are to tell of a payload: the log-determinant of its posterior, and its gradient.

    J = log det (Λ + P_phi⁻¹) = −log det B

B is the Bayesian Cramér–Rao bound of `posterior.cramer_rao`: prior, tare and the arm's mismatch are in it. J grows by 1
for each parameter whose standard deviation falls to e^(−1/2). Let run k have the rows X_j(t) of joint j, information
A_j = ∫ w·X_jᵀ·X_j dt / S_j, and K_j = Cov(phi, x_j) what the posterior says of payload and unknowns together. Then

    dJ = Σ_k Σ_j tr(G_j·dA_j),   G_j = K_jᵀ·B⁻¹·K_j / S_j

which has rank 10: the gradient with respect to all rows costs two thin products, whatever the number of unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.excitation.rows import MotionRows, RowAdjoint, RowModel
from armload.inertia import Z95
from armload.motion import Motion
from armload.posterior import Profile
from armload.posterior.cramer_rao import followed
from armload.posterior.problem import Problem
from armload.posterior.scales import Scales
from armload.recording import Recording
from armload.regression import Correction, GaussianPrior, JointFeatures, payload_prior_std
from armload.regression.information import SAME, RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, whole_noise
from armload.runtime.one_thread import one_thread

# of pose and velocity: the bound with 128 and 12 differs by less than 1e-5 of a half-width with a tare along the same
# motion, by up to 4 % without one or with another (test_what_is_maximised_is_the_bound)
_FEATURES = (32, 4)


class CriterionValue(NamedTuple):
    """J, its change with q and dq of each motion (N, n), and the bound B (10, 10)."""

    value: float
    changes: list[RowAdjoint]
    covariance: NDArray[np.float64]

    @property
    def half_width(self) -> NDArray[np.float64]:
        """Of the 95 % intervals (10,)."""
        return Z95 * np.sqrt(np.diag(self.covariance))


class Criterion:
    """J of one or two motions that are designed: the loaded run, and the empty run that goes with it.

    Args:
        arm: the bare arm.
        tare: "same": the loaded run's own motion, run empty before; "own": the second motion; None: no tare; a log or a
            motion: that one.
        profile: what was learned of the arm from many logs; None: there is none.
        prior: of the payload; None: the weak prior.
    """

    def __init__(
        self,
        arm: Arm,
        tare: str | Recording | Motion | None = "same",
        profile: Profile | None = None,
        prior: GaussianPrior | None = None,
    ) -> None:
        self.arm = arm
        self.correction = Correction(arm, rated_effort(arm)) if profile is None else profile.correction(arm)
        self.features = JointFeatures(arm.n, *_FEATURES) if profile is None else profile.features
        self.model = RowModel(self.correction, self.features, GAIN)
        self.noise = SMOOTH
        self._session = SAME if profile is None else profile.session(self.correction)
        self._prior_std = payload_prior_std(arm)
        weak = GaussianPrior.weak(arm) if prior is None else prior
        self._prior = GaussianPrior(np.zeros(10), weak.covariance)
        self._start: Scales | None = None if profile is None else profile.scales
        self._fixed: list[RegressionData] = []
        self._designed_tare = tare if isinstance(tare, str) else None
        if profile is not None:
            self._fixed.append(profile.data(self.correction, GAIN, self.noise.block))
        if isinstance(tare, Recording | Motion):
            log = followed(arm, tare)
            data = RegressionData(self.correction, GAIN, self.features, self.noise.block, self._session)
            data.add(log.t, log.q, log.dq, log.tau)
            data.b[:] = 0.0
            data.noise = self._noise(log.duration)
            self._fixed.append(data)

    @property
    def motions(self) -> int:
        """How many motions it is about: the loaded run, and an empty run of its own."""
        return 2 if self._designed_tare == "own" else 1

    @property
    def designed_tare(self) -> str | None:
        """The empty run that is designed with the loaded one: "same", "own"; None: there is none, or another log."""
        return self._designed_tare

    @property
    def prior_half_width(self) -> NDArray[np.float64]:
        """Of the 95 % intervals before the run (10,)."""
        return Z95 * self._prior.std

    def __call__(self, motions: Sequence[MotionRows]) -> CriterionValue:
        """J of the rows of the loaded run, and of its own empty run where there is one."""
        order = {"same": [0, 0], "own": [1, 0], None: [0]}[self._designed_tare]
        runs = [self._data(rows) for rows in motions]
        several = [*self._fixed, *(copy(runs[k]) for k in order)]  # a problem tells its runs apart by identity
        with one_thread():
            problem = Problem(several, self._prior_std, self._prior, self.noise)
            scales = problem.scales(None)
            if self._start is not None:
                scales = problem.scales(
                    Scales(scales.noise, self._start.eta, self._start.features, scales.payloads, self._start.drifts)
                )
            found = problem.posterior(scales)
            B = found.covariance[problem.last, problem.last]
            L = np.linalg.cholesky(B)
            with_phi = np.linalg.solve(L, found.covariance[problem.last]).T  # Cov(z, phi)·L⁻ᵀ, (z, 10)
            changes, first = [RowAdjoint.zero(rows) for rows in motions], len(self._fixed)
            for which, rows in enumerate(motions):
                places = [k for k, its in enumerate(order, start=first) if its == which]
                parts = [self._root(problem.selections[k], found.slope, with_phi, scales.noise[k]) for k in places]
                self._back(rows, np.concatenate(parts, axis=2), changes[which])
        return CriterionValue(-2.0 * float(np.log(np.diag(L)).sum()), changes, B)

    @staticmethod
    def _root(selection: NDArray, slope: NDArray, with_phi: NDArray, noise: NDArray) -> NDArray[np.float64]:
        """F (n, size, 10) of one run, F_j·F_jᵀ = G_j; from Cov(z, phi)·L⁻ᵀ (z, 10), L·Lᵀ = B."""
        shared = selection @ with_phi  # (10 + p, 10)
        own = -slope @ with_phi  # (n, R, 10)
        F = np.concatenate([np.broadcast_to(shared, (len(own), *shared.shape)), own], axis=1)
        return F / np.sqrt(noise)[:, None, None]

    def _data(self, rows: MotionRows) -> RegressionData:
        session: Session = self._session
        data = RegressionData(self.correction, GAIN, self.features, self.noise.block, session)
        rooted = rows.X * np.sqrt(rows.step * rows.weights)[:, :, None]
        rooted[0] = 0.0  # as in a log, the first row stands for no time
        for j in range(self.arm.n):
            data.A[j] = rooted[:, j].T @ rooted[:, j]
        data.noise = self._noise(rows.step * (len(rows.q) - 1))
        return data

    def _noise(self, duration: float) -> NDArray[np.float64]:
        return whole_noise(self.correction, self.noise) * max(1.0, duration / self.noise.novelty)

    def _back(self, rows: MotionRows, F: NDArray[np.float64], out: RowAdjoint) -> None:
        """F (n, size, K) with F_j·F_jᵀ = G_j, summed over the runs that the rows are of."""
        XF = np.einsum("tjs,jsk->tjk", rows.X, F, optimize=True)
        XF[0] = 0.0
        X = 2.0 * rows.step * rows.weights[:, :, None] * np.einsum("tjk,jsk->tjs", XF, F, optimize=True)
        self.model.backward(rows, X, rows.step * (XF**2).sum(axis=2), out)
