"""The tables that settle what drives the result: one thing changed at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armload.evaluate import Table
from armload.evaluate.table import GROUPS, SHOWN_UNITS
from armload.study.numbers import Cell, Cells, Ensemble, at_end, benchmark, cap, matched
from armload.study.tables import (
    COMMAND,
    LEARNERS,
    MISSING,
    NOMINAL,
    NOT_YET,
    PROTOCOLS,
    REAL,
    SPLITS,
    cap_shown,
    errors_of,
    group_shown,
    stages_shown,
    value,
)

ABLATIONS = {
    "scale": "Inputs and outputs standardised, or in SI units",
    "time": "Without the time stamp",
    "torque": "Without torque: what the prior and the motion alone give",
    "members": "More members",
    "depth": "Depth of the trees against the size of their file",
    "sweep": "The hyper-parameters the paper set by trial and error",
    "sensors": "Trained on noise-free signals, or on signals with sensor noise",
}


def ablation_table(cells: Cells, ablation: str) -> Table:
    """The cells of an ablation beside the cells they differ from in one thing only."""
    own = [c for c in cells.values() if _belongs(c, ablation)]
    kept: dict[str, Cell] = {}
    for cell in own:
        kept |= {c["name"]: c for c in (*_references(cells, cell, ablation), cell)}
    order = sorted(kept.values(), key=lambda c: (c["spec"]["kind"], c["spec"]["split"], c["spec"]["stages"]))
    rows = [(_label(c), SPLITS[c["spec"]["split"]], cap_shown(cap(c)), *_six([c]), _size(c)) for c in order]
    if ablation == "torque" and own:
        for split in SPLITS:
            found = list(benchmark(cells, "training-mean", split).values())
            if found:
                rows.append(("training mean", SPLITS[split], "none", *_six(found), MISSING))
    heads = [f"{g} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items()]
    columns = ("method", "split", "epochs", *(f"{where}: {h}" for where in ("test rows", "real-like") for h in heads))
    note = "Seed 0. " + (NOT_YET if own else f"Not measured yet: `{COMMAND}` measures it.")
    baselines = tuple(k for k, row in enumerate(rows) if row[0] == "training mean")
    return Table(ABLATIONS[ablation], (*columns, "file [kB]"), tuple(rows), note, baselines)


def _belongs(cell: Cell, ablation: str) -> bool:
    spec = cell["spec"]
    if spec["kind"] not in ("tree", "network") or spec["seed"] != 0:
        return False
    if ablation == "sensors":
        return spec["sensors"] != "ideal" and spec.get("ablation") is None
    return spec.get("ablation") == ablation


def _references(cells: Cells, cell: Cell, ablation: str) -> list[Cell]:
    spec = cell["spec"]
    scale = "raw" if ablation == "scale" else spec["scale"]
    sensors = "ideal" if ablation == "sensors" else spec["sensors"]
    found = matched(cells, Ensemble(spec["kind"], spec["stages"], spec["split"], scale, sensors))
    alike = [match for match in found if match.cap == cap(cell) and 0 in match.seeds]
    return [match.cells[0][match.seeds.index(0)] for match in alike]


def _label(cell: Cell) -> str:
    spec = cell["spec"]
    parts = [LEARNERS[spec["kind"]], stages_shown(spec["stages"])]
    parts += ["standardised"] if spec["scale"] == "standard" else []
    parts += ["trained with sensor noise"] if spec["sensors"] != "ideal" else []
    parts += [f"without {signal}" for signal in spec.get("drop") or ()]
    parts += [f"depth ≤ {spec['max_depth']}"] if spec.get("max_depth") else []
    parts += [f"{spec['members']} members"] if spec.get("ablation") == "members" else []
    if spec.get("ablation") == "sweep":
        named = {"hidden": "{} units", "batch": "batch {}", "learning_rate": "learning rate {:g}"}
        parts += [text.format(spec[key]) for key, text in named.items() if spec.get(key) is not None]
    return ", ".join(parts)


def _six(group: Sequence[Cell]) -> list[str]:
    errors = errors_of(group)
    return [group_shown(errors(p), part) for p in ("held_out", REAL) for part in GROUPS.values()]


def _size(cell: Cell) -> str:
    return MISSING if not cell.get("file_bytes") else f"{cell['file_bytes'] / 1e3:.0f}"


def single_or_mean_table(cells: Cells) -> Table:
    """What averaging over a run brings: mean error of single samples, and of the running mean at the end."""
    rows = []
    for kind in ("tree", "network"):
        for stages in (1, 2):
            found = matched(cells, Ensemble(kind, stages))
            label = f"{LEARNERS[kind]}, {stages_shown(stages)}"
            for protocol in (NOMINAL, REAL):
                group = found[0].cells[0] if found else ()
                running = at_end(group, protocol)
                shown = [MISSING] * 6
                if running is not None:
                    single = np.mean([c["protocols"][protocol]["single"] for c in group], axis=0)
                    both = (single, running.mean(axis=0))
                    shown = [value(float(e[p].mean()), None) for p in GROUPS.values() for e in both]
                rows.append((label, PROTOCOLS[protocol], *shown))
    heads = [f"{g}: {what} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items() for what in ("single", "mean")]
    note = f"Rows split at random. Mean over runs and seeds. {NOT_YET}"
    return Table("Single samples against the running mean", ("method", "runs", *heads), tuple(rows), note)
