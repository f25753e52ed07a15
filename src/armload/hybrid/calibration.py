"""Error bars that hold: how far evidence can be trusted, learned, and a factor on every width, calibrated.

    1. a bag of trees and networks reads from the traits of a log by which factor kappa the physics overrates its
       evidence; the evidence is taken as Λ/kappa, h/kappa
    2. the half-width of parameter i is c_i(t)·std_i, where c_i is the 95 % quantile of |error|/std over episodes that
       the bag has not seen (split conformal prediction), one per time and with or without a tare

The first makes widths follow the log at hand, the second makes them hold on average over the episodes they were
calibrated on, whatever the distribution of the errors.

Sources: Lei et al., JASA 2018 (split conformal, locally weighted); Breiman 1996 (bagging).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import digamma

from armload.determined import Z95
from armload.hybrid.evidence import KINDS, Evidence
from armload.hybrid.mixture import MixturePosterior, MixturePrior
from armload.hybrid.records import TIMES, Records
from armload.learners import MixedEnsemble, NetworkLearner, TreeLearner
from armload.learners.compiled import Compiled

COVERAGE = 0.95
_INFORMATIVE = 9.0  # a direction counts as seen once the evidence shrinks its prior's variance so many times
_MEMBERS, _DEPTH, _UNITS, _EPOCHS = 5, 7, 32, 60
_FEWEST = 30  # episodes below which a quantile is not worth its name
_KAPPA = (0.1, 1e3)  # range of the factor


@dataclass(frozen=True, eq=False)
class Calibration:
    """How a log's evidence becomes an answer with error bars.

    Args:
        bag: traits (N, T) → log10 kappa (N, 1); None: kappa is 1.
        level: kappa's constant factor, so that it is right on average.
        times: (B,) [s] at which the widths were calibrated.
        widths: (3, B, 10) quantile of |error|/std, by what there was to compare with (`KINDS`).
    """

    bag: Compiled | None
    level: float
    times: NDArray[np.float64]
    widths: NDArray[np.float64]

    def kappa(self, traits: NDArray[np.float64]) -> float:
        """By which factor the physics overrates the evidence of a log with these traits (T,)."""
        if self.bag is None:
            return self.level
        said = self.bag.row(traits)
        return min(max(self.level * 10.0 ** float(said.sum() / said.size), _KAPPA[0]), _KAPPA[1])

    def width(self, t: float, kind: int) -> NDArray[np.float64]:
        """Quantile (10,) of |error|/std after t seconds: linear in log t, constant beyond the calibrated times."""
        return _between(self.widths[kind], self.times, t)

    def trusted(self, evidence: Evidence) -> Evidence:
        """Evidence as far as it can be trusted: Λ/kappa, h/kappa."""
        kappa = self.kappa(evidence.traits)
        Λ, h = evidence.information / kappa, evidence.vector / kappa
        return Evidence(Λ, h, evidence.gain_std, evidence.traits, evidence.t, evidence.kind)

    def widened(self, found: MixturePosterior, evidence: Evidence) -> NDArray[np.float64]:
        """Covariance (10, 10) such that ±1.96 standard deviations are the calibrated 95 % interval."""
        width = self.width(evidence.t, evidence.kind)
        return _spread(found.covariance, found.mean, evidence.gain_std, width / Z95)

    def answer(self, evidence: Evidence, prior: MixturePrior) -> MixturePosterior:
        """The posterior, its covariance such that ±1.96 standard deviations are the calibrated 95 % interval."""
        trusted = self.trusted(evidence)
        found = prior.posterior(trusted.information, trusted.vector)
        return found._replace(covariance=self.widened(found, trusted))

    @classmethod
    def fit(
        cls,
        records: Records,
        prior: MixturePrior,
        *,
        learned: tuple[str, ...] = ("tree", "network"),
        trusted: bool = False,
        seed: int = 0,
        held_out: float = 0.5,
    ) -> Calibration:
        """Fit the bag on one part of the episodes and the widths on the rest.

        Args:
            records: of many episodes. prior: the payload prior the answers will use.
            learned: what the bag is made of; nothing: no bag, one kappa for all (the ablation).
            trusted: kappa is 1, whatever the episodes say (the other ablation).
            held_out: share of the episodes that the widths are calibrated on.
        """
        rng = np.random.default_rng(seed)
        episodes = rng.permutation(np.unique(records.episode))
        calibrated = np.isin(records.episode, episodes[: int(held_out * len(episodes))])
        bag, level = (None, 1.0) if trusted else _fit_kappa(records.select(~calibrated), prior, learned, seed)
        times = _times(records.t)
        draft = cls(bag, level, times, np.ones((len(KINDS), len(times), 10)))
        rest = records.select(calibrated)
        score, which = scores(rest, prior, draft), nearest(rest.t, times)
        widths = np.ones((len(KINDS), len(times), 10))
        for kind in range(len(KINDS)):
            for b in range(len(times)):
                rows = (rest.kind == kind) & (which == b)
                if (n := int(rows.sum())) >= _FEWEST:
                    share = min(np.ceil((n + 1) * COVERAGE) / n, 1.0)
                    widths[kind, b] = np.quantile(score[rows], share, axis=0, method="higher")
                elif kind > 0:  # too few to tell: as with any tare
                    widths[kind, b] = widths[kind - 1, b]
        return cls(bag, level, times, widths)


def _times(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """The times [s] that records were taken at: samples are jittered and lost, so that few fall on them exactly."""
    asked = np.array(TIMES)
    which = nearest(t, asked)
    counts = np.bincount(which, minlength=len(asked))
    return np.array([np.median(t[which == b]) for b in range(len(asked)) if counts[b] >= max(0.01 * len(t), 1.0)])


def nearest(t: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.intp]:
    """Which of the times (B,) each t (N,) belongs to."""
    return np.argmin(np.abs(np.log(t[:, None] / times)), axis=1)


@njit(cache=True, nogil=True)
def _spread(covariance, mean, gain_std, d):  # pragma: no cover - compiled
    """Covariance (10, 10), widened by the torque's own calibration, in units of 1/d (10,)."""
    out = np.empty((10, 10))
    for i in range(10):
        for j in range(10):
            out[i, j] = (covariance[i, j] + gain_std**2 * mean[i] * mean[j]) * d[i] * d[j]
    return out


