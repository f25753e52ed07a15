"""Least squares whose answer is always a body that can exist: within the cone of bodies, or in a chart of it.

Both begin with weighted least squares on the filtered regression r = W·phi (`normal.py`), which gives phi_hat and its
information Λ; a tare's own estimate is taken off phi_hat before, because the difference of two bodies need not be one.
Then

    lmi           min (phi − phi_hat)ᵀ·Λ·(phi − phi_hat)   subject to J(phi) ⪰ 0, a semidefinite program,
    log-cholesky  min over θ of the same cost at phi(θ), θ ∈ R¹⁰ the log-Cholesky coordinates, by a damped
                  Newton method.

The first may end on the border of the cone (a point, a rod, a plate); the second never does, and its error bars know
that the border is there. Sources: Sousa & Cortesão, IJRR 2014 (LMI); Wensing, Kim & Slotine, RA-L 2018 (J); Lee,
Wensing & Park, T-RO 2020 (entropic pull); Rucker & Wensing, RA-L 2022 (chart).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators.contract import Estimate, Identifier, Tared
from armload.estimators.normal import UNKNOWN, WeightedLeastSquares
from armload.inertia import (
    InertialParameters,
    from_log_cholesky,
    log_cholesky,
    log_cholesky_curvature,
    log_cholesky_jacobian,
    nearest_consistent,
    pseudo_inertia,
)
from armload.recording import Recording
from armload.regression.lag import GAIN

# [s] after which the residual counts as new: sets the information against a pull or the chart's prior
_CORRELATION = 1.0
_MARGIN = 1e-5  # [kg] smallest eigenvalue of J (lengths in units of 0.1 m) that the program leaves
_INSIDE = 1e-3  # [kg] the same, for a start well inside the cone
_ITERATIONS = 200
_CONVERGED = 1e-12  # relative to the cost, of what a step can still gain
# Weak prior on θ: a body of 1 kg about 5 cm large at the origin; mass within a factor of e^4, sizes of e^1.5, CoM
# within 0.3 m. It keeps θ finite where the data lie outside the cone or say nothing.
_CHART_MEAN = np.array([0.0] + [np.log(0.05)] * 3 + [0.0] * 6)
_CHART_STD = np.array([2.0] + [1.5] * 3 + [0.1] * 3 + [0.3] * 3)


class _ConsistentLeastSquares(Identifier):
    """Weighted least squares, less the tare's, handed to a subclass that makes a body of it."""

    def __init__(self, arm: Arm, tare: Recording | None = None, gain: float = GAIN) -> None:
        self.arm, self._free = arm, WeightedLeastSquares(arm, gain)
        self.before = None if tare is None else Tared(WeightedLeastSquares(arm, gain), tare).before
        self.reset()

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._free.reset()
        self._unprojected: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def unprojected(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """The unconstrained estimate less the tare's, and its covariance; None before the first sample."""
        return self._unprojected

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        self._free._take(t, q, dq, tau)

    def _estimate(self, t: float) -> Estimate:
        free = self._free._estimate(t)
        phi, G, rate = self._free.weighted_solution(free.phi)
        spread = max(1.0, _CORRELATION * rate) * G
        covariance = free.covariance
        if self.before is not None:
            phi, spread = phi - self.before.phi, spread + self.before.covariance
            covariance = covariance + self.before.covariance
        self._unprojected = phi, covariance
        body, covariance = self._body(phi, _inverse(spread), covariance)
        return replace(free, phi=body, covariance=covariance)

    @abstractmethod
    def _body(self, phi: NDArray, information: NDArray, covariance: NDArray) -> tuple[NDArray, NDArray]:
        """The body (10,) and its covariance, from the unconstrained estimate, its Λ and its covariance."""


class ConsistentLeastSquares(_ConsistentLeastSquares):
    """Weighted least squares subject to J(phi) ⪰ 0 (an LMI), as a semidefinite program.

    With a reference body the cost gains pull·d(J(phi), J_0), twice the entropic divergence of two bodies,
    d = tr(J_0⁻¹·J) − log det(J_0⁻¹·J) − 4, which is free of units and frames and keeps J ≻ 0 by itself; the cost then
    is (phi − phi_hat)ᵀ·Λ·(phi − phi_hat) with Λ the information of one row per second.

    The covariance is that of the unconstrained estimate: the constraint only ever takes errors away.

    >>> from armload.arms import arm
    >>> ConsistentLeastSquares(arm("panda")).name
    'lmi'

    Args:
        arm: the bare arm.
        tare: an earlier log of the same arm, on any motion; its own estimate is subtracted.
        gain: λ of the lag [1/s].
        reference: a body that the payload is expected to be like; None: no pull.
        pull: weight of the divergence.

    Raises:
        IdentificationError: a pull that is not positive.
        InertiaError: the reference is not strictly consistent.
    """

    name = "lmi"

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        gain: float = GAIN,
        reference: InertialParameters | None = None,
        pull: float = 1.0,
    ) -> None:
        if not pull > 0:
            raise IdentificationError(
                f"the pull is {pull}: expected a positive weight; for none, leave the reference out"
            )
        if reference is not None:
            log_cholesky(reference.phi)  # strictly consistent, or a sentence
        self.reference, self.pull = reference, pull
        super().__init__(arm, tare, gain)

    def _body(self, phi: NDArray, information: NDArray, covariance: NDArray) -> tuple[NDArray, NDArray]:
        if self.reference is None:
            return nearest_consistent(phi, information, _MARGIN), covariance
        return entropic_pull(phi, information, self.reference.phi, self.pull), covariance


