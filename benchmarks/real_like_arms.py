"""Errors and interval coverage of the methods that need no training, on arms that differ from their model.

    python benchmarks/real_like_arms.py [--cases 24]

Each case is another arm (`World.real_like`), another random payload, another 6 s motion from rest, and a 20 s tare of
the empty arm on yet another motion. Writes benchmarks/results/real_like_arms.json and docs/results.md.
"""

from __future__ import annotations

import time

import numpy as np
from script import ROOT, options, write

from armload import __version__, arm
from armload.inertia import NAMES, InertialParameters
from armload.lab.evaluation import Comparison, EvaluationRun, catalogued, compare
from armload.lab.report import markdown
from armload.motion import random_motion
from armload.payloads import random_payloads
from armload.regression import GaussianPrior
from armload.simulation import Run, Sensors, World, simulate_many

METHODS = ("rls", "rls-filter", "rls-filter, with tare", "map", "map, with tare", "map-gp, with tare")
METHODS += ("hybrid", "hybrid, with tare")
TIMES = (0.5, 1.0, 3.0, 6.0)  # [s]
COMMAND = "python benchmarks/real_like_arms.py"


def cases(count: int) -> list[EvaluationRun]:
    """Simulate the runs and their tares."""
    robot, sensors = arm("panda"), Sensors.panda(arm("panda"))
    payloads = random_payloads(count, seed=0)
    worlds = [World.real_like(robot, seed) for seed in range(count)]
    motions = [random_motion(robot, seed, duration=6.05) for seed in range(count)]
    others = [random_motion(robot, 1000 + seed, duration=20.0, harmonics=10) for seed in range(count)]
    loaded = [Run(m, p, w, sensors, k) for k, (m, p, w) in enumerate(zip(motions, payloads, worlds, strict=True))]
    empty = [Run(m, None, w, sensors, 1000 + k) for k, (m, w) in enumerate(zip(others, worlds, strict=True))]
    logs = simulate_many(robot, loaded + empty)
    return [
        EvaluationRun(
            log, InertialParameters(p.parameters.phi, robot.frame), f"arm {k}, {p.parameters.mass:.2f} kg", tare, seed=k
        )
        for k, (log, tare, p) in enumerate(zip(logs[:count], logs[count:], payloads, strict=True))
    ]


def run(count: int) -> Comparison:
    """All methods on all cases."""
    robot = arm("panda")
    # what a model trained on this population would know; none of these payloads is in the runs
    prior = GaussianPrior.of(
        [p.parameters for p in random_payloads(400, seed=10_000)], "400 payloads of the population"
    )
    return compare(
        catalogued(robot, *METHODS),
        cases(count),
        TIMES,
        training=prior,
        split="payloads, arms and motions all differ, none of them in the hybrid's training; tare on another motion",
    )


def page(c: Comparison) -> str:
    """docs/results.md."""
    tables = [c.table(c.times.tolist().index(6.0)), c.table(c.times.tolist().index(1.0)), c.intervals()]
    return "\n".join(
        [
            "# Results on simulated real-like arms",
            "",
            f"Written by `{COMMAND}` (armload {__version__}); the numbers are also in",
            "`benchmarks/results/real_like_arms.json`.",
            "",
            "Every case is another Panda that differs from its model as real ones do, another payload of one to four",
            "boxes (0.2–2.8 kg), another motion, and a tare of the empty arm on yet another motion.",
            "",
            "Read each column against the row `training mean`: a method with a larger error has no information on it.",
            "`same-prior least squares` is `map, with tare` with the payload population as its prior: what a method",
            "trained on this population has to beat.",
            "",
            *(markdown(table) for table in tables),
        ]
    )


def main() -> None:
    asked = options(__doc__, cases=24)
    started = time.perf_counter()
    comparison = run(asked.cases)
    print(comparison)
    coverage = comparison.coverage()
    result = {
        "wall_s": round(time.perf_counter() - started, 1),
        "conditions": comparison.conditions,
        "parameters": list(NAMES),
        "times": list(TIMES),
        "mae": {m: np.round(comparison.mae[k], 6).tolist() for k, m in enumerate(comparison.methods)},
        "spread": {m: np.round(comparison.spread[k], 6).tolist() for k, m in enumerate(comparison.methods)},
        "coverage_95": {m: np.round(coverage[k], 3).tolist() for k, m in enumerate(comparison.methods)},
        "half_width_95": {
            m: np.round(comparison.half_width()[k], 6).tolist() for k, m in enumerate(comparison.methods)
        },
    }
    write("real_like_arms", result)
    (ROOT / "docs" / "results.md").write_text(page(comparison))


if __name__ == "__main__":
    main()
