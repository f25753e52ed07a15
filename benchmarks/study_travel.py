"""Which of the paper's claims travel: its protocol on a second arm and with a second family of payloads.

    python benchmarks/study_travel.py [--rows 811] [--cap 14] [--minutes 60] [--work out/study-travel]

The study's own code (`armload.lab.study`) measures the same cells three times: the Panda with the container, as the
paper; the UR10e, whose torque is motor current, with the container; and the Panda with 77 random boxes, in whose
inertia nothing is zero. Trees and networks in SI units, one stage and two, rows and payloads held out, on 30 real-like
arms; RLS and filtered RLS at 540 Hz as in the paper's Fig. 7. Each run has a quarter of the paper's rows, and networks
stop after 14 epochs as scikit-learn's do: all three alike, so that only arm and payloads differ.

Writes benchmarks/results/study_travel.json, every distinct percentage of the paper in each setting; goes on from
--work.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from script import ROOT, options, say, write

from armload.lab.experiment import Cells, Task, run_tasks
from armload.lab.study.basis import FULL, Basis
from armload.lab.study.claims import direction, load_claims
from armload.lab.study.multiverse import USUAL, Multiverse
from armload.lab.study.numbers import READING, RIVAL_OF, on_many_arms
from armload.lab.study.readings import basis_of_readings, measured_reading
from armload.lab.study.rivals import rival_tasks
from armload.lab.study.spec import Spec
from armload.lab.study.statements import RULES

SETTINGS = {  # arm and payloads
    "Panda, container": ("panda", "container"),
    "UR10e, container": ("ur10e", "container"),
    "Panda, boxes": ("panda", "boxes"),
}
STATEMENTS = ("trees-better", "real-close-tree", "real-close-network", "b-surpasses-a")


def basis_of(folder: Path, setting: str, rows: int) -> Basis:
    """The study's basis of a setting."""
    robot, payloads = SETTINGS[setting]
    name = f"{robot}-{payloads}-{rows}"
    return Basis(folder / name, replace(FULL, rows=rows), robot=robot, payloads=payloads)


def tasks(basis: Basis, cap: int) -> list[Task]:
    """The cells of a setting: trees, least squares, networks."""
    on = basis_of_readings(basis)

    def trained(kind: str) -> list[Task]:
        usual = Spec(kind, ablation=READING) if kind == "tree" else Spec(kind, max_epochs=cap, ablation=READING)
        specs = [replace(usual, split=split, stages=stages) for split in ("row", "payload") for stages in (1, 2)]
        return [Task.of_one(s.name, s.key(on.fingerprint), measured_reading, s, on.rests_on) for s in specs]

    rivals = rival_tasks(basis)[0]  # at the study's rate, with the arm's own noise
    plain = {name: key for name, key in rivals.keys.items() if name in (RIVAL_OF["rls"], RIVAL_OF["rls-filter"])}
    return [*trained("tree"), replace(rivals, keys=plain), *trained("network")]


def said(cells: Cells) -> dict[str, dict[str, Any]]:
    """Every distinct percentage with its interval and direction, and some statements, from the cells of a setting."""
    multiverse, many, out = Multiverse(cells), on_many_arms(cells), {}
    for claim in load_claims():
        if claim["id"] in STATEMENTS:
            rows = {s: RULES[claim["rule"]].measure(many, claim.get("learner"), s) for s in ("row", "payload")}
            out[claim["id"]] = {s: None if m is None else [m.value, m.bounds, m.holds] for s, m in rows.items()}
        if claim["parameter"] is None or claim["repeats"]:
            continue
        found = {s: multiverse.improvement(claim, USUAL._replace(split=s)) for s in ("row", "payload")}
        out[claim["id"]] = {
            split: None if one is None else [round(one.value, 2), [one.low, one.high], direction(one)]
            for split, one in found.items()
        }
    return out


def main() -> None:
    asked = options(__doc__, rows=811, cap=14, minutes=60.0, work="out/study-travel")
    found, missing = {}, []
    for setting in SETTINGS:
        basis = basis_of(ROOT / asked.work, setting, asked.rows)
        todo = tasks(basis, asked.cap)
        cells = run_tasks(todo, basis.folder / "cells", until=60.0 * asked.minutes, say=say)
        missing += [f"{setting}: {name}" for task in todo for name in task.keys if name not in cells]
        found[setting] = {
            "motion": basis.motion.name,
            "cost_s": round(sum(cell["wall_s"] for cell in cells.values()), 1),
            "claims": said(cells),
        }
    write("study_travel", {"rows": asked.rows, "cap": asked.cap, "missing": missing, "settings": found}, indent=None)


if __name__ == "__main__":
    main()
