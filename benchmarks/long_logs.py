"""Whether the hybrid's error bars hold on logs longer than those they were calibrated on.

    python benchmarks/long_logs.py [--robot panda] [--episodes 40] [--worlds real_like] [--jobs 1]

The shipped model's widths were calibrated up to 6 s after a run began. Here runs last 60 s: every episode is another
arm, payload and motion (a Fourier motion that repeats, a slow one that does not, stops at ever new poses, pick and
place), logged at 200 Hz, identified without and with a tare of 20 s on another motion, at several times of the same
run. Goes on from out/long_logs. Written to benchmarks/results/long_logs_ROBOT.json, for each world, with and without a
tare, and each group of parameters, over time:

coverage: share of the 95 % intervals that hold the truth. The episodes are few: `standard_error` is that of the
    coverage, with an episode's parameters taken as one observation.
half_width, error: mean over episodes and parameters, in kg, kg·m, kg·m²; the median of the half-widths, too: where an
    answer leaves the families of payloads for the prior's wide component, its half-width grows tenfold.
widen: 95 % quantile of |error| over half-width: by which factor the error bars would have to be widened.
slope: d ln(error) / d ln(t) between two times; −0.5 where errors average out, 0 where more of the log tells no more.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import ROOT, options, say, write

from armload import Arm, Recording, arm
from armload.inertia import Z95
from armload.lab.cells import key_of
from armload.lab.episodes import Episode, Recipe, draw_episodes, simulate_episodes
from armload.lab.experiment import Task, run_tasks, source_key
from armload.posterior import HybridIdentifier, HybridModel, shipped_model

TIMES = (1.0, 3.0, 6.0, 15.0, 30.0, 60.0)  # [s] since the run began
FIRST_SEED = 910_001  # nothing is trained on it
GROUPS = {"mass": slice(0, 1), "first_moment": slice(1, 4), "inertia": slice(4, 10)}
MOTIONS = ("harmonics", "long", "point-to-point", "pick-and-place")
LONG = Recipe(payloads=("boxes", "shapes", "tools", "container"), motions=MOTIONS, duration=TIMES[-1])


@cache
def episodes(robot: Arm, world: str, count: int) -> list[Episode]:
    """`count` long episodes on arms of a world."""
    recipe = replace(LONG, worlds=(world,), elapsed=(30.0, 600.0) if world == "beyond" else LONG.elapsed)
    return draw_episodes(robot, recipe, count, FIRST_SEED, motions=count)


def answered(
    robot: Arm, model: HybridModel, run: Recording, tare: Recording | None, truth: NDArray
) -> dict[str, list[list[float]]]:
    """|error| and half-width (T, 10) at the times."""
    found = HybridIdentifier(robot, tare, model).at(run, TIMES)
    error, half = np.abs([e.phi - truth for e in found]), Z95 * np.array([e.std for e in found])
    return {"error": error.tolist(), "half": half.tolist()}


def measured(name: str, world: str, count: int, k: int) -> dict[str, Any]:
    """One episode as a cell's numbers."""
    robot = arm(name)
    model, episode = shipped_model(robot), episodes(robot, world, count)[k]
    logs = next(iter(simulate_episodes([episode])))
    return {
        "motion": next(kind for kind in MOTIONS if f"run-{kind}" in str(episode.motion.name)),
        "no tare": answered(robot, model, logs.run, None, logs.truth.phi),
        "tare": answered(robot, model, logs.run, logs.tare, logs.truth.phi),
    }


def table(error: NDArray, half: NDArray) -> dict:
    """What is written of one world with or without a tare; (E, T, 10) both."""
    inside = error <= half
    out = {}
    for name, part in {**GROUPS, "all": slice(0, 10)}.items():
        shares = inside[..., part].mean(axis=2)  # (E, T)
        wrong = error[..., part].mean(axis=(0, 2))
        out[name] = {
            "coverage": shares.mean(axis=0).round(3).tolist(),
            "standard_error": (shares.std(axis=0) / np.sqrt(len(shares))).round(3).tolist(),
            "widen": [
                round(float(np.quantile(error[:, k, part] / half[:, k, part], 0.95)), 2) for k in range(len(TIMES))
            ],
        }
        if name in GROUPS:  # units do not mix
            out[name] |= {
                "half_width": [float(f"{x:.4g}") for x in half[..., part].mean(axis=(0, 2))],
                "median_half_width": [float(f"{x:.4g}") for x in np.median(half[..., part], axis=(0, 2))],
                "error": [float(f"{x:.4g}") for x in wrong],
                "slope": (np.diff(np.log(wrong)) / np.diff(np.log(TIMES))).round(2).tolist(),
            }
    return out


def main() -> None:
    asked = options(__doc__, robot="panda", episodes=40, worlds="real_like", jobs=1)
    name, count, code, worlds = asked.robot, asked.episodes, source_key(), {}
    for world in asked.worlds.split(","):
        tasks = [
            Task.of_one(f"{name}-{world}-{count}-{k}", key_of(code, TIMES), measured, name, world, count, k)
            for k in range(count)
        ]
        cells = list(run_tasks(tasks, ROOT / "out" / "long_logs", jobs=asked.jobs, say=say).values())
        kinds = np.array([cell["motion"] for cell in cells])
        tables = worlds[world] = {}
        for what in ("no tare", "tare"):
            error, half = (np.array([cell[what][x] for cell in cells]) for x in ("error", "half"))
            inside = (error <= half).mean(axis=2)
            by_motion = {kind: inside[kinds == kind].mean(axis=0).round(3).tolist() for kind in sorted(set(kinds))}
            tables[what] = table(error, half) | {"coverage_by_motion": by_motion}
    trained = shipped_model(arm(name)).training
    result = {
        "robot": name,
        "model": None if trained is None else asdict(trained),
        "first_seed": FIRST_SEED,
        "episodes": count,
        "times_s": list(TIMES),
        "worlds": worlds,
    }
    write(f"long_logs_{name}", result)


if __name__ == "__main__":
    main()