@njit(cache=True, nogil=True)
def _between(table, times, t):  # pragma: no cover - compiled
    if t <= times[0]:
        return table[0].copy()
    for k in range(1, len(times)):
        if t < times[k]:
            share = np.log(t / times[k - 1]) / np.log(times[k] / times[k - 1])
            return (1.0 - share) * table[k - 1] + share * table[k]
    return table[-1].copy()


def scores(records: Records, prior: MixturePrior, calibration: Calibration) -> NDArray[np.float64]:
    """|error|/std (N, 10) of the answers before their widths."""
    out = np.empty((len(records), 10))
    for k in range(len(records)):
        trusted = calibration.trusted(records.evidence(k))
        found = prior.posterior(trusted.information, trusted.vector)
        out[k] = np.abs(found.mean - records.truth[k]) / np.sqrt(
            np.diag(_spread(found.covariance, found.mean, trusted.gain_std, np.ones(10)))
        )
    return out


def overrating(records: Records, prior: MixturePrior) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """By which factor each row's evidence was overrated: squared error over variance, where the log tells something.

    In the coordinates in which the prior's covariance is the identity, Λ = V·diag(l)·Vᵀ; over the directions with
    l ≥ 9 the mean of l·(vᵀ·(phi − phi_ML))²; NaN where there is no such direction. Beside it, how many there are.
    """
    s = prior.std
    out, count = np.full(len(records), np.nan), np.zeros(len(records), dtype=np.int64)
    for k in range(len(records)):
        values, V = np.linalg.eigh(records.information[k] * np.outer(s, s))
        seen = values > _INFORMATIVE
        if seen.any():
            V, values = V[:, seen], values[seen]
            found = (V.T @ (records.vector[k] * s)) / values
            out[k] = np.mean(values * (V.T @ (records.truth[k] / s) - found) ** 2)
            count[k] = len(values)
    return out, count


def _fit_kappa(
    records: Records, prior: MixturePrior, learned: tuple[str, ...], seed: int
) -> tuple[Compiled | None, float]:
    target, directions = overrating(records, prior)
    keep = np.isfinite(target)
    target, traits, episode = target[keep], records.traits[keep], records.episode[keep]
    half = 0.5 * directions[keep]
    if not learned:
        return None, float(np.mean(target))
    # the mean of ln(χ²_m / m) is ψ(m/2) − ln(m/2): −1.27 of one direction, −0.1 of ten; no sign of good evidence
    log = (np.log10(np.maximum(target, 1e-3)) - (digamma(half) - np.log(half)) / np.log(10.0))[:, None]
    rng = np.random.default_rng(seed + 1)
    episodes = rng.permutation(np.unique(episode))
    checked = np.isin(episode, episodes[: len(episodes) // 5])
    kinds = {
        "tree": TreeLearner(max_depth=_DEPTH),
        "network": NetworkLearner(hidden=_UNITS, batch=256, max_epochs=_EPOCHS),
    }
    learners: tuple[Any, ...] = tuple(kinds[kind] for kind in learned)
    model = MixedEnsemble(learners, members=_MEMBERS, seed=seed, scale="standard")
    model.fit(traits[~checked], log[~checked], traits[checked], log[checked])
    bag: Compiled = model.compiled_
    predicted = 10.0 ** bag.predict(traits[checked])[:, 0]
    # the mean of a logarithm is below the logarithm of the mean; trimmed, so that one wild log does not set the level
    ratio = np.sort(target[checked] / predicted)
    return bag, float(np.mean(ratio[: int(0.98 * len(ratio))]))
