"""Where trees that see (t, q, dq, tau) stop memorising: errors over numbers of payloads, motions and arms trained on.

    python benchmarks/learning_curves.py [--logs 1000] [--seeds 2] [--minutes 60] [--work out/learning-curves]

Every training but the last has the same number of logs, by `simulate_inverse`, and of rows; the last, of 10 000
payloads, motions and arms, has ten times as many. Log k holds payload k mod P, runs motion k mod M on arm k mod A, so
that P·M·A combinations do not all occur. An ensemble is the paper's: five trees without limits; its answer for a run is
the mean over the run's rows. It is judged in MuJoCo on payloads never seen: on the training's first motion and arm
(`payload`), on other motions of that arm (`motion`), and on motions of other arms, drawn from `World.beyond`, where
training draws from `World.real_like` (`arm`). Beside it, on the same runs: the mean of
the training payloads; least squares with the smooth mismatch with the weak prior (map-gp) and with those payloads
as one Gaussian prior (same-prior); the latter and the hybrid with a tare too, a bare run of that arm on another motion.
The trees have no tare; on `payload` and `motion` they know the arm from their training.

Writes benchmarks/results/learning_curves.json; goes on from --work.
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

from armload import Arm, arm
from armload.ensembles import BaggingEnsemble
from armload.lab.cells import key_of
from armload.lab.experiment import Task, listed, run_tasks, source_key
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.posterior import HybridIdentifier, SmoothPosteriorLeastSquares
from armload.recording import Recording
from armload.regression import GaussianPrior
from armload.simulation import Run, Sensors, World, simulate_inverse, simulate_many

# (payloads, motions, arms): one number grows at a time, or motions and arms together; the most telling first
PLAN = (
    (10, 1, 1),
    (1000, 1, 1),
    (1000, 1000, 1000),
    (1000, 1, 1000),
    (1000, 1000, 1),
    (100, 1, 1),
    *((1000, n, n) for n in (100, 10)),
    *((1000, 1, a) for a in (100, 10)),
    *((1000, m, 1) for m in (100, 10)),
    (10000, 10000, 10000),  # with ten times the logs: whether more data would bring it
)
RATE = 50.0  # [Hz] of every log: the sensors' noise is that of single samples, so a higher rate adds only cost
ROWS = 20  # of each training log, at random times
RUNS = 8  # judged in each set
SETS = ("payload", "motion", "arm")
PARTS = ("ensembles", "simulation", "motion", "payloads", "arms")  # of the package: what a training depends on
_SPAN, _UNSEEN = 1_000_000, 500_000  # seeds of one repetition; from where on those are that training never draws


def training_log(k: int, counts: tuple[int, int, int], seed: int) -> tuple[Recording, NDArray[np.float64]]:
    """Log k of a training and the payload's phi (10,)."""
    robot, (p, m, a) = arm("panda"), (_SPAN * seed + k % n for n in counts)
    payload = draw_payload("boxes", p)
    log = simulate_inverse(
        robot,
        _motion(m),
        [(0.0, payload)],
        world=World.real_like(robot, a),
        sensors=Sensors.panda(robot).evenly(),
        rate=RATE,
        seed=_SPAN * seed + k,
    )
    return log, payload.parameters.phi


def rows_of(log: Recording) -> NDArray[np.float64]:
    """(t, q, dq, tau) of a log (N, 1 + 3n), as the paper's ensembles see it."""
    return np.column_stack([log.t, log.q, log.dq, log.tau])


@lru_cache(maxsize=2000)
def _motion(seed: int) -> Any:
    return random_motion(arm("panda"), seed)


@lru_cache(maxsize=4)
def judged(name: str, seed: int) -> list[tuple[Recording, Recording, NDArray[np.float64]]]:
    """Runs of a set, each with its tare and its truth (10,), by MuJoCo."""
    robot, first = arm("panda"), _SPAN * seed
    sensors = Sensors.panda(robot).evenly()
    loaded, bare, truth = [], [], []
    for k in range(first + _UNSEEN, first + _UNSEEN + RUNS):
        k += RUNS * SETS.index(name)
        world = World.beyond(robot, k) if name == "arm" else World.real_like(robot, first)
        payload = draw_payload("boxes", k)
        loaded.append(Run(_motion(first if name == "payload" else k), payload, world, sensors, k, start=60.0))
        bare.append(Run(_motion(k + 1000), None, world, sensors, k + 1000))
        truth.append(payload.parameters.phi)
    logs = (simulate_many(robot, runs, rate=RATE, duration=6.0) for runs in (loaded, bare))
    return list(zip(*logs, truth, strict=True))


