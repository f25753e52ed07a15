"""How far a log's evidence can be trusted: what its traits tell, what they leave open, and what summing over that does.

    python benchmarks/trust.py [--arms panda,gen3,ur10e] [--episodes 240] [--seed 3000] [--work DIR]

New episodes of `broad`, answered by the shipped hybrids with their tares or without, as they were drawn:

left        standard deviation [decades] of log10 kappa about what the traits tell, of the rows that tell a parameter
            well; what the chance of few squares adds is taken off
by traits   kappa is what the traits tell (`left_open` = 0)
summed      the factor that is left open is summed over (`Calibration.posterior`), as shipped
counts      the same with other powers in the place of `_COUNTS`

error       mean absolute error of mass [g] · first moments [g·m] · inertia [g·m²]
more        paired difference of the errors, summed less by traits, ± its standard error
inside      share of the true values inside the 95 % intervals [%]; width: mean half-width over mean error

Written to benchmarks/results/trust.json and a table of docs/hybrid_measured.md. A second of one core for each episode;
--work keeps what was measured.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, polygamma
from script import ROOT, markdown_table, options, say, write, write_table
from wide_and_light import records_of

from armload import Arm, arm
from armload.inertia import Z95
from armload.lab.training import Records
from armload.lab.training.calibrating import overrating
from armload.posterior import HybridModel, calibration, shipped_model

TIMES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 3.0, 6.0)  # [s]
SHOWN = (0.02, 0.1, 0.5, 1.0, 6.0)
POWERS = (0.5, 0.7, 1.0)
GROUPS = {"mass": slice(0, 1), "moment": slice(1, 4), "inertia": slice(4, 10)}
LEAST = 1e-3  # of a mean square: as in training


def left(model: HybridModel, records: Records) -> float | None:
    """Standard deviation of log10 kappa about what the traits tell; None: no row tells a parameter well."""
    target, directions = overrating(records, model.prior)
    keep = np.isfinite(target)
    half = 0.5 * directions[keep]
    told = np.log10([model.calibration.kappa(traits) for traits in records.traits[keep]])
    off = np.log10(np.maximum(target[keep], LEAST)) - (digamma(half) - np.log(half)) / np.log(10.0) - told
    chance = np.mean(polygamma(1, half)) / np.log(10.0) ** 2
    return round(float(np.sqrt(max(np.var(off) - chance, 0.0))), 2) if keep.sum() > 1 else None


def answers(robot: Arm, model: HybridModel, records: Records) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """|error| and half-width (N, 10)."""
    prior, error, half = model.prior_for(robot), np.empty((len(records), 10)), np.empty((len(records), 10))
    for k in range(len(records)):
        found = model.calibration.answer(records.evidence(k), prior)
        error[k] = np.abs(found.mean - records.truth[k])
        half[k] = Z95 * np.sqrt(np.diag(found.covariance))
    return error, half


def cell(error: NDArray[np.float64], half: NDArray[np.float64]) -> dict[str, list[float]]:
    """What is said of the rows of one time, by group."""
    inside, parts = error <= half, GROUPS.values()
    return {
        "error": [round(1e3 * float(error[:, part].mean()), 3) for part in parts],
        "inside": [round(float(inside[:, part].mean()), 4) for part in parts],
        "width": [round(float(np.mean(half[:, p].mean(axis=0) / error[:, p].mean(axis=0))), 2) for p in parts],
    }


def measured(name: str, asked: Any) -> list[dict[str, Any]]:
    """A line for each time."""
    robot = arm(name)
    model, records = shipped_model(robot), records_of(robot, f"trust-{name}", asked, TIMES)
    alone = replace(model, calibration=replace(model.calibration, left_open=0.0))
    found, shipped = {"by traits": answers(robot, alone, records)}, calibration._COUNTS
    for power in POWERS:
        calibration._COUNTS = power  # read at each answer
        found[f"counts {power:g}"] = answers(robot, model, records)
    calibration._COUNTS = shipped
    found["summed"] = found[f"counts {shipped:g}"]
    out = []
    for t in TIMES:
        rows = np.abs(np.log(records.t / t)) < 0.2
        line: dict[str, Any] = {"arm": name, "t": t, "rows": int(rows.sum())}
        line["left"] = left(alone, records.select(rows))
        line |= {what: cell(error[rows], half[rows]) for what, (error, half) in found.items()}
        more = 1e3 * (found["summed"][0][rows] - found["by traits"][0][rows])
        each = [more[:, part].mean(axis=1) for part in GROUPS.values()]
        line["more"] = [[round(float(x.mean()), 3), round(float(x.std(ddof=1) / np.sqrt(len(x))), 3)] for x in each]
        out.append(line)
        say(f"{name} {t:g} s  left {line['left']}  {line['by traits']['error']} → {line['summed']['error']}")
    return out


def table(lines: list[dict[str, Any]]) -> str:
    """The lines of `SHOWN` as Markdown."""
    rows = []
    for line in (x for x in lines if x["t"] in SHOWN):
        shown = [(f"{x[0]:.0f} · {x[1]:.1f} · {x[2]:.2f}") for x in (line[w]["error"] for w in ("by traits", "summed"))]
        more = " · ".join(f"{mean:+.{d}f} ± {se:.{d}f}" for (mean, se), d in zip(line["more"], (0, 1, 2), strict=True))
        of = [
            " · ".join(f"{100 * x:.0f}" if key == "inside" else f"{x:.1f}" for x in line[what][key])
            for key, what in product(("inside", "width"), ("by traits", "summed"))
        ]
        rows.append(
            (line["arm"], f"{line['t']:g} s", "–" if line["left"] is None else f"{line['left']:.2f}", *shown, more, *of)
        )
    head = ("arm", "after", "left", "error by traits", "summed", "more", "inside by traits [%]", "summed")
    return markdown_table((*head, "width by traits", "summed"), "lr" + 8 * "r", rows)


def main() -> None:
    asked = options(__doc__, arms="panda,gen3,ur10e", episodes=240, seed=3000, work="")
    lines = [line for name in asked.arms.split(",") for line in measured(name, asked)]
    write("trust", {"population": "broad", "seed": asked.seed, "episodes": asked.episodes, "lines": lines}, indent=None)
    write_table(ROOT / "docs" / "hybrid_measured.md", "trust", table(lines))


if __name__ == "__main__":
    main()
