"""The paper's networks in the learning curves: errors over numbers of payloads, motions and arms trained on.

    python benchmarks/learning_networks.py [--logs 1000] [--seeds 2] [--cap 100] [--minutes 60]

The same logs, rows and judged runs as the trees of `learning_curves.py`: a bag of five networks of 500 units on 20 rows
of each log, inputs and outputs standardised, at most `--cap` epochs; the answer for a run is the mean over its rows.

Writes benchmarks/results/learning_networks.json; goes on from --work.
"""

from __future__ import annotations

import json
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from learning_curves import PARTS, trained, training_log
from numpy.typing import NDArray
from script import ROOT, options, say, write

from armload.ensembles import BaggingEnsemble, NetworkLearner
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key
from armload.recording import Recording

PLAN = (  # (payloads, motions, arms), the most telling first
    (10, 1, 1),
    (1000, 1, 1),
    (1000, 1000, 1000),
    (100, 1, 1),
    (1000, 1, 1000),
    (1000, 1000, 1),
    (1000, 100, 100),
    (1000, 10, 10),
)


@lru_cache(maxsize=1)
def drawn(counts: tuple[int, int, int], logs: int, seed: int) -> list[tuple[Recording, NDArray[np.float64]]]:
    """The training's logs with their payloads."""
    return [training_log(k, counts, seed) for k in range(logs)]


def networks(counts: tuple[int, int, int], logs: int, seed: int, cap: int) -> dict[str, Any]:
    """A training: its cost, and its errors (runs, 10) in each set."""
    started = time.process_time()
    ensemble = BaggingEnsemble(NetworkLearner(max_epochs=cap), seed=seed)
    found = trained(ensemble, drawn(counts, logs, seed), seed, started)
    return {"counts": counts, "logs": logs, "cap": cap, "epochs": np.ravel(ensemble.epochs_).tolist()} | found


def tasks(logs: int, seeds: int, cap: int) -> list[Task]:
    """All cells, one seed after the other."""
    code = source_key(
        Path(__file__),
        Path(__file__).with_name("learning_curves.py"),
        *(ROOT / "src" / "armload" / part for part in PARTS),
    )
    return [
        Task.of_one(
            f"networks-{'-'.join(map(str, counts))}-{seed}",
            key_of(code, counts, logs, seed, cap),
            networks,
            counts,
            logs,
            seed,
            cap,
        )
        for seed in range(seeds)
        for counts in PLAN
    ]


def main() -> None:
    asked = options(__doc__, logs=1000, seeds=2, cap=100, minutes=60.0, work="out/learning-networks")
    todo = tasks(asked.logs, asked.seeds, asked.cap)
    cells = run_tasks(todo, ROOT / asked.work, until=60.0 * asked.minutes, say=say)
    missing = [task.name for task in todo if task.name not in cells]
    result = {"cap": asked.cap, "missing": missing, "cells": json.loads(json.dumps(list(cells.values())))}
    write("learning_networks", result, indent=None)


if __name__ == "__main__":
    main()