def trees(counts: tuple[int, int, int], logs: int, seed: int) -> dict[str, Any]:
    """A training: its cost, and its errors (runs, 10) in each set."""
    started = time.process_time()
    drawn = [training_log(k, counts, seed) for k in range(logs)]
    return {"counts": counts, "logs": logs} | trained(BaggingEnsemble("tree", seed=seed), drawn, seed, started)


def trained(
    ensemble: BaggingEnsemble, drawn: list[tuple[Recording, NDArray[np.float64]]], seed: int, started: float
) -> dict[str, Any]:
    """An ensemble fitted to `ROWS` rows of each log: cost [s] since `started`, and errors (runs, 10) in each set."""
    generator = np.random.default_rng(seed)  # other times in each log: fixed ones would leave the rest of a run unseen
    every = [generator.choice(len(log), ROWS, replace=False) for log, _ in drawn]
    X = np.concatenate([rows_of(log)[rows] for (log, _), rows in zip(drawn, every, strict=True)])
    y = np.repeat([phi for _, phi in drawn], ROWS, axis=0)
    simulated = time.process_time() - started
    ensemble.fit(X, y)
    fitted = time.process_time() - started - simulated
    seen = [ensemble.predict(rows_of(log)).mean(axis=0) - phi for log, phi in drawn[:RUNS]]
    errors = {
        name: [ensemble.predict(rows_of(run)).mean(axis=0) - phi for run, _, phi in judged(name, seed)] for name in SETS
    }
    return {
        "rows": len(X),
        "seed": seed,
        "cost_s": {"simulate": round(simulated, 2), "train": round(fitted, 2)},
        "errors": {"training's own logs": listed(seen, 4)} | {name: listed(found, 4) for name, found in errors.items()},
    }


def physics(name: str, seed: int) -> dict[str, Any]:
    """Errors (runs, 10) of what knows physics, and of the training payloads' mean, in a set."""
    robot = arm("panda")
    known = GaussianPrior.of([draw_payload("boxes", _SPAN * seed + k).parameters for k in range(1000)])
    found: dict[str, list] = {"training mean": []}
    started = time.process_time()
    for run, tare, phi in judged(name, seed):
        found["training mean"].append(known.mean - phi)
        methods = {
            "map-gp": SmoothPosteriorLeastSquares(robot),
            "same-prior": SmoothPosteriorLeastSquares(robot, prior=known),
            "same-prior, with tare": SmoothPosteriorLeastSquares(robot, tare, prior=known),
            "hybrid, with tare": HybridIdentifier(robot, tare),
        }
        for method, identifier in methods.items():
            found.setdefault(method, []).append(identifier.run(run).phi - phi)
    return {
        "set": name,
        "seed": seed,
        "cost_s": round(time.process_time() - started, 2),
        "errors": {method: listed(errors, 4) for method, errors in found.items()},
    }


def sampler(robot: Arm, seeds: int = 4) -> dict[str, Any]:
    """Torque of the fast sampler minus MuJoCo's, rms [N·m] by joint, beside the torque's own; nothing but the arm."""
    difference, size = [], []
    for k in range(_UNSEEN, _UNSEEN + seeds):
        payload = draw_payload("boxes", k)
        (engine,) = simulate_many(robot, [Run(_motion(k), payload)], rate=RATE, duration=6.0)
        fast = simulate_inverse(robot, _motion(k), [(0.0, payload)], rate=RATE, tracking=0.0)
        difference.append(fast.tau - engine.tau[: len(fast)])
        size.append(fast.tau)
    rms = [listed(np.sqrt(np.mean(np.square(x), axis=(0, 1))), 3) for x in (difference, size)]
    return {"difference_rms": rms[0], "torque_rms": rms[1], "runs": seeds}


def tasks(logs: int, seeds: int) -> list[Task]:
    """All cells, the cheap and telling ones first."""
    code = source_key(Path(__file__), *(ROOT / "src" / "armload" / part for part in PARTS))
    made = [Task.of_one("sampler", key_of(code), sampler, arm("panda"))]
    for seed in range(seeds):
        made += [Task.of_one(f"physics-{s}-{seed}", key_of(code, source_key()), physics, s, seed) for s in SETS]
        for counts in PLAN:
            name, many = f"trees-{'-'.join(map(str, counts))}-{seed}", logs * max(1, max(counts) // 1000)
            made.append(Task.of_one(name, key_of(code, counts, many, seed), trees, counts, many, seed))
    return made


def main() -> None:
    asked = options(__doc__, logs=1000, seeds=2, minutes=60.0, work="out/learning-curves")
    todo = tasks(asked.logs, asked.seeds)
    cells = run_tasks(todo, ROOT / asked.work, until=60.0 * asked.minutes, say=say)
    missing = [task.name for task in todo if task.name not in cells]
    write("learning_curves", {"missing": missing, "cells": json.loads(json.dumps(list(cells.values())))}, indent=None)


if __name__ == "__main__":
    main()
