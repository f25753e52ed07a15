"""Error bars that hold: how far evidence can be trusted, learned, and a factor on every width, calibrated.

    1. a bag of trees and networks reads from the traits of a log by which factor kappa the physics overrates its
       evidence; the evidence is taken as Λ/kappa, h/kappa
    2. the half-width h_i of parameter i has h_i² = (c_i(t)·std_i)² + (1.96·gain·phi_i)², gain being how well the
       torque's scale is known; c_i is such that 95 % of the episodes lie inside, each answered by a bag that has not
       seen it (cross-conformal prediction), one per time and with or without a tare

The first makes widths follow the log at hand, the second makes them hold on average over the episodes they were
calibrated on, whatever the distribution of the errors. The gain stands apart: it is a share of the payload, however
good the log, and a quantile of all logs would blow it up where the rest is small.

Sources: Lei et al., JASA 2018 (locally weighted conformal prediction); Vovk, Annals of Mathematics and Artificial
Intelligence 2015 (cross-conformal); Breiman 1996 (bagging).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
_FOLDS = 3  # of the episodes: each is scored by a bag fitted on the others
_NARROWEST = 0.1  # c is no less, even where the gain alone covers 95 %
_KAPPA = (0.1, 1e3)  # range of the factor


@dataclass(frozen=True, eq=False)
class Calibration:
    """How a log's evidence becomes an answer with error bars.

    Args:
        bag: traits (N, T) → log10 kappa (N, 1); None: kappa is 1.
        level: kappa's constant factor, so that it is right on average.
        times: (B,) [s] at which the widths were calibrated.
        widths: (3, B, 10) c, by what there was to compare with (`KINDS`).
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
        """c (10,) after t seconds: linear in log t, constant beyond the calibrated times."""
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
    ) -> Calibration:
        """Fit the bag on all episodes, and the widths on the scores of bags that had a third of them left out.

        Args:
            records: of many episodes. prior: the payload prior the answers will use.
            learned: what the bag is made of; nothing: no bag, one kappa for all (the ablation).
            trusted: kappa is 1, whatever the episodes say (the other ablation).
        """
        times = _times(records.t)

        def draft(some: Records) -> Calibration:
            bag, level = (None, 1.0) if trusted else _fit_kappa(some, prior, learned, seed)
            return cls(bag, level, times, np.ones((len(KINDS), len(times), 10)))

        episodes = np.random.default_rng(seed).permutation(np.unique(records.episode))
        score, which = np.empty((len(records), 10)), nearest(records.t, times)
        for k in range(_FOLDS):
            held = np.isin(records.episode, episodes[k::_FOLDS])
            score[held] = scores(records.select(held), prior, draft(records.select(~held)))
        widths = np.ones((len(KINDS), len(times), 10))
        for kind in range(len(KINDS)):
            for b in range(len(times)):
                rows = (records.kind == kind) & (which == b)
                if (n := int(rows.sum())) >= _FEWEST:
                    share = min(np.ceil((n + 1) * COVERAGE) / n, 1.0)
                    found = np.quantile(score[rows], share, axis=0, method="higher")
                    widths[kind, b] = np.maximum(found, _NARROWEST)
                elif kind > 0:  # too few to tell: as with any tare
                    widths[kind, b] = widths[kind - 1, b]
        return replace(draft(records), widths=widths)


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
    """Covariance (10, 10) in units of 1/d (10,), widened by the torque's own calibration."""
    out = np.empty((10, 10))
    for i in range(10):
        for j in range(10):
            out[i, j] = covariance[i, j] * d[i] * d[j] + gain_std**2 * mean[i] * mean[j]
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
    """The smallest c (N, 10) with which each answer's intervals would hold: 0 where the gain's part alone does."""
    out = np.empty((len(records), 10))
    for k in range(len(records)):
        trusted = calibration.trusted(records.evidence(k))
        found = prior.posterior(trusted.information, trusted.vector)
        beyond = (found.mean - records.truth[k]) ** 2 - (Z95 * trusted.gain_std * found.mean) ** 2
        out[k] = np.sqrt(np.maximum(beyond, 0.0) / np.diag(found.covariance))
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