class LogCholeskyLeastSquares(_ConsistentLeastSquares):
    """Weighted least squares in the log-Cholesky chart: unconstrained, and every θ is a body.

    min_θ (phi(θ) − phi_hat)ᵀ·Λ·(phi(θ) − phi_hat) + (θ − θ_0)ᵀ·P_θ⁻¹·(θ − θ_0) with a weak prior on θ (a body of a
    kilogram, mass within a factor of e⁴). With D = ∂phi/∂θ and H = Dᵀ·Λ·D + P_θ⁻¹ the covariance is

        D·H⁻¹·(Dᵀ·Λ·C·Λ·D + P_θ⁻¹)·H⁻¹·Dᵀ

    where C is the unconstrained estimate's. It is first order: at the border of the cone (a point mass), where D is
    nearly singular, it is too small.

    >>> from armload.arms import arm
    >>> LogCholeskyLeastSquares(arm("panda")).name
    'log-cholesky'

    Args:
        arm: the bare arm.
        tare: an earlier log of the same arm, on any motion; its own estimate is subtracted.
        gain: λ of the lag [1/s].
    """

    name = "log-cholesky"

    def _body(self, phi: NDArray, information: NDArray, covariance: NDArray) -> tuple[NDArray, NDArray]:
        theta = fit_chart(phi, information)
        D, precision = log_cholesky_jacobian(theta), np.diag(_CHART_STD**-2)
        H = np.linalg.inv(D.T @ information @ D + precision)
        noise = D.T @ information @ covariance @ information @ D + precision
        C = D @ H @ noise @ H @ D.T
        return from_log_cholesky(theta), 0.5 * (C + C.T)


