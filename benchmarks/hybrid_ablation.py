"""What each learned part of the hybrid brings: its training episodes, each answered by a model that had not seen it.

    python benchmarks/hybrid_ablation.py       (on the training's records in --work; about 40 CPU minutes without them)

All rows get the same evidence: the physics' information about phi, log by log. Cross-validated in four folds of
episodes; se is the standard error over the folds. Writes benchmarks/results/hybrid_ablation.json.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from script import options, say, write

from armload import arm
from armload.ensembles import NetworkLearner
from armload.inertia import Z95
from armload.lab.training import Records, payload_mixture
from armload.lab.training.calibrating import TREES, fit_calibration, nearest
from armload.lab.training.coverage import FOLDS
from armload.lab.training.hybrid import EPISODES, episode_records
from armload.lab.training.records import TIMES
from armload.posterior import MixturePrior

SHOWN = (0.1, 1.0, 6.0)  # [s]
GROUPS = {"mass_g": slice(0, 1), "first_moment_g_m": slice(1, 4), "inertia_g_m2": slice(4, 10)}


def gaussian(prior: MixturePrior) -> MixturePrior:
    """The same prior as one Gaussian: what least squares can be told of the payloads."""
    away = prior.means - prior.mean
    second = np.einsum("k,kij->ij", prior.weights, prior.covariances) + np.einsum(
        "k,ki,kj->ij", prior.weights, away, away
    )
    return MixturePrior(np.ones(1), prior.mean[None], second[None], ("all",))


def by_tare_and_time(records: Records, times: Sequence[float] = TIMES) -> Iterator[tuple[dict, NDArray[np.bool_]]]:
    """Without and with a tare, time by time: what it is called and which of the records (N,) it is."""
    which = nearest(records.t, np.array(TIMES))
    for kind, what in ((0, "no tare"), (1, "tare")):
        for t in times:
            yield {"what": what, "t": t}, (records.kind == kind) & (which == TIMES.index(t))


def main() -> None:
    asked = options(__doc__, work=Path("out/hybrid-panda"), episodes=EPISODES, jobs=1)
    panda = arm("panda")
    records = episode_records(panda, episodes=asked.episodes, folder=asked.work, jobs=asked.jobs)
    prior = payload_mixture(panda)
    networks = (NetworkLearner(hidden=32, batch=256, max_epochs=60),)
    rows = {
        "predict the training mean": None,
        "same-prior least squares": (gaussian(prior), "trusted"),
        "mixture prior": (prior, "trusted"),
        "mixture prior, one kappa": (prior, ()),
        "hybrid: kappa by trees": (prior, TREES),
        "mixture prior, kappa by networks": (prior, networks),
        "mixture prior, kappa by both": (prior, (*TREES, *networks)),
    }
    episodes = np.random.default_rng([0, 8]).permutation(np.unique(records.episode))
    out = []
    for name, how in rows.items():
        error, half = np.zeros((len(records), 10)), np.zeros((len(records), 10))
        fold = np.zeros(len(records), dtype=int)
        for k in range(FOLDS):
            held = np.isin(records.episode, episodes[k::FOLDS])
            fold[held] = k
            train = records.select(~held)
            if how is None:
                mean, std = train.truth.mean(axis=0), train.truth.std(axis=0)
                error[held], half[held] = np.abs(mean - records.truth[held]), Z95 * std
                continue
            used, learners = how
            # "trusted": the evidence is taken at its word; its widths are calibrated all the same
            trusted = learners == "trusted"
            calibration = fit_calibration(train, used, learners=() if trusted else learners, trusted=trusted, seed=k)
            for row in np.flatnonzero(held):
                found = calibration.answer(records.evidence(int(row)), used)
                error[row] = np.abs(found.mean - records.truth[row])
                half[row] = Z95 * np.sqrt(np.diag(found.covariance))
        for named, cell in by_tare_and_time(records, SHOWN):
            line = {"row": name, **named, "episodes": int(cell.sum())}
            for group, part in GROUPS.items():
                e, h = error[cell][:, part], half[cell][:, part]
                folds = [1e3 * error[cell & (fold == k)][:, part].mean() for k in range(FOLDS)]
                line[group] = round(1e3 * float(e.mean()), 3)
                line[f"{group}_se"] = round(float(np.std(folds, ddof=1) / np.sqrt(FOLDS)), 3)
                line[f"{group}_half_width"] = round(1e3 * float(h.mean()), 3)
                line[f"{group}_inside"] = round(float(np.mean(e <= h)), 4)
            out.append(line)
            say(json.dumps(line))
    write("hybrid_ablation", {"seed": 0, "folds": FOLDS, "rows": out})


if __name__ == "__main__":
    main()
