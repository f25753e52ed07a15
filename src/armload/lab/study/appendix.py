"""Tables of the study's appendix beyond methods and protocols: what is implied, averaged over time, tuned."""

from __future__ import annotations

import numpy as np

from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, Table, short
from armload.lab.study.findings import baseline_wins, implied_ratios
from armload.lab.study.multiverse import Multiverse
from armload.lab.study.numbers import READING, Cells, cap
from armload.lab.study.study_tables import (
    COMMAND,
    LEARNERS,
    LEAST_SQUARES,
    MISSING,
    NOT_YET,
    cap_shown,
    ensemble_shown,
    group_shown,
)


def further_tables(cells: Cells) -> tuple[Table, ...]:
    """All of them."""
    multiverse = Multiverse(cells)
    return implied_table(multiverse), wins_table(multiverse), averaged_table(cells), settings_table(cells)


def implied_table(multiverse: Multiverse) -> Table:
    """Ratios that follow from two percentages of Fig. 7."""
    rows = tuple(
        (i.ratio, i.parameter, short(i.paper), short(i.ours) if np.isfinite(i.ours) else MISSING)
        for i in implied_ratios(multiverse)
    )
    note = (
        "The rivals' own ratios do not depend on an ensemble: where two rows of one parameter differ in the paper, it "
        "contradicts itself. Trees over networks on the real robot above 1 is the reverse of its verdict on simulated "
        f"data. {NOT_YET}"
    )
    columns = ("ratio of errors", "parameter", "paper", "ours")
    return Table("Ratios that Fig. 7 implies", columns, rows, note)


def wins_table(multiverse: Multiverse) -> Table:
    """Where the paper names no improvement, so that its rival is no worse."""
    rows = []
    for win in baseline_wins(multiverse):
        ours = MISSING
        if win.ours is not None:
            bounds = "" if win.ours.low is None else f" [{win.ours.low:.0f}, {win.ours.high:.0f}]"
            ours = f"{win.ours.value:.0f}{bounds}"
        rows.append((LEARNERS[win.learner], LEAST_SQUARES[win.rival], win.parameter, ours))
    columns = ("ensemble", "rival", "parameter", "ours: ensemble better by [%]")
    note = f"By Fig. 7 the rival is no worse on these. Below zero ours says so, too. {NOT_YET}"
    return Table("Where the paper's rivals stay ahead", columns, tuple(rows), note)


def averaged_table(cells: Cells) -> Table:
    """Held-out payloads: error of single samples, and of the answer averaged over the payload's run."""
    rows = []
    for cell in cells.values():
        spec = cell["spec"]
        if spec.get("ablation") == READING and spec["split"] == "payload":
            found = cell["protocols"]["held_out"]
            label = ensemble_shown(spec["kind"], spec["scale"], stages=spec["stages"])
            errors = (np.array(found[name], dtype=float) for name in ("payloads", "averaged"))
            shown = [group_shown(e, part) for e in errors for part in GROUPS.values()]
            rows.append((label, cap_shown(cap(cell)), str(len(found["payloads"])), *shown))
    heads = [f"{g} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items()]
    columns = ("method", "epochs", "payloads", *(f"{when}: {h}" for when in ("single", "averaged") for h in heads))
    note = (
        f"± is the standard deviation over the payloads. {NOT_YET}" if rows else f"Not measured yet: `{COMMAND}` does."
    )
    return Table("Payloads held out: single samples, and averaged over time", columns, tuple(sorted(rows)), note)


def settings_table(cells: Cells) -> Table:
    """Every rival with its setting and its errors on the nominal arm and on real-like arms."""
    rows, runs = [], [0, 0]
    for cell in cells.values():
        spec = cell["spec"]
        if spec["kind"] == "rival":
            setting = cell["setting"]
            labels = (
                spec["derivative"] + ", calibrated" * spec["calibrated"] + ", tuned" * spec["tuned"],
                str(spec["rate"]),
                spec["sensors"],
                f"{setting['value']:g}" if setting["value"] else MISSING,
                f"{setting['forgetting']:g}",
            )
            errors = [np.array(part["second_half"], dtype=float) for part in cell["protocols"].values()]
            runs = [len(e) for e in errors]
            shown = [short(SHOWN_SCALE * float(e[:, part].mean())) for e in errors for part in GROUPS.values()]
            rows.append((*labels, *shown))
    heads = [f"{g} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items()]
    columns = ("method", "rate [Hz]", "noise", "setting", "forgetting")
    columns += tuple(f"{where}: {h}" for where in ("nominal", "real-like") for h in heads)
    note = (
        f"Setting: gain of the observer [1/s], half the window [s] or cut-off [Hz]. {runs[0]} runs on the nominal arm, "
        f"{runs[1]} on real-like arms. {NOT_YET}"
    )
    note = note if rows else f"Not measured yet: `{COMMAND}` does."
    return Table("Every rival", columns, tuple(sorted(rows)), note)