def entropic_pull(phi: NDArray, information: NDArray, reference: NDArray, pull: float) -> NDArray[np.float64]:
    """argmin (x − phi)ᵀ·Λ·(x − phi) + pull·[tr(J_0⁻¹·J(x)) − log det(J_0⁻¹·J(x)) − 4], by Newton's method.

    The cost is convex and infinite outside the cone, so that its minimum is a body.

    Args:
        phi: (10,). information: Λ (10, 10), positive semidefinite. reference: a strictly consistent body (10,).
        pull: positive.
    """
    units = UNKNOWN
    basis = pseudo_inertia(np.diag(units))  # x = units·y
    towards = np.einsum("kab,ba->k", basis, np.linalg.inv(pseudo_inertia(reference)))
    Q, target = units[:, None] * information * units, phi / units

    def cost(y: NDArray) -> float:
        sign, log_det = np.linalg.slogdet(np.einsum("k,kab->ab", y, basis))
        eigenvalues = np.linalg.eigvalsh(np.einsum("k,kab->ab", y, basis))
        if sign <= 0 or eigenvalues[0] <= 0:
            return np.inf
        return float((y - target) @ Q @ (y - target) + pull * (towards @ y - log_det))

    def newton_step(y: NDArray) -> tuple[NDArray, float]:
        """And what it gains, were the cost quadratic."""
        at = np.linalg.solve(np.einsum("k,kab->ab", y, basis), basis)  # J⁻¹·E_k
        gradient = 2.0 * Q @ (y - target) + pull * (towards - np.einsum("kaa->k", at))
        hessian = 2.0 * Q + pull * np.einsum("iab,jba->ij", at, at)
        step = -np.linalg.solve(hessian, gradient)
        return step, -float(gradient @ step)

    y = nearest_consistent(phi, information, _INSIDE) / units
    now = cost(y)
    for _ in range(_ITERATIONS):
        step, gain = newton_step(y)
        if gain <= _CONVERGED * max(1.0, abs(now)):
            break
        share = 1.0
        while (then := cost(y + share * step)) > now - 0.1 * share * gain and share > 1e-12:
            share *= 0.5
        if not then < now:
            break  # rounding
        y, now = y + share * step, then
    return y * units


def fit_chart(phi: NDArray, information: NDArray) -> NDArray[np.float64]:
    """θ (10,) that fits phi best in the metric Λ (10, 10) under the chart's weak prior, by a damped Newton method.

    Gauss–Newton alone crawls where phi lies far outside the cone: the residual's curvature counts then.
    """

    def cost(theta: NDArray) -> float:
        e, away = from_log_cholesky(theta) - phi, (theta - _CHART_MEAN) / _CHART_STD
        return float(e @ information @ e + away @ away)

    def quadratic(theta: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Half the gradient; the Hessian, or Gauss and Newton's where that is not convex; the diagonal of theirs."""
        D, pushed = log_cholesky_jacobian(theta), information @ (from_log_cholesky(theta) - phi)
        H = D.T @ information @ D + np.diag(_CHART_STD**-2)
        gradient = D.T @ pushed + (theta - _CHART_MEAN) / _CHART_STD**2
        full = H + log_cholesky_curvature(theta, pushed)
        return gradient, full if np.linalg.eigvalsh(full)[0] > 0 else H, np.diag(np.diag(H))

    theta = log_cholesky(nearest_consistent(phi, information, _INSIDE))
    now, damping = cost(theta), 1e-3
    for _ in range(_ITERATIONS):
        gradient, full, diagonal = quadratic(theta)
        if gradient @ np.linalg.solve(full, gradient) <= _CONVERGED * max(1.0, now):
            break
        while damping < 1e12:
            trial = theta - np.linalg.solve(full + damping * diagonal, gradient)
            then = cost(trial) if np.abs(trial[:4]).max() < 50.0 else np.inf  # e^50 is no body
            if then < now:
                break
            damping *= 4.0
        else:
            break  # rounding: nothing is left to gain
        theta, now, damping = trial, then, max(damping / 10.0, 1e-12)
    return theta


def _inverse(covariance: NDArray) -> NDArray[np.float64]:
    scale = np.sqrt(np.diag(covariance))  # units that differ by orders of magnitude
    inverse = np.linalg.inv(covariance / np.outer(scale, scale)) / np.outer(scale, scale)
    return 0.5 * (inverse + inverse.T)
