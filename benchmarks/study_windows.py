"""Learners that are tied to no motion: what they answer on arms they have not seen, and what they add to the physics.

    python benchmarks/study_windows.py [--shards 4] [--minutes 60] [--work out/study-windows]

Networks over windows (`armload.ensembles.window_networks`) see a run of 6 s of any motion of any Panda, by one of three
inputs, with or without a tare (`study_windows_data.py`). They are trained on 500 episodes a shard by inverse dynamics,
each with its own payload and arm, and judged in MuJoCo on payloads, motions and arms that no training has: arms of
`World.real_like`, as in the training, and of `World.beyond`. Beside them on the same runs: the mean of the training
payloads, the ridge regression, map-gp and the hybrid; same-prior is map-gp that knows the training payloads.

What a learner adds on top of the physics is measured by learners of the ridge regression's error: `statistics` from
its answer, its standard deviations and what it leaves of each joint; `conv` from these and the whole window.

Every cell has its own file in --work, and the same command goes on; JAX takes a GPU where it finds one. Writes
benchmarks/results/study_windows.json.
"""

from __future__ import annotations

import json
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import ROOT, options, say, write
from study_windows_data import (
    INPUTS,
    PRIOR_PAYLOADS,
    SHARD,
    TARES,
    Seen,
    channels,
    joined,
    judged,
    known,
    seen,
    shard,
)

from armload import arm
from armload.ensembles import BaggingEnsemble, NetworkLearner
from armload.ensembles.window_networks import WindowNetworks
from armload.lab.cells import key_of
from armload.lab.experiment import Task, listed, run_tasks
from armload.posterior import HybridIdentifier, SmoothPosteriorLeastSquares
from armload.runtime.atomic import replacing

FORMAT = 1  # of a cell; a change makes every one unfinished
WORLDS = ("real_like", "beyond")
RUNS = 24  # judged on arms of each kind
MEMBERS, WIDTH, STEPS = 3, 48, 1500  # of every bag of networks
FEWER = {"transformer": 750}  # steps of what costs six times as much
EPOCHS = 60  # at most, of the networks over `statistics`
ARCHITECTURES = ("conv", "gru", "transformer")
SIZES = (500, 1000)  # further numbers of training episodes, of one learner


def judge(worlds: str, folder: Path) -> dict[str, Any]:
    """Errors (runs, 10) of what is not trained, in worlds of a kind; keeps what learners see of the runs."""
    robot, started = arm("panda"), time.process_time()
    runs = judged(worlds, RUNS)
    windows = seen(runs)
    with replacing(folder / f"judged-{worlds}.npz") as temporary, temporary.open("wb") as file:
        np.savez(file, **windows._asdict())  # type: ignore[arg-type]
    simulated, prior = time.process_time() - started, known()
    found: dict[str, list] = {"training mean": [prior.mean - phi for *_, phi in runs]}
    for k, name in enumerate(TARES):
        found[f"ridge, {name}"] = list(windows.ridge[:, k, :10] - windows.phi)
        for log, tare, phi in runs:
            used = tare if name == TARES[1] else None
            methods = {
                "map-gp": SmoothPosteriorLeastSquares(robot, used),
                "same-prior": SmoothPosteriorLeastSquares(robot, used, prior=prior),
                "hybrid": HybridIdentifier(robot, used),
            }
            for method, identifier in methods.items():
                found.setdefault(f"{method}, {name}", []).append(identifier.run(log).phi - phi)
    spent = {"simulate": round(simulated, 1), "identify": round(time.process_time() - started - simulated, 1)}
    return {"worlds": worlds, "cost_s": spent, "errors": {name: listed(e, 4) for name, e in found.items()}}


def learn(architecture: str, what: str, tare: str, shards: int, episodes: int, seed: int, folder: Path) -> dict:
    """A bag of networks over windows: its cost, validation losses and errors (runs, 10)."""
    training = _training(folder, shards)
    started = time.process_time()
    model = WindowNetworks(architecture, MEMBERS, WIDTH, FEWER.get(architecture, STEPS), seed=seed)
    model.fit(channels(training, what, tare)[:episodes], training.phi[:episodes])
    errors = {}
    for worlds in WORLDS:
        windows = _judged(folder, worlds)
        errors[worlds] = model.predict(channels(windows, what, tare)) - windows.phi
    return _cell(architecture, what, tare, episodes, seed, started, errors, float(model.losses_.min(axis=0).mean()))


