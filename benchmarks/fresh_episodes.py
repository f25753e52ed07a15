"""The shipped hybrid on episodes that no training, calibration or cross-validation has touched: intervals and errors.

    python benchmarks/fresh_episodes.py [--robot panda] [--episodes 2000] [--jobs 2] [--work out/fresh-panda]

Intervals: the cross-validation that `armload train` prints sets each quarter's widths on the other three, so that its
shares lie near 95 % whatever the luck of the draw. Here the finished model answers new episodes of `broad`, of another
seed. Errors: beside those of its own physics with the weak prior (`map-gp`), of least squares with the same prior as
one Gaussian, and of the mean of all payloads; for all episodes, for each kind of world, for a known family of payloads
and by weight; the differences are paired, ± their standard error, an episode being one observation.

Writes benchmarks/results/fresh_episodes_ROBOT.json and, of the Panda, a table of docs/hybrid_measured.md. About a
second of one core for each episode; goes on from --work.
"""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import numpy as np
from hybrid_ablation import GROUPS, by_tare_and_time, gaussian
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, write, write_table

from armload import Arm, arm
from armload.app.cli.printing import console
from armload.app.cli.progress import progress_shown
from armload.app.cli.train_hybrid import LEARNING, cells_table, summary
from armload.lab.training import Records
from armload.lab.training.coverage import coverage_on
from armload.lab.training.hybrid import CHUNK, draw_chunk, episode_records
from armload.posterior import HybridModel, shipped_model
from armload.regression import solution_prior_std

SEED = 1  # trainings have seed 0
COMPARED = ("its physics, map-gp", "same-prior least squares", "predict the mean")
LIGHT = 0.2  # [kg]
SHOWN = (
    ("tare", "all", "with a tare"),
    ("tare", "world: real-like", "arms like the measured ones"),
    ("tare", "world: beyond", "arms beyond them"),
    ("tare", "world: beyond, motor side", "torque of the motor's side"),
    ("tare", "payload: container", "the container"),
    ("no tare", "all", "as if without a tare"),
)


def errors(robot: Arm, model: HybridModel, records: Records) -> dict[str, NDArray[np.float64]]:
    """|error| (N, 10) of the hybrid and of what it is compared with."""
    prior = model.prior_for(robot)
    one, weak = gaussian(prior), np.diag(solution_prior_std(robot) ** -2)
    found = {name: np.empty((len(records), 10)) for name in ("hybrid", *COMPARED)}
    for k in range(len(records)):
        evidence = records.evidence(k)
        found["hybrid"][k] = model.calibration.answer(evidence, prior).mean
        found[COMPARED[0]][k] = np.linalg.solve(evidence.information + weak, evidence.vector)
        found[COMPARED[1]][k] = one.posterior(evidence.information, evidence.vector).mean
    found[COMPARED[2]][:] = records.truth.mean(axis=0)
    return {name: np.abs(phi - records.truth) for name, phi in found.items()}


def compared(error: dict[str, NDArray[np.float64]], records: Records, families: NDArray[np.str_]) -> list[dict]:
    """Mean errors of every row, and how far the others are above the hybrid, subset by subset and time by time."""
    family, mass = families[records.episode], records.truth[:, 0]
    everything = np.ones(len(records), dtype=bool)
    subsets = {"all": everything}
    subsets |= {f"world: {g.removeprefix('broad ')}": records.group == g for g in np.unique(records.group)}
    subsets |= {f"payload: {name}": family == name for name in np.unique(family)}
    subsets |= {f"below {LIGHT} kg": mass < LIGHT, f"{LIGHT} kg and above": mass >= LIGHT}
    out = []
    for subset, rows in subsets.items():
        for named, cell in by_tare_and_time(records):
            cell = cell & rows
            line: dict = {"subset": subset, **named, "episodes": int(cell.sum())}
            for group, part in GROUPS.items():
                own = 1e3 * error["hybrid"][cell][:, part].mean(axis=1)
                line[group] = {"hybrid": round(float(own.mean()), 3)}
                for name in COMPARED:
                    more = 1e3 * error[name][cell][:, part].mean(axis=1) - own
                    line[group][name] = round(float((own + more).mean()), 3)
                    line[group][f"{name}, more"] = round(float(more.mean()), 3)
                    line[group][f"{name}, more, se"] = round(float(more.std(ddof=1) / np.sqrt(len(more))), 3)
            out.append(line)
    return out


