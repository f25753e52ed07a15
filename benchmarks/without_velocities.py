"""What an answer loses where the log has no velocities and its positions tell them.

    python benchmarks/without_velocities.py [--robots panda,ur5e,gen3] [--logs 16] [--seed 40]

Sound logs of wrong_cases.py (6 s, arms that differ from their model as real ones do, sensors with noise, jitter, lost
samples), each with its tare of 20 s, at 200 Hz and thinned to 50 and 25 Hz. Each pair is answered by `identify` with
the velocities that were measured, and with those of its positions (`recording.steadied`). Mean errors of mass [g],
first moments [g·m] and inertia [g·m²], the second over the first (± one standard error of a mean of paired
differences), and the share of the true values inside their intervals. Called approximate: of the answers. Then the
real logs that are at hand (`ARMLOAD_REAL_DATA`): mass and 95 % interval either way.

Written to benchmarks/results/without_velocities.json and tables of docs/recordings.md; fifteen minutes of one core.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from real_logs import data
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import RATE, sound

from armload import Recording, arm, identify, read_recording
from armload.recording import with_velocities_of_positions

THINNED = (1, 4, 8)
PARTS = {"mass [g]": slice(0, 1), "first moments [g·m]": slice(1, 4), "inertia [g·m²]": slice(4, 10)}
WAYS = ("measured", "of positions")
PAGE = ROOT / "docs" / "recordings.md"


def thinned(log: Recording, every: int) -> Recording:
    """One sample in so many."""
    return log.select(slice(None, None, every))


def answered(robot: str, logs: int, seed: int, every: int) -> dict[str, dict[str, NDArray]]:
    """Errors (N, 10), what is inside (N, 10), and which are approximate, of each way."""
    found: dict[str, dict[str, list]] = {way: {"error": [], "inside": [], "approximate": []} for way in WAYS}
    for log in sound("reference", robot, logs, seed):
        assert log.tare is not None
        pair = [thinned(x, every) for x in (log.run, log.tare)]
        for way in WAYS:
            run, tare = pair if way == "measured" else map(with_velocities_of_positions, pair)
            answer = identify(run, arm(robot), tare=tare)
            error = np.abs(answer.phi - log.truth)
            found[way]["error"].append(1e3 * error)
            found[way]["inside"].append((answer.phi_low <= log.truth) & (log.truth <= answer.phi_high))
            found[way]["approximate"].append(answer.interval != "calibrated")
    return {way: {what: np.array(values) for what, values in of.items()} for way, of in found.items()}


def summary(found: dict[str, dict[str, NDArray]]) -> dict[str, dict[str, float]]:
    """The measures of a cell."""
    out: dict[str, dict[str, float]] = {}
    own, told = (found[way] for way in WAYS)
    for name, part in PARTS.items():
        a, b = (x["error"][:, part].mean(axis=1) for x in (own, told))
        out[name] = {
            **{way: float(x["error"][:, part].mean()) for way, x in found.items()},
            "ratio": float(b.mean() / a.mean()),
            "standard error": float((b - a).std(ddof=1) / np.sqrt(len(a)) / a.mean()),
        }
    for what in ("inside", "approximate"):
        out[what] = {way: float(x[what].mean()) for way, x in found.items()}
    return out


def of_real_logs() -> dict[str, dict[str, list[float]]]:
    """Mass and half-width [kg] of the real logs, either way."""
    folder, out = data(), {}
    for name, robot, log, tare in (
        ("UR10e with 2.805 kg, with its tare", "ur10e", "ur10e_loaded_2805g.csv", "ur10e_unloaded.csv"),
        ("UR10e with 2.805 kg", "ur10e", "ur10e_loaded_2805g.csv", None),
        ("UR10e, empty", "ur10e", "ur10e_unloaded.csv", None),
        ("Panda, empty", "panda", "panda_unloaded_1khz.csv", None),
    ):
        known = arm(robot)
        pair = [None if file is None else read_recording(folder / file, known) for file in (log, tare)]
        out[name] = {}
        for way in WAYS:
            run, empty = (x if x is None or way == "measured" else with_velocities_of_positions(x) for x in pair)
            assert run is not None
            answer = identify(run, known, tare=empty)
            out[name][way] = [answer.mass, float(answer.phi_high[0] - answer.phi_low[0]) / 2.0]
        say(f"{name}: {out[name]}")
    return out


def main() -> None:
    asked = options(__doc__, robots="panda,ur5e,gen3", logs=16, seed=40)
    cells: dict[str, dict[str, dict]] = {}
    for robot in asked.robots.split(","):
        cells[robot] = {}
        for every in THINNED:
            cells[robot][f"{RATE / every:g}"] = summary(answered(robot, asked.logs, asked.seed, every))
            say(f"{robot}, {RATE / every:g} Hz: {cells[robot][f'{RATE / every:g}']}")
    real = of_real_logs()
    write("without_velocities", {"logs": asked.logs, "seed": asked.seed, "cells": cells, "real": real})
    rows = [
        [
            robot,
            rate,
            *(f"{cell[name]['measured']:.3g}" for name in PARTS),
            *(f"{cell[name]['ratio']:.2f} ± {cell[name]['standard error']:.2f}" for name in PARTS),
            " · ".join(f"{100 * cell['inside'][way]:.0f}" for way in WAYS),
            " · ".join(f"{100 * cell['approximate'][way]:.0f}" for way in WAYS),
        ]
        for robot, of in cells.items()
        for rate, cell in of.items()
    ]
    columns = ["arm", "rate [Hz]", *PARTS, "ratio: mass", "first moments", "inertia", "inside [%]", "approximate [%]"]
    write_table(PAGE, "without velocities", markdown_table(columns, "lr" + 8 * "r", rows))
    of_real = [[name, *(f"{m:.3f} ± {half:.3f} kg" for m, half in of.values())] for name, of in real.items()]
    columns = ["log", "measured velocities", "of positions"]
    write_table(PAGE, "real without velocities", markdown_table(columns, "lrr", of_real))


if __name__ == "__main__":
    main()