def correct(architecture: str, tare: str, shards: int, seed: int, folder: Path) -> dict:
    """A learner of the ridge regression's error: what remains when its answer is taken off (runs, 10)."""
    training, k = _training(folder, shards), TARES.index(tare)
    started = time.process_time()

    def given(windows: Seen) -> NDArray[np.float64]:
        statistics = windows.ridge[:, k].astype(float)
        if architecture == "statistics":
            return statistics
        return np.concatenate(
            [channels(windows, "rows", tare), np.repeat(statistics[:, None], windows.r.shape[1], axis=1)], axis=2
        )

    def left(windows: Seen) -> NDArray[np.float64]:
        return windows.phi - windows.ridge[:, k, :10]

    if architecture == "statistics":
        model: Any = BaggingEnsemble(NetworkLearner(hidden=100, max_epochs=EPOCHS), members=MEMBERS, seed=seed)
    else:
        model = WindowNetworks(architecture, MEMBERS, WIDTH, STEPS, seed=seed)
    model.fit(given(training), left(training))
    losses = model.losses_
    errors = {worlds: model.predict(given(w)) - left(w) for worlds in WORLDS for w in [_judged(folder, worlds)]}
    loss = float(np.nanmin(losses, axis=0).mean())
    return _cell(architecture, "ridge's answer", tare, len(training.phi), seed, started, errors, loss)


def _cell(architecture: str, what: str, tare: str, episodes: int, seed: int, started: float, errors: dict, loss: float):
    return {
        "learner": architecture,
        "input": what,
        "tare": tare,
        "episodes": episodes,
        "seed": seed,
        "cost_s": round(time.process_time() - started, 1),
        "validation_loss": round(loss, 4),
        "errors": {worlds: listed(e, 4) for worlds, e in errors.items()},
    }


@lru_cache(maxsize=1)
def _training(folder: Path, shards: int) -> Seen:
    return joined([shard(folder, k) for k in range(shards)])


@lru_cache(maxsize=2)
def _judged(folder: Path, worlds: str) -> Seen:
    with np.load(folder / f"judged-{worlds}.npz") as file:
        return Seen(**file)


def _sharded(folder: Path, number: int) -> dict[str, Any]:
    started = time.process_time()
    shard(folder, number)
    return {"cost_s": round(time.process_time() - started, 1)}


def tasks(folder: Path, shards: int) -> list[Task]:
    """All cells, the telling ones first."""
    runs, all_of_it = (FORMAT, RUNS, PRIOR_PAYLOADS), shards * SHARD
    settings = (*runs, MEMBERS, WIDTH, STEPS, FEWER, EPOCHS)
    made = [Task.of_one(f"judged-{w}", key_of(runs, w), judge, w, folder) for w in WORLDS]
    made += [Task.of_one(f"shard-{k:04d}", key_of(FORMAT, k), _sharded, folder, k) for k in range(shards)]

    def learner(name: str, measure: Any, *parameters: Any) -> Task:
        return Task.of_one(name, key_of(settings, shards, parameters), measure, *parameters, folder)

    def window(architecture: str, what: str, tare: str, episodes: int = all_of_it, seed: int = 0) -> Task:
        name = f"{architecture}-{what}-{tare.replace(' ', '-')}-{episodes}-s{seed}"
        return learner(name, learn, architecture, what, tare, shards, episodes, seed)

    def on_top(architecture: str, tare: str, seed: int = 0) -> Task:
        name = f"{architecture}-on-ridge-{tare.replace(' ', '-')}-{all_of_it}-s{seed}"
        return learner(name, correct, architecture, tare, shards, seed)

    made += [window("conv", what, tare) for what in INPUTS for tare in TARES]
    made += [on_top(a, tare) for a in ("statistics", "conv") for tare in TARES]
    made += [window(a, "residual", tare) for a in ARCHITECTURES[1:] for tare in TARES]
    made += [window("conv", "residual", TARES[1], size) for size in SIZES if size < all_of_it]
    made += [window(a, what, tare) for what in ("rows", "raw") for a in ARCHITECTURES[1:] for tare in TARES]
    made += [window("conv", "residual", tare, seed=1) for tare in TARES]
    made += [on_top(a, tare, seed=1) for a in ("statistics", "conv") for tare in TARES]
    return made


def main() -> None:
    asked = options(__doc__, shards=4, minutes=60.0, work="out/study-windows")
    folder = ROOT / asked.work
    todo = tasks(folder, asked.shards)
    cells = run_tasks(todo, folder / "cells", until=60.0 * asked.minutes, say=say)
    missing = [task.name for task in todo if task.name not in cells]
    result = {"episodes": asked.shards * SHARD, "runs": RUNS, "missing": missing}
    write("study_windows", result | {"cells": json.loads(json.dumps(list(cells.values())))}, indent=None)


if __name__ == "__main__":
    main()
