"""Our counterparts of the paper's Table I and Fig. 4 to 8: the numbers behind its tables and figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from armload.inertia import NAMES
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, Table, parameter_columns, short
from armload.lab.study.numbers import (
    EXACT,
    Answers,
    Cells,
    Ensemble,
    at_end,
    at_first,
    benchmark,
    both_stages,
    held_out,
    matched,
    mean_ratio,
)
from armload.lab.study.spec import NOMINAL, REAL, SEMI_REAL
from armload.lab.study.statements import izz
from armload.lab.study.study_tables import (
    BASELINES,
    COMMAND,
    LEAST_SQUARES,
    MISSING,
    NOT_YET,
    SPLITS,
    SPREAD,
    TRAINING_MEAN,
    Row,
    baselines_of,
    ensemble_shown,
    group_shown,
)
from armload.payloads import test_payload

RIVALS = ("rls", "rls-filter", "rls-filter-calibrated", "map", "same-prior")
SHOWN_ENSEMBLES = (("tree", "raw"), ("tree", "standard"), ("network", "raw"), ("network", "standard"))
_TIMES = (0.0, 0.5, 1.0, 2.0, 2.85, 3.0, 4.0, 5.0, 6.0)  # [s] of the table to Fig. 8


def test_payload_table() -> Table:
    """The role of Table I: the payload that is not in the training set."""
    phi = test_payload().parameters.phi
    row = ("test payload", *(short(SHOWN_SCALE * float(x)) for x in phi))
    note = "Ours: the paper's Table I is a picture without numbers in the text that is public. About the flange frame."
    return Table("Table I: the test payload", ("payload", *parameter_columns()), (row,), note)


test_payload_table.__test__ = False  # type: ignore[attr-defined]  # or pytest would take an imported one for a test


def training_rows(cells: Cells, stages: int) -> list[Row]:
    """Fig. 4 (single-stage) and 5 (two-stage): single samples on held-out rows, both splits."""
    rows: list[Row] = []
    for split, shown in SPLITS.items():
        for kind in ("tree", "network"):
            found = matched(cells, Ensemble(kind, stages, split))
            name = ensemble_shown(kind, most=found[0].cap if found else None)
            rows.append((f"{name}, {shown} held out", held_out(found[0].cells[0]) if found else None))
    return rows


def real_rows(cells: Cells) -> list[Row]:
    """Fig. 6: the test payload on the nominal arm, on real-like arms and on a real log; inertia from two stages."""
    rows: list[Row] = []
    for kind in ("tree", "network"):
        for protocol, shown in ((NOMINAL, "simulation"), (REAL, "real-like arms"), (SEMI_REAL, "real log")):
            found = both_stages(cells, kind, "row", protocol)
            rows.append((f"{_shown(kind, 'raw', found)}, {shown}", found and found.errors))
    return rows


def benchmark_rows(cells: Cells) -> list[Row]:
    """Fig. 7: ensembles and least squares, the test payload on real-like arms."""
    rows: list[Row] = []
    for kind, scale in SHOWN_ENSEMBLES:
        found = both_stages(cells, kind, "row", REAL, scale)
        rows.append((_shown(kind, scale, found), found and found.errors))
    rows += [(name, at_end(benchmark(cells, m), REAL)) for m, name in LEAST_SQUARES.items()]
    rows.append((TRAINING_MEAN, at_end(benchmark(cells, "training-mean", "row"), REAL)))
    return rows


def ratio_table(cells: Cells) -> Table:
    """Where the ensembles beat least squares: their errors over those of each method, parameter by parameter."""
    theirs = {LEAST_SQUARES[m]: at_end(benchmark(cells, m), REAL) for m in RIVALS}
    theirs[TRAINING_MEAN] = at_end(benchmark(cells, "training-mean", "row"), REAL)
    rows = []
    for kind, scale in SHOWN_ENSEMBLES:
        own = both_stages(cells, kind, "row", REAL, scale)
        if own is None or (kind, scale) == ("tree", "standard"):  # its errors are in Fig. 7
            continue
        for name, other in theirs.items():
            if other is not None:
                a, b = own.errors.mean(axis=0), other.mean(axis=0)
                each = [short(x / y, 2) if min(x, y) > EXACT else MISSING for x, y in zip(a, b, strict=True)]
                rows.append((_shown(kind, scale, own), name, *each, short(mean_ratio(a, b), 2)))
    note = (
        "Below 1 the ensemble errs less. Test payload on real-like arms, rows split at random, at the end of the run; "
        "all ten: geometric mean. Fig. 7 below has the errors and further methods. "
    )
    columns = ("ensemble", "against", *NAMES, "all ten")
    unmeasured = "" if rows else f"Not measured yet: `{COMMAND}` measures it."
    marked = tuple(k for k, row in enumerate(rows) if row[1] in BASELINES)
    title = "Error of the ensembles over that of least squares"
    return Table(title, columns, tuple(rows), (note + unmeasured).strip(), marked)


def first_table(cells: Cells) -> Table:
    """The first estimate of a run and the last, with their errors."""
    read = {"first": at_first, "end": at_end}
    mean = benchmark(cells, "training-mean", "row")
    blind = at_first(mean, REAL)
    wanted = [("first", NOMINAL), ("first", REAL), ("end", REAL)]
    rows = []
    for kind, scale in SHOWN_ENSEMBLES:
        found = [both_stages(cells, kind, "row", protocol, scale, read[when]) for when, protocol in wanted]
        rows.append((_shown(kind, scale, found[1]), [answers and answers.errors for answers in found]))
    named = {name: benchmark(cells, method) for method, name in LEAST_SQUARES.items()}
    for name, group in (named | {TRAINING_MEAN: mean}).items():
        rows.append((name, [read[when](group, protocol) for when, protocol in wanted]))
    filled = []
    for name, errors in rows:
        groups = [group_shown(e, part) for e in errors for part in GROUPS.values()]
        real, over = errors[1], MISSING
        if real is not None and blind is not None:
            over = short(mean_ratio(real.mean(axis=0), blind.mean(axis=0)), 2)
        filled.append((name, *groups, over))
    heads = [f"{g} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items()]
    columns = (
        "method",
        *(f"{w}: {h}" for w in ("first, nominal", "first, real-like", "end, real-like") for h in heads),
    )
    note = (
        "Test payload, rows split at random. First: the answer to the first sample of a run. Over the training mean: "
        "error of the first estimate on real-like arms over that of the training mean, geometric mean over the ten "
        f"parameters; below 1 the first sample helped. {SPREAD} {NOT_YET}"
    )
    return Table("First estimates", (*columns, "over the training mean"), tuple(filled), note, baselines_of(filled))


def _shown(kind: str, scale: str, found: Answers | None) -> str:
    return ensemble_shown(kind, scale, most=found and found.cap)


def curves(cells: Cells) -> dict[str, dict[str, Any]]:
    """Izz over time of one run on a real-like arm, by method; seed 0, two stages."""
    out = {}
    for kind in ("network", "tree"):
        found = matched(cells, Ensemble(kind, 2))
        if found:
            out[ensemble_shown(kind, most=found[0].cap)] = izz(found[0].cells[0][0])
    for method in ("rls", "rls-filter", "rls-filter-calibrated", "same-prior"):
        for cell in benchmark(cells, method):
            out.setdefault(LEAST_SQUARES[method], izz(cell))
    for cell in benchmark(cells, "training-mean", "row"):
        out.setdefault(TRAINING_MEAN, izz(cell))
    return {name: curve for name, curve in out.items() if curve is not None}


def izz_table(cells: Cells) -> Table:
    """Fig. 8 in numbers: running mean (ensembles) or estimate (least squares) of Izz over time, beside the truth."""
    shown = curves(cells)
    rows = []
    for name, curve in shown.items():
        if not rows:
            rows.append(("truth", *[short(SHOWN_SCALE * float(curve["truth"]))] * len(_TIMES)))
        at = [int(np.argmin(np.abs(curve["t"] - t))) for t in _TIMES]
        rows.append((name, *(short(SHOWN_SCALE * float(curve["running"][k])) for k in at)))
    heads = ("method", *(f"{t:g} s" for t in _TIMES))
    note = "One run on a real-like arm, seed 0: the running mean of an ensemble, the estimate of least squares. "
    note += "" if shown else f"Not measured yet: `{COMMAND}` measures it."
    return Table("Fig. 8: Izz over time [g·m²]", heads, tuple(rows), note.strip(), baselines_of(rows))
