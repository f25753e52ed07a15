"""Our counterparts of the paper's Table I and Fig. 4 to 8: the numbers behind its tables and figures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.evaluate import Table
from armload.evaluate.table import SHOWN_SCALE, parameter_columns, short
from armload.payloads import test_payload
from armload.study.numbers import Cells, Ensemble, at_end, benchmark, held_out, matched
from armload.study.statements import izz
from armload.study.tables import COMMAND, LEARNERS, LEAST_SQUARES, MISSING, NOMINAL, REAL, SEMI_REAL, SPLITS, Row

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
        rows += [(f"{LEARNERS[k]}, {shown} held out", _best(cells, k, stages, split)) for k in ("tree", "network")]
    return rows


def real_rows(cells: Cells) -> list[Row]:
    """Fig. 6: the test payload on the nominal arm, on real-like arms and on a real log; inertia from two stages."""
    rows: list[Row] = []
    for kind in ("tree", "network"):
        for protocol, shown in ((NOMINAL, "simulation"), (REAL, "real-like arms"), (SEMI_REAL, "real log")):
            rows.append((f"{LEARNERS[kind]}, {shown}", best_of_stages(cells, kind, "row", protocol)))
    return rows


def benchmark_rows(cells: Cells) -> list[Row]:
    """Fig. 7: ensembles and least squares with the test payload on real-like arms."""
    rows: list[Row] = [(LEARNERS[k], best_of_stages(cells, k, "row", REAL)) for k in ("network", "tree")]
    rows += [(name, at_end(list(benchmark(cells, m).values()), REAL)) for m, name in LEAST_SQUARES.items()]
    return [*rows, ("training mean", at_end(list(benchmark(cells, "training-mean", "row").values()), REAL))]


def best_of_stages(cells: Cells, kind: str, split: str, protocol: str) -> NDArray[np.float64] | None:
    """Errors (R, 10) at the end of runs: mass and first moments from one stage, inertia from two."""
    found = matched(cells, Ensemble(kind, 1, split), Ensemble(kind, 2, split))
    if not found:
        return None
    one, two = (at_end(group, protocol) for group in found[0].cells)
    return None if one is None or two is None else np.concatenate([one[:, :4], two[:, 4:]], axis=1)


def _best(cells: Cells, kind: str, stages: int, split: str) -> NDArray[np.float64] | None:
    found = matched(cells, Ensemble(kind, stages, split))
    return held_out(found[0].cells[0]) if found else None


def curves(cells: Cells) -> dict[str, dict[str, Any]]:
    """Izz over time of one run on a real-like arm, by method; seed 0, two stages."""
    out = {}
    for kind in ("network", "tree"):
        found = matched(cells, Ensemble(kind, 2))
        if found:
            out[LEARNERS[kind]] = izz(found[0].cells[0][0])
    for method in ("rls", "rls-filter", "rls-filter-calibrated", "same-prior"):
        for cell in benchmark(cells, method).values():
            out.setdefault(LEAST_SQUARES[method], izz(cell))
    for cell in benchmark(cells, "training-mean", "row").values():
        out.setdefault("training mean", izz(cell))
    return {name: curve for name, curve in out.items() if curve is not None}


def izz_table(cells: Cells) -> Table:
    """Fig. 8 in numbers: running mean (ensembles) or estimate (least squares) of Izz over time, beside the truth."""
    shown = curves(cells)
    rows, baselines = [], []
    for name, curve in shown.items():
        if not rows:
            rows.append(("truth", MISSING, *[short(SHOWN_SCALE * float(curve["truth"]))] * len(_TIMES)))
        if name.startswith(("training mean", "same-prior")):
            baselines.append(len(rows))
        at = [int(np.argmin(np.abs(curve["t"] - t))) for t in _TIMES]
        running = [short(SHOWN_SCALE * float(curve["running"][k])) for k in at]
        rows.append((name, short(SHOWN_SCALE * float(curve["single"][0])), *running))
    heads = ("method", "first estimate", *(f"{t:g} s" for t in _TIMES))
    note = f"One run on a real-like arm, seed 0. {'' if shown else 'Not measured yet: `' + COMMAND + '` measures it.'}"
    return Table("Fig. 8: Izz over time [g·m²]", heads, tuple(rows), note.strip(), tuple(baselines))
