"""The tables that settle what drives the result: one thing changed at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armload.lab.report.shown import GROUPS, SHOWN_UNITS, Table
from armload.lab.study.numbers import Cell, Cells, Ensemble, at_end, benchmark, cap, matched
from armload.lab.study.spec import NOMINAL, REAL
from armload.lab.study.study_tables import (
    COMMAND,
    MISSING,
    NOT_YET,
    PROTOCOLS,
    SPLITS,
    SPREAD,
    TRAINING_MEAN,
    baselines_of,
    cap_shown,
    ensemble_shown,
    errors_of,
    group_shown,
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
_SHOWN = {"held_out": "test rows", REAL: "real-like"}
_ALSO_SHOWN = {"time": {"other_motion": "other motions"}}
_SIZES_SHOWN = ("members", "depth")
_SIGNALS = {"t": "the time stamp", "tau": "torque"}


def ablation_table(cells: Cells, ablation: str) -> Table:
    """The cells of an ablation, each below the cell it differs from in one thing only, with the same cap on epochs."""
    own = [c for c in cells.values() if _belongs(c, ablation)]
    kept: dict[str, Cell] = {}
    for cell in own:
        kept |= {c["name"]: c for c in (*_references(cells, cell, ablation), cell)}
    protocols = _SHOWN | _ALSO_SHOWN.get(ablation, {})
    sized = ablation in _SIZES_SHOWN
    rows = []
    for c in sorted(kept.values(), key=lambda c: _order(c, _belongs(c, ablation))):
        labels = (_label(c, ablation), SPLITS[c["spec"]["split"]], cap_shown(cap(c)))
        rows.append((*labels, *_errors([c], protocols), *([_size(c)] * sized)))
    if ablation == "torque" and own:
        for split, shown in SPLITS.items():
            if found := benchmark(cells, "training-mean", split):
                rows.append((TRAINING_MEAN, shown, "none", *_errors(found[:1], protocols)))
    heads = [f"{g} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items()]
    columns = ("method", "split", "epochs", *(f"{where}: {h}" for where in protocols.values() for h in heads))
    columns += ("file [kB]",) * sized
    note = f"Seed 0. {SPREAD} {NOT_YET}" if own else f"Not measured yet: `{COMMAND}` measures it."
    return Table(ABLATIONS[ablation], columns, tuple(rows), note, baselines_of(rows))


def compared(cells: Cells, ablation: str) -> list[tuple[Cell, Cell]]:
    """Pairs of cells that differ in what the ablation changes, and in nothing else: as it was, changed."""
    own = sorted((c for c in cells.values() if _belongs(c, ablation)), key=lambda c: _order(c, own=True))
    return [(reference, cell) for cell in own for reference in _references(cells, cell, ablation)]


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


def _order(cell: Cell, own: bool) -> tuple[Any, ...]:
    """Trees first, the paper's split first, the larger cap first; what is compared with above what is compared."""
    spec = cell["spec"]
    settings = (spec.get("max_depth") or 0, spec.get("hidden", 0), spec.get("batch", 0), spec.get("learning_rate", 0.0))
    kind, split = ("tree", "network").index(spec["kind"]), list(SPLITS).index(spec["split"])
    return kind, split, spec["stages"], -(cap(cell) or 0), own, *settings, cell["name"]


def _label(cell: Cell, ablation: str) -> str:
    spec = cell["spec"]
    parts = [ensemble_shown(spec["kind"], spec["scale"], stages=spec["stages"])]
    parts += ["trained with sensor noise"] if spec["sensors"] != "ideal" else []
    parts += [f"without {_SIGNALS[signal]}" for signal in spec.get("drop") or ()]
    parts += [f"depth ≤ {spec['max_depth']}"] if spec.get("max_depth") else []
    parts += [f"{spec['members']} members"] if ablation == "members" else []
    if ablation == "sweep":
        named = {"hidden": "{} units", "batch": "batches of {}", "learning_rate": "learning rate {:g}"}
        parts += [text.format(spec[key]) for key, text in named.items() if spec.get(key) is not None]
    return ", ".join(parts)


def _errors(group: Sequence[Cell], protocols: dict[str, str]) -> list[str]:
    errors = errors_of(group)
    return [group_shown(errors(protocol), part) for protocol in protocols for part in GROUPS.values()]


def _size(cell: Cell) -> str:
    return MISSING if not cell.get("file_bytes") else f"{cell['file_bytes'] / 1e3:.0f}"


def single_or_mean_table(cells: Cells) -> Table:
    """What averaging over a run brings: mean error of single samples, and of the running mean at the end."""
    rows = []
    for kind in ("tree", "network"):
        for stages in (1, 2):
            found = matched(cells, Ensemble(kind, stages))
            label = ensemble_shown(kind, stages=stages, most=found[0].cap if found else None)
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
