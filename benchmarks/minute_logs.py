"""Whether the hybrid's intervals hold on logs longer than those that they were calibrated on.

    python benchmarks/minute_logs.py [--robots panda,ur10e] [--logs 40] [--jobs 1]

The shipped models' widths were calibrated up to 6 s after a run began. Here runs last 60 s: each log is another arm,
payload and motion (a Fourier motion that repeats, a slow one that does not, stops at ever new poses, pick and place),
at 200 Hz, without a tare and with one of 20 s on another motion, answered by the hybrid at several times of one run.
Goes on from out/minute_logs. Written to benchmarks/results/minute_logs.json and a table of docs/hybrid_measured.md:
share of the 95 % intervals that hold the truth, ± the standard error if a log's ten count as one answer, and mean
half-width over mean error of mass · first moments · inertia. In the results stand the errors, too, and d ln(error) / d
ln(t) from 6 to 60 s: −0.5 where errors average out, 0 where more of the log tells no more. Five minutes of one core.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm
from armload.inertia import Z95
from armload.lab.cells import key_of
from armload.lab.episodes import Episode, Recipe, draw_episodes, simulate_episodes
from armload.lab.experiment import Task, run_tasks, source_key
from armload.posterior import HybridIdentifier

TIMES = (1.0, 6.0, 15.0, 30.0, 60.0)  # [s] since the run began
FIRST_SEED = 910_001  # nothing is trained on it
GROUPS = {"mass": slice(0, 1), "first moments": slice(1, 4), "inertia": slice(4, 10)}
TARES = ("no tare", "tare")
MOTIONS = ("harmonics", "long", "point-to-point", "pick-and-place")
PAYLOADS = ("boxes", "shapes", "tools", "container")
LONG = Recipe(worlds=("real_like",), payloads=PAYLOADS, motions=MOTIONS, duration=TIMES[-1])


@cache
def episodes(robot: str, count: int) -> list[Episode]:
    """Long episodes on arms that differ from their model as real ones do."""
    return draw_episodes(arm(robot), LONG, count, FIRST_SEED, motions=count)


def answered(
    robot: str, run: Recording, tare: Recording | None, truth: NDArray[np.float64]
) -> dict[str, list[list[float]]]:
    """|error| and half-width (T, 10) at the times."""
    found = HybridIdentifier(arm(robot), tare).at(run, TIMES)
    error, half = np.abs([e.phi - truth for e in found]), Z95 * np.array([e.std for e in found])
    return {"error": error.tolist(), "half": half.tolist()}


def measured(robot: str, count: int, k: int) -> dict[str, Any]:
    """One log as a cell's numbers."""
    logs = next(iter(simulate_episodes([episodes(robot, count)[k]])))
    return {what: answered(robot, logs.run, logs.tare if what == "tare" else None, logs.truth.phi) for what in TARES}


def summary(error: NDArray[np.float64], half: NDArray[np.float64]) -> dict[str, Any]:
    """What is written of one robot with or without a tare; (E, T, 10) both."""
    inside = (error <= half).mean(axis=2)  # (E, T)
    out: dict[str, Any] = {
        "inside": inside.mean(axis=0).round(3).tolist(),
        "standard error": (inside.std(axis=0) / np.sqrt(len(inside))).round(3).tolist(),
    }
    for name, part in GROUPS.items():
        wrong, wide = (x[..., part].mean(axis=(0, 2)) for x in (error, half))
        out[name] = {
            "inside": (error <= half)[..., part].mean(axis=(0, 2)).round(3).tolist(),
            "error": [float(f"{x:.4g}") for x in wrong],
            "half-width over error": (wide / wrong).round(2).tolist(),
            "slope": round(float(np.log(wrong[-1] / wrong[1]) / np.log(TIMES[-1] / TIMES[1])), 2),
        }
    return out


def table(robots: dict[str, Any]) -> str:
    """A row for each robot, with and without a tare, and time."""
    rows = [
        [
            robot,
            what,
            *(f"{100 * x:.1f} ± {100 * e:.1f}" for x, e in zip(found["inside"], found["standard error"], strict=True)),
            " · ".join(f"{found[name]['half-width over error'][-1]:.1f}" for name in GROUPS),
            " · ".join(f"{found[name]['slope']:.2f}".replace("-", "−") for name in GROUPS),
        ]
        for robot, by_tare in robots.items()
        for what, found in by_tare.items()
    ]
    times = [f"inside after {t:g} s [%]" if t == TIMES[0] else f"{t:g} s" for t in TIMES]
    head = ["arm", "", *times, "half-width over error, 60 s", "slope of the error, 6 to 60 s"]
    return markdown_table(head, "ll" + "r" * (len(TIMES) + 2), rows)


def main() -> None:
    asked = options(__doc__, robots="panda,ur10e", logs=40, jobs=1)
    code, count, found = source_key(), asked.logs, {}
    for robot in asked.robots.split(","):
        tasks = [
            Task.of_one(f"{robot}-{count}-{k}", key_of(code, TIMES), measured, robot, count, k) for k in range(count)
        ]
        cells = list(run_tasks(tasks, ROOT / "out" / "minute_logs", jobs=asked.jobs, say=say).values())
        of = {what: [np.array([cell[what][x] for cell in cells]) for x in ("error", "half")] for what in TARES}
        found[robot] = {what: summary(*both) for what, both in of.items()}
    write("minute_logs", {"first seed": FIRST_SEED, "logs": count, "times [s]": list(TIMES), "robots": found})
    write_table(ROOT / "docs" / "hybrid_measured.md", "minute logs", table(found))


if __name__ == "__main__":
    main()
