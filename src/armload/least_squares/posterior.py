"""MAP least squares: payload and arm mismatch together, with an uncertainty that knows the residual is correlated.

    r = W·phi + Z·eta + e,      phi ~ N(0, P_phi),  eta ~ N(0, P_eta),  e_j of long-run variance S_j

r, W and Z come from the acceleration-free filtered regression (`arms.filtered`), eta is the arm's own mismatch
(`correction.py`). The information A = Σ_j ∫ X_jᵀ·X_j dt / S_j with X = [W Z] accumulates in constant memory; the
posterior is x = (A + P⁻¹)⁻¹·b. S_j (batch means of the residual) and the scale of each friction and offset prior
(expectation–maximisation) are found from the data in a few iterations.

A tare run enters the same model: it sees phi_0 (whatever was mounted then) with the same eta, the later run sees
phi_0 + phi. Virtual calibration [Kurdas 2022] is the special case without eta.

Sources: information form and EM: Bishop 2006, ch. 3 and 9; arm and load together: Khalil, Gautier, Lemoine, ICRA 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from armload.arms import Arm, momentum_regressor
from armload.arms.filtered import Lag, filtered_regressor
from armload.identifier import BatchIdentifier, Estimate
from armload.least_squares.autocorrelation import BlockMeans
from armload.least_squares.correction import FRICTION_WIDTH, Correction, effort_scale
from armload.least_squares.prior import GaussianPrior, payload_prior_std
from armload.recording import Recording, Sample

REGRESSOR_RATE = 200.0  # [Hz] W and Z are computed no more often: they hold nothing above a few hertz
GAP = 0.1  # [s] a longer pause between samples restarts the lags
# variance of a joint's residual grows up to 1 + this where the joint stands still: friction is unknown there
_PRESLIDING = 10.0
_WIDE = 4.0  # the solution's prior is so much wider than the stated one: it must not pull a determined payload
# standard deviation of first moments and inertia per kilogram: bodies within about 20 cm of the frame's origin
_REACH = np.array([0.2] * 3 + [0.2**2] * 6)  # [m, m²]
_LIGHTEST = 0.02  # [kg]
_PRIOR_COUNT = 4.0  # weight of the prior long-run variance, in blocks
_PRIOR_RESIDUAL = 4e-3  # prior standard deviation of the unexplained torque, as a fraction of the effort limit
# [s] the mismatch is a function of the configuration: more time on similar motions does not average it away
_NOVELTY = 10.0
# Coulomb friction above this fraction of the effort limit: the torque is the motor's, not the link's
_MOTOR_SIDE = 0.01
_GAIN_STD = {"link": 0.005, "motor": 0.02}  # torque calibration, 1 sigma; motor constants are known to a few per cent


class RegressionData:
    """What one recording says about x = [phi, eta]: information per joint and block sums, in constant memory."""

    def __init__(self, correction: Correction, gain: float) -> None:
        self.correction, self.gain = correction, gain
        arm, size = correction.arm, 10 + correction.size
        self.A = np.zeros((arm.n, size, size))  # ∫ X_jᵀ·X_j dt
        self.b = np.zeros((arm.n, size))  # ∫ X_jᵀ·r_j dt
        self.blocks = BlockMeans((arm.n, size + 1))  # of √w·[X, r]
        self._torque, self._bare, self._regressor = Lag(gain), Lag(gain), Lag(gain)
        self._last_sample = self._last_row = -np.inf

    def add(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Take the next samples (N,), (N, n); W and Z are computed at `REGRESSOR_RATE`, torque at its full rate."""
        edges = np.flatnonzero(np.diff(t, prepend=self._last_sample) > GAP)
        for start, stop in zip([0, *edges], [*edges, len(t)], strict=True):
            if start in edges:
                for lag in (self._torque, self._bare, self._regressor):
                    lag.reset()
                self._last_row = -np.inf
            if stop > start:
                self._segment(t[start:stop], q[start:stop], dq[start:stop], tau[start:stop])
        self._last_sample = t[-1]

    def _segment(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        lagged = self._torque(t, tau)
        rows, last = [], self._last_row
        for k, now in enumerate(t):
            if now - last >= 0.9 / REGRESSOR_RATE:
                rows.append(k)
                last = now
        if not rows:
            return
        h = np.diff(t[rows], prepend=self._last_row)
        h[~np.isfinite(h)] = 0.0
        self._last_row = last
        arm, gain, t, q, dq = self.correction.arm, self.gain, t[rows], q[rows], dq[rows]
        p, drift = arm.momentum(q, dq)
        r = lagged[rows] - gain * p - self._bare(t, drift - gain * p, initial=-gain * p[0])
        payload, own = momentum_regressor(arm.frame_motion(q), dq), self.correction.regressor(q, dq)
        momentum = np.concatenate([payload.momentum, own.momentum], axis=2)
        drift = np.concatenate([payload.drift, own.drift], axis=2)
        X = filtered_regressor(t, momentum, drift, self._regressor)
        moving = np.tanh(np.abs(dq) / FRICTION_WIDTH)
        w = 1.0 / (1.0 + _PRESLIDING * (1.0 - moving**2))  # (N, n)
        for j in range(arm.n):
            weighted = X[:, j] * (w[:, j] * h)[:, None]
            self.A[j] += weighted.T @ X[:, j]
            self.b[j] += weighted.T @ r[:, j]
        rooted = np.sqrt(w)[:, :, None] * np.concatenate([X, r[:, :, None]], axis=2)
        for duration, value in zip(h, rooted, strict=True):
            self.blocks.add(duration, value)

    def selected(self, E: NDArray) -> tuple[NDArray, NDArray]:
        """A and b over the unknowns z, where x = E·z."""
        return E.T @ self.A @ E, self.b @ E

    def residual_variance(self, x: NDArray, prior: NDArray) -> NDArray[np.float64]:
        """Long-run variance S (n,) of the residual at x, pulled towards the prior by `_PRIOR_COUNT` blocks."""
        means, times = self.blocks.means()
        residual = means[:, :, -1] - means[:, :, :-1] @ x
        total = _PRIOR_COUNT * prior + np.sum(residual**2 * times[:, None], axis=0)
        return total / (_PRIOR_COUNT + max(len(times) - 2, 0)) * max(1.0, self.blocks.duration / _NOVELTY)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Mean and covariance of phi, and of what else was found along the way.

    phi, covariance: (10,), (10, 10) of the payload (relative to the tare, if there was one).
    eta: (p,) the arm's mismatch.
    residual: √S (n,) of the run [N·m·√s].
    torque: "link" or "motor", the side the torque seems to be measured on.
    """

    phi: NDArray[np.float64]
    covariance: NDArray[np.float64]
    eta: NDArray[np.float64]
    residual: NDArray[np.float64]
    torque: str


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()


def solve(
    runs: list[RegressionData], prior_std: ArrayLike, prior: GaussianPrior | None = None, iterations: int = 12
) -> Posterior:
    """Posterior of the payload of the last run; runs before it are tares.

    Unknowns z = [phi_1, phi_2 − phi_1, …, eta]: run k carries the sum of the first k of them. Each payload is near
    zero within `prior_std` (10,), a tare's moments also within `_REACH` of its mass; the last one follows `prior` where
    that is given.
    """
    correction, count = runs[0].correction, len(runs)
    p, prior_std = correction.size, np.asarray(prior_std)
    size = 10 * count + p
    variance0 = np.concatenate([np.tile(prior_std, count), correction.prior_std]) ** 2
    variance = variance0.copy()
    at = slice(10 * (count - 1), 10 * count)
    mean, payload_root = np.zeros(size), None
    if prior is not None:
        mean[at], payload_root = prior.mean, prior.root
    adaptive = 10 * count + np.flatnonzero(correction.adaptive)
    selections = []
    for k in range(count):
        E = np.zeros((10 + p, size))
        for i in range(k + 1):
            E[:10, 10 * i : 10 * i + 10] = np.eye(10)
        E[10:, 10 * count :] = np.eye(p)
        selections.append(E)
    parts = [run.selected(E) for run, E in zip(runs, selections, strict=True)]
    prior_residual = (_PRIOR_RESIDUAL * correction.effort) ** 2 * runs[0].blocks.block
    S = [prior_residual for _ in runs]
    z, P = np.zeros(size), np.diag(variance)
    for _ in range(iterations):
        A = sum(np.einsum("jab,j->ab", A, 1 / s) for (A, _), s in zip(parts, S, strict=True))
        b = sum(np.einsum("ja,j->a", b, 1 / s) for (_, b), s in zip(parts, S, strict=True))
        root = np.diag(np.sqrt(variance))
        if payload_root is not None:
            root[at, at] = payload_root
        P = root @ np.linalg.inv(root.T @ A @ root + np.eye(size)) @ root.T
        P = 0.5 * (P + P.T)
        z = mean + P @ (b - A @ mean)
        S = [run.residual_variance(E @ z, prior_residual) for run, E in zip(runs, selections, strict=True)]
        # EM for the prior's scale, with one pseudo-observation at the stated value
        variance[adaptive] = 0.5 * (variance0[adaptive] + z[adaptive] ** 2 + np.diag(P)[adaptive])
        # a light body has small moments: what was mounted at a tare seldom weighs much, and its moments follow its mass
        for k in range(count - 1):
            heaviest = max(abs(z[10 * k]) + 2.0 * np.sqrt(P[10 * k, 10 * k]), _LIGHTEST)
            moments = slice(10 * k + 1, 10 * k + 10)
            variance[moments] = np.minimum(variance0[moments], (heaviest * _REACH) ** 2)
    eta = z[10 * count :]
    torque = "motor" if np.median(np.abs(correction.coulomb(eta)) / correction.effort) > _MOTOR_SIDE else "link"
    return Posterior(
        phi=z[at],
        covariance=P[at, at] + _GAIN_STD[torque] ** 2 * np.outer(z[at], z[at]),
        eta=eta,
        residual=np.sqrt(S[-1]),
        torque=torque,
    )


class PosteriorLeastSquares(BatchIdentifier):
    """MAP least squares with the arm's mismatch as an unknown: the method for a log of any motion of any arm.

    >>> from armload.arms import arm
    >>> PosteriorLeastSquares(arm("panda")).name
    'map'

    Args:
        arm: the bare arm.
        tare: an earlier recording of the same arm, on any motion, with whatever was mounted then; estimates are
            relative to it.
        gain: λ of the lag [1/s].
        refresh: the posterior is solved anew at most this often [s] while streaming; `run` solves at the end only.
        prior: what is known about the payload before; None: the weak prior of `payload_prior_std`.
    """

    name = "map"

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        gain: float = 20.0,
        refresh: float = 0.02,
        prior: GaussianPrior | None = None,
    ) -> None:
        self.arm, self.gain, self.refresh, self.prior = arm, gain, refresh, prior
        self._correction: Correction | None = None
        self._tare: RegressionData | None = None
        if tare is not None:
            self._correction = Correction(arm, effort_scale(arm, tare.tau))
            self._tare = RegressionData(self._correction, gain)
            self._tare.add(tare.t, tare.q, tare.dq, tare.tau)
        self.reset()

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._run: RegressionData | None = None
        self._solved_at, self._posterior, self._count = -np.inf, None, 0

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far, at most `refresh` old."""
        if self._posterior is None or sample.t - self._solved_at >= self.refresh:
            return super().update(sample)
        self._take(np.array([sample.t]), sample.q[None], sample.dq[None], sample.tau[None])
        return self._last(sample.t)

    @property
    def posterior(self) -> Posterior:
        """The last solution, with the arm's mismatch and the residual."""
        if self._posterior is None:
            raise RuntimeError("no sample has been seen: call update or run first")
        return self._posterior

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        if self._run is None:
            if self._correction is None:
                self._correction = Correction(self.arm, effort_scale(self.arm, tau))
            self._run = RegressionData(self._correction, self.gain)
        self._run.add(t, q, dq, tau)
        self._count += len(t)

    def _estimate(self, t: float) -> Estimate:
        assert self._run is not None
        runs = [self._run] if self._tare is None else [self._tare, self._run]
        with _threads().limit(limits=1):  # matrices of a hundred rows: BLAS threads cost up to 100 × on a busy machine
            self._posterior = solve(runs, _WIDE * payload_prior_std(self.arm), self.prior)
        self._solved_at = t
        return self._last(t)

    def _last(self, t: float) -> Estimate:
        return Estimate(float(t), self.posterior.phi, self.posterior.covariance, self._count, str(self.arm.frame))
