"""How far evidence can be trusted, learned from episodes: the bag that reads kappa, and the calibrated widths.

The widths are cross-conformal: each episode is scored by a bag that has not seen it, so that the widths hold for new
ones.

Sources: Lei et al., JASA 2018; Vovk, Annals of Mathematics and Artificial Intelligence 2015; Breiman 1996.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma

from armload.ensembles import Compiled, MixedEnsemble, TreeLearner
from armload.ensembles.weak_learner import Learner
from armload.inertia import Z95
from armload.lab.training.records import TIMES, Records
from armload.posterior import MixturePrior
from armload.posterior.calibration import COVERAGE, LIGHT_MASS, Calibration
from armload.posterior.evidence import KINDS

_INFORMATIVE = 9.0  # a direction counts as seen once the evidence shrinks its prior's variance so many times
# members of the bag and depth of a tree: chosen once for 2 400 episodes of 18 traits, never tuned
_MEMBERS = 5
TREES = (TreeLearner(max_depth=7),)
_FEWEST = 30  # episodes below which a quantile is not worth its name
_FOLDS = 3  # of the episodes: each is scored by a bag fitted on the others
_NARROWEST = 0.1  # c is no less, even where the gain covers 95 %


def fit_calibration(
    records: Records, prior: MixturePrior, *, learners: Sequence[Learner] = TREES, trusted: bool = False, seed: int = 0
) -> Calibration:
    """Fit the bag on all episodes, and the widths on the scores of bags that had a third of them left out.

    Args:
        records: of many episodes. prior: the payload prior the answers will use.
        learners: what the bag is made of; nothing: no bag, one kappa for all (the ablation). Trees, networks and both
            together are equally good (`benchmarks/hybrid_ablation.py`), and trees are the simplest.
        trusted: kappa is 1, whatever the episodes say (the other ablation).
    """
    times = _times(records.t)

    def draft(some: Records) -> Calibration:
        bag, level = (None, 1.0) if trusted else _fit_kappa(some, prior, learners, seed)
        return Calibration(bag, level, times, np.ones((len(KINDS), len(times), 10)), LIGHT_MASS * float(prior.std[0]))

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


def scores(records: Records, prior: MixturePrior, calibration: Calibration) -> NDArray[np.float64]:
    """The smallest c (N, 10) with which each answer's intervals would hold: 0 where the gain's part does."""
    out = np.empty((len(records), 10))
    for k in range(len(records)):
        trusted = calibration.trusted(records.evidence(k))
        found = calibration.posterior(trusted, prior)
        beyond = (found.mean - records.truth[k]) ** 2 - (Z95 * trusted.gain_std * found.mean) ** 2
        beyond -= Z95**2 * np.diag(trusted.of_joints(found.mean, found.covariance))
        out[k] = np.sqrt(np.maximum(beyond, 0.0) / np.diag(found.covariance))
        out[k, 4:] /= calibration.narrowing(found, prior)
    return out


def overrating(records: Records, prior: MixturePrior) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """By which factor each row's evidence was overrated: squared error over variance, where the log tells something.

    In the coordinates in which the prior's covariance is the identity, Λ = V·diag(l)·Vᵀ; over the directions with
    l ≥ 9 the mean of l·(vᵀ·(phi − phi_ML))²; NaN where there is no such direction. And how many there are.
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
    records: Records, prior: MixturePrior, learners: Sequence[Learner], seed: int
) -> tuple[Compiled | None, float]:
    target, directions = overrating(records, prior)
    keep = np.isfinite(target)
    target, traits, episode = target[keep], records.traits[keep], records.episode[keep]
    half = 0.5 * directions[keep]
    if not learners:
        return None, float(np.mean(target))
    # the mean of ln(χ²_m / m) is ψ(m/2) − ln(m/2): −1.27 of one direction, −0.1 of ten; no sign of good evidence
    log = (np.log10(np.maximum(target, 1e-3)) - (digamma(half) - np.log(half)) / np.log(10.0))[:, None]
    rng = np.random.default_rng(seed + 1)
    episodes = rng.permutation(np.unique(episode))
    checked = np.isin(episode, episodes[: len(episodes) // 5])
    model = MixedEnsemble(tuple(learners), members=_MEMBERS, seed=seed, scale="standard")
    model.fit(traits[~checked], log[~checked], traits[checked], log[checked])
    bag: Compiled = model.compiled_
    predicted = 10.0 ** bag.predict(traits[checked])[:, 0]
    # the mean of a logarithm is below the logarithm of the mean; trimmed, so that one wild log does not set the level
    ratio = np.sort(target[checked] / predicted)
    return bag, float(np.mean(ratio[: int(0.98 * len(ratio))]))