def verdicts(lines: list[dict]) -> dict[str, int]:
    """In how many comparisons the hybrid is ahead by two standard errors, behind by as much, or neither."""
    score = [
        line[group][f"{name}, more"] / line[group][f"{name}, more, se"]
        for line in lines
        for group in GROUPS
        for name in COMPARED
    ]
    ahead, behind = sum(s > 2.0 for s in score), sum(s < -2.0 for s in score)
    return {"ahead": ahead, "behind": behind, "neither": len(score) - ahead - behind}


def sentence(verdict: dict[str, int]) -> str:
    """The same in words."""
    return (
        f"Of {sum(verdict.values())} comparisons (kinds of world and payload, with and without a tare, seven times, "
        f"three groups of\nparameters, three other rows: `benchmarks/results/fresh_episodes_panda.json`) the hybrid is "
        f"ahead by more than two\nstandard errors of the paired difference in {verdict['ahead']}, behind by as much in "
        f"{verdict['behind']}."
    )


def table(lines: list[dict]) -> str:
    """Mean errors [g · g·m · g·m²] of the rows that docs/hybrid_measured.md shows, as Markdown."""
    out = []
    for what, subset, title in SHOWN:
        cells = [
            next(line for line in lines if (line["what"], line["subset"], line["t"]) == (what, subset, t))
            for t in (0.1, 1.0, 6.0)
        ]
        for name in ("hybrid", *COMPARED):
            errors = [[cell[group][name] for group in GROUPS] for cell in cells]
            shown = (f"{mass:.0f} · {moment:.1f} · {inertia:.2f}" for mass, moment, inertia in errors)
            out.append((f"{title}, {cells[1]['episodes']}" if name == "hybrid" else "", name, *shown))
    return markdown_table(("episodes", "answered by", "0.1 s", "1 s", "6 s"), "lllll", out)


def new_records(robot: Arm, asked: Namespace) -> Records:
    """Those of the episodes that nothing was trained on; both scripts that look at them go on from the same folder."""
    work = Path(asked.work or f"out/fresh-{robot.name}")
    with progress_shown("episode", LEARNING) as progress:
        return episode_records(
            robot, episodes=asked.episodes, seed=SEED, folder=work, jobs=asked.jobs, progress=progress
        )


def main() -> None:
    asked = options(__doc__, robot="panda", episodes=2000, jobs=2, work="")
    robot = arm(asked.robot)
    model, records = shipped_model(robot), new_records(robot, asked)
    found = coverage_on(records, model.prior_for(robot), model.calibration)
    console().print(cells_table(found))
    print(f"pooled: {100 * found.pooled:.1f} %")
    chunks = ((first, min(CHUNK, asked.episodes - first)) for first in range(0, asked.episodes, CHUNK))
    drawn = [episode for chunk in chunks for episode in draw_chunk(robot, "broad", SEED, *chunk)]
    families = np.array([episode.payload.name.split()[0] for episode in drawn])
    lines = compared(errors(robot, model, records), records, families)
    verdict = verdicts(lines)
    print(sentence(verdict))
    result = {
        "population": "broad",
        "seed": SEED,
        "trained": {key: getattr(model.training, key) for key in ("population", "episodes", "seed")},
        **summary(robot, found),
        "errors": lines,
        "verdicts": verdict,
    }
    write(f"fresh_episodes_{robot.name}", result, indent=None)
    if robot.name == "panda":
        write_table(ROOT / "docs" / "hybrid_measured.md", "new episodes", table(lines) + "\n\n" + sentence(verdict))


if __name__ == "__main__":
    main()
