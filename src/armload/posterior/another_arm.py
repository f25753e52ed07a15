"""Whether a log is of another arm than its tare or profile, or of one that was repaired: two hypotheses compared.

    H_d   the arm is the tare's: links and smooth mismatch are the same, offsets and friction have drifted
    H_o   it is another one: the tare says nothing of it
    B   = ln p(run | H_o) − ln p(run | tare, H_d)

The less a log tells, the smaller B is even for another arm, so B is compared with what it is expected to be of the same
arm: runs are drawn from p(run | tare, H_d), with the same rows X,

    z = (B − E_d[B]) / std_d[B]

Rows enter by their information alone: A = ∫ XᵀX dt / S, b ~ N(A·x, A) of the unknowns x.

Source: Cox, J. R. Stat. Soc. B 24, 1962 (tests of separate families of hypotheses).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior.drift import ALLOWED
from armload.posterior.elimination import eliminated
from armload.posterior.problem import Problem, of_mounted
from armload.posterior.scales import AnotherArm, Posterior, Scales
from armload.posterior.solve import Solution, solve, solve_to_go_on
from armload.regression import GaussianPrior
from armload.regression.information import SAME, RegressionData
from armload.regression.noise import NoiseModel
from armload.runtime.one_thread import one_thread

# z above which a run surprises as one of the same arm seldom does: sound simulated logs and streams stay below 1, but
# those of arms beyond the measured ones do not, and there B must tell (`benchmarks/tare_drift.py`)
SURPRISING = 4.0
# B above which the same arm is believed no more: it explains the run less than 20 times as well as another one
LEAST = -3.0
FROM = 19.9  # [s] of a stream before it is asked: at the full solution after 20 s, as long as a tare is asked for
_DRAWS = 24  # of a mean and a standard deviation, of which the latter is then known to 15 %
_STEPS = 3  # of expectation–maximisation of the run without its tare, as a tare's scales are another arm's
_NAT = 1.0  # of B, the least standard deviation: odds that differ by less say nothing, however short the log
_ROUNDING = 1e-10  # of the largest information: what is below is rounding, and its Cholesky factor would not exist


def found_so_far(before: AnotherArm | None, now: AnotherArm | None) -> AnotherArm | None:
    """What holds of a stream that is asked again and again; None: not asked.

    What was found stays: odds of 20 to 1 are passed wrongly, whenever they are asked, in one run of 20 at most (Ville's
    inequality), but those of another arm may well come back below them.
    """
    return before if now is None or (before is not None and before.found) else now


def another_arm(
    runs: Sequence[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None,
    noise: NoiseModel,
    found: Posterior,
) -> AnotherArm:
    """Test whether the last run is of the first one's arm; runs between are of the last one's session.

    Args:
        runs, prior_std, prior, noise: as of `solve`. found: their solution, for its scales.
    """
    first, own = runs[0], [copy(run) for run in runs[1:]]
    if first.noise is None:  # a tare; a profile knows how far its sessions differ
        for run in own:
            run.session = replace(run.session, number=1, drift=max(ALLOWED, run.session.drift))
    S, scales = found.scales.noise, found.scales
    with one_thread():
        same = Problem([first, *own], prior_std, prior, noise)
        before = Problem([first], prior_std, None, noise)
        other = Problem([_of_session_0(run) for run in own], prior_std, prior, noise)
        others = other.scales(None)
        for _ in range(_STEPS):
            others = other.improved(others, other.posterior(others))
        others = replace(others, noise=S[1:])
        together = Scales(S, scales.eta, scales.features, scales.payloads, same.drift_variance)
        scales_before = Scales(S[:1], scales.eta, scales.features, scales.payloads[:10])
        rng = np.random.default_rng(0)
        drawn = _drawn(before, scales_before, same, S, rng)
        vectors = [np.concatenate(both, axis=2) for both in zip([run.b[:, :, None] for run in own], drawn, strict=True)]
        b0 = np.repeat(first.b[:, :, None], _DRAWS + 1, axis=2)
        B = _log_evidence(other, others, vectors) - _log_evidence(same, together, [b0, *vectors])
        B += _log_evidence(before, scales_before, [b0])
    expected, spread = float(B[1:].mean()), max(float(B[1:].std()), _NAT)
    surprise = (float(B[0]) - expected) / spread
    return AnotherArm(float(B[0]), surprise, surprise > SURPRISING and B[0] > LEAST)


def apart(
    runs: Sequence[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None,
    noise: NoiseModel,
    iterations: int,
    found: Posterior,
) -> Solution:
    """The solution where the first run is of another arm: it says what was mounted, and nothing of the last one's arm.

    With Λ_0, h_0 what the first run says of phi_0, its prior among it, and Λ, h what the last says of phi_0 + phi,

        Λ − Λ·(Λ_0 + Λ)⁻¹·Λ,    h − Λ·(Λ_0 + Λ)⁻¹·(h_0 + h)

    are left of phi. Runs between, of the last one's session, show what was mounted themselves.

    Args:
        runs, prior_std, prior, noise, iterations: as of `solve`. found: their solution as of one arm.
    """
    own = [_of_session_0(run) for run in runs[1:]]
    out = solve_to_go_on(own, prior_std, prior, noise, iterations, None)
    posterior = replace(out.posterior, power=np.concatenate([found.power[:1], out.posterior.power]))
    if len(own) > 1:
        return Solution(posterior, out.state)
    before = solve([runs[0]], prior_std, None, noise, 1, found.scales)
    weak = of_mounted(prior_std**2, before.phi[0], before.covariance[0, 0])
    Λ, h = posterior.information, posterior.vector
    M = Λ @ np.linalg.inv(before.information + np.diag(1.0 / weak) + Λ)
    Λ, h = Λ - M @ Λ, h - M @ (before.vector + h)
    Λ = 0.5 * (Λ + Λ.T)
    mean, C = (np.zeros(10), np.diag(prior_std**2)) if prior is None else (prior.mean, prior.covariance)
    scale = np.sqrt(np.diag(C))
    own_prior = np.linalg.inv(C / np.outer(scale, scale)) / np.outer(scale, scale)
    P = np.linalg.inv((Λ + own_prior) * np.outer(scale, scale)) * np.outer(scale, scale)
    phi = mean + P @ (h - Λ @ mean)
    covariance = noise.overrated * P + posterior.gain_std**2 * np.outer(phi, phi)
    out.state.information, out.state.vector = Λ, h
    return Solution(replace(posterior, phi=phi, covariance=covariance, information=Λ, vector=h), out.state)


def _of_session_0(run: RegressionData) -> RegressionData:
    out = copy(run)
    out.session = SAME
    return out


def _drawn(before: Problem, scales: Scales, same: Problem, S: NDArray, rng: np.random.Generator) -> list[NDArray]:
    """∫ Xᵀr dt (n, size, K) of each later run, as the arm of the first one would show it."""
    found, E = before.posterior(scales), same.selections
    n, R = found.own.shape
    scale = np.sqrt(np.diag(found.covariance))
    scale[scale == 0.0] = 1.0  # what is believed: gravity
    values, V = np.linalg.eigh(found.covariance / np.outer(scale, scale))
    root = scale[:, None] * V * np.sqrt(np.maximum(values, 0.0))
    z = found.mean[:, None] + root @ rng.normal(size=(len(scale), _DRAWS))  # [phi_0, eta]
    whole = np.zeros((same.size, _DRAWS))
    whole[:10], whole[same.eta] = z[:10], z[before.eta]
    drifts = np.sqrt(same.drift_variance.ravel())
    whole[same.eta.stop :] = drifts[:, None] * rng.normal(size=(len(drifts), _DRAWS))
    weights = []
    for j in range(n):
        rest = found.rest[j] + 1e-12 * np.diag(np.diag(found.rest[j]))
        weights.append(found.own[j][:, None] - found.slope[j] @ z)
        if R:
            weights[j] = weights[j] + np.linalg.cholesky(rest) @ rng.normal(size=(R, _DRAWS))
    out = []
    for run, selection, s in zip(same.runs[1:], E[1:], S[1:], strict=True):
        b = np.empty((n, run.A.shape[1], _DRAWS))
        for j in range(n):
            A = run.A[j] / s[j]
            x = np.concatenate([selection @ whole, weights[j]])
            jitter = _ROUNDING * np.abs(np.diag(A)).max() + np.finfo(float).tiny  # of a run without rows A is 0
            noise = np.linalg.cholesky(A + jitter * np.eye(len(A))) @ rng.normal(size=x.shape)
            b[j] = s[j] * (A @ x + noise)
        out.append(b)
    return out


def _log_evidence(problem: Problem, scales: Scales, vectors: list[NDArray]) -> NDArray[np.float64]:
    """ln p (K,) of the runs with ∫ Xᵀr dt (n, size, K) each, but for what no hypothesis changes."""
    c = 10 + problem.correction.size
    runs = [
        of_run._replace(b=E.T @ vector[:, :c], b_g=vector[:, c:])
        for of_run, E, vector in zip(problem.information, problem.selections, vectors, strict=True)
    ]
    found = eliminated(runs, scales.noise, scales.features)
    b_g = sum(run.b_g / s[:, None, None] for run, s in zip(runs, scales.noise, strict=True))
    total = 0.5 * (b_g * found.own).sum(axis=(0, 1))
    root = np.sqrt(scales.features)
    for rest in found.rest / (root[:, :, None] * root[:, None]):
        total += 0.5 * np.linalg.slogdet(rest)[1]
    root = np.sqrt(np.concatenate([scales.payloads, scales.eta, scales.drifts.ravel()]))
    L = np.linalg.cholesky(root[:, None] * found.A * root + np.eye(len(root)))
    white = np.linalg.solve(L, root[:, None] * found.b)
    return total + 0.5 * (white**2).sum(axis=0) - np.log(np.diag(L)).sum()
