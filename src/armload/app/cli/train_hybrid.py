"""`armload train --method hybrid`: the learned parts of the hybrid for any arm, from episodes simulated here."""

from __future__ import annotations

import argparse
import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.app.cli.printing import console, print_json, print_note, table, write_json
from armload.app.cli.progress import progress_shown

if TYPE_CHECKING:
    from rich.table import Table as RichTable

    from armload.arms import Arm
    from armload.lab.training import Coverage

LEARNING = "learning from the episodes, and checking on those left out"
_WORST, _FEWEST = 3, 20  # cells named; episodes that one must rest on


def run(options: argparse.Namespace) -> None:
    """Simulate what is missing, learn, say how well the intervals held, save the model."""
    import joblib

    from armload.arms import arm
    from armload.lab.engine import engine
    from armload.lab.training import train_hybrid
    from armload.lab.training.hybrid import EPISODES, versions
    from armload.posterior.model_file import ENOUGH

    robot = arm(options.robot, options.frame)
    episodes, jobs = options.episodes or EPISODES, options.jobs or joblib.cpu_count()
    work = Path(options.work or f"out/hybrid-{robot.name}")
    out = Path(options.out or f"out/hybrid-{robot.name}.safetensors")
    resumed = any(work.glob("episodes-*.npz"))
    print_note(
        f"training a hybrid for {robot.name} about {robot.frame}: {episodes} episodes, {jobs} at a time, "
        f"{'going on from' if resumed else 'kept in'} {work}"
    )
    began = time.perf_counter()
    with progress_shown("episode", LEARNING) as progress, engine(jobs, options.cluster) as on:
        model, coverage = train_hybrid(
            robot, episodes=episodes, seed=options.seed, folder=work, progress=progress, on=on
        )
    model.save(out)
    report = {
        "command": _command(options, episodes),
        "seeds": [options.seed],
        **summary(robot, coverage),
        "versions": versions(),
        "jobs": jobs,
        "resumed": resumed,
        "wall_s": round(time.perf_counter() - began, 1),
    }
    if options.report:
        write_json(options.report, report, indent=1)
    if not model.calibrated:
        few = f"{episodes} episodes are too few to set the widths by, expected {ENOUGH} or more"
        missed = f"{100 * coverage.pooled:.1f} % is not the 95 % that was asked for"
        print_note(
            f"{few if episodes < ENOUGH else missed}: `armload identify` will call the intervals of this model "
            f"approximate; train on more than {episodes} episodes"
        )
    if options.json:
        print_json(report | {"out": str(out)})
        return
    console().print(cells_table(coverage))
    print("\n".join(summary_lines(coverage)))
    frame = "" if options.frame is None else f" --frame {options.frame}"
    print(f"wrote {out}; use it with: armload identify LOG --robot {options.robot}{frame} --method {out}")


def _command(options: argparse.Namespace, episodes: int) -> str:
    """What gives the same model again."""
    words = ["armload", "train", "--method", "hybrid", "--robot", options.robot, "--episodes", str(episodes)]
    words += ["--seed", str(options.seed)] + ([] if options.frame is None else ["--frame", options.frame])
    return shlex.join(words)


def summary(robot: Arm, coverage: Coverage) -> dict[str, Any]:
    """What the intervals were found to be worth, ready for JSON; null where no episode was."""
    return {
        "robot": robot.name,
        "frame": str(robot.frame),
        "episodes": coverage.episodes,
        "pooled": round(coverage.pooled, 4),
        **coverage.table(),
    }


def cells_table(coverage: Coverage) -> RichTable:
    """Share of held-out truths inside their interval: a row for each kind of comparison and time."""
    import numpy as np

    from armload.inertia import NAMES
    from armload.lab.training.records import TIMES
    from armload.posterior.evidence import KINDS

    rows = table(
        "share of held-out truths inside their 95 % interval [%]",
        "compared with",
        "after",
        "episodes",
        *NAMES,
        "half-width / error",
        left=1,
    )
    for kind, name in enumerate(KINDS):
        for b, t in enumerate(TIMES):
            cells, ratio = coverage.cells[kind, b], coverage.ratio[kind, b]
            if not np.isnan(cells).all():
                shown = [f"{100 * share:.1f}" for share in cells]
                rows.add_row(
                    name, f"{t:g} s", str(coverage.counts[kind, b]), *shown, f"{ratio.min():.1f}–{ratio.max():.1f}"
                )
        rows.add_section()
    return rows


def summary_lines(coverage: Coverage) -> list[str]:
    """The pooled coverage, the cells where it is lowest and those where the intervals are widest, in words.

    Cells of a few episodes are left out: their share says nothing.
    """
    import numpy as np

    few = coverage.counts[..., None] < _FEWEST
    lines = [
        f"pooled coverage {100 * coverage.pooled:.1f} % on {coverage.episodes} episodes, each answered by a model that "
        "had not seen it (cross-validated)"
    ]
    for what, values, unit, sign in (
        ("lowest coverage", 100 * coverage.cells, " %", 1.0),
        ("widest intervals, mean half-width over mean absolute error", coverage.ratio, "", -1.0),
    ):
        values = np.where(few, np.nan, values)
        order = np.argsort(sign * values, axis=None)[: min(_WORST, int(np.isfinite(values).sum()))]
        named = [f"{values.flat[k]:.1f}{unit} {_cell(np.unravel_index(k, values.shape))}" for k in order]
        if named:
            lines.append(f"{what}: {', '.join(named)}")
    return lines


def _cell(where: Any) -> str:
    from armload.inertia import NAMES
    from armload.lab.training.records import TIMES
    from armload.posterior.evidence import KINDS

    kind, b, k = (int(x) for x in where)
    return f"({NAMES[k]}, {TIMES[b]:g} s, {KINDS[kind]})"
