"""Numbers out of finished cells: which cells answer a question, and the errors they hold.

Cells are plain dictionaries, as `load_cells` reads them. An error array is (R, 10): one row per run or per seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.lab.study.spec import REAL

Cell = Mapping[str, Any]
Cells = Mapping[str, Cell]

PAPER_EPOCHS = 1000  # the paper's "at most"; a network cell with fewer is called capped
LEAST = 1.0  # [%] an improvement below this is none
EXACT = 1e-9  # [SI] errors below are rounding: a parameter that is the same in every payload is learned exactly
# Judged by their mean over the second half, as in [7].
AVERAGED = ("rls", "rls-filter", "rls-filter-calibrated", "rls-filter-calibrated-other")
READING = "reading"  # the ablation of the cells of the readings
RIVAL_OF = {  # the same method on the many arms of `rivals`
    "rls": "rival-difference-540-panda",
    "rls-filter": "rival-filter-540-panda",
    "rls-filter-calibrated": "rival-filter-540-panda-calibrated",
}


class Ensemble(NamedTuple):
    """Which ensemble: kind "tree", "network" or "mixed"; scale "raw" or "standard"; sensors of its training data."""

    kind: str
    stages: int = 1
    split: str = "row"
    scale: str = "raw"
    sensors: str = "ideal"


class Match(NamedTuple):
    """Cells of several ensembles that may be compared: trained with the same cap on epochs, seed by seed.

    cap: None where no networks take part. seeds: (S,). cells: for each ensemble one cell per seed.
    """

    cap: int | None
    seeds: tuple[int, ...]
    cells: tuple[tuple[Cell, ...], ...]


def cap(cell: Cell) -> int | None:
    """The most epochs a cell's networks may train; None for what has no epochs."""
    return cell["spec"].get("max_epochs") if cell["spec"]["kind"] in ("network", "mixed") else None


def matched(cells: Cells, *ensembles: Ensemble) -> list[Match]:
    """Every way to compare these ensembles, the largest cap on epochs first; empty where a cell is missing."""
    found = [_by_cap_and_seed(cells, ensemble) for ensemble in ensembles]
    caps = {c for by_cap in found for c in by_cap} - {None} or {None}
    out = []
    for most in sorted(caps, key=lambda c: c or 0, reverse=True):
        per_seed = [by_cap.get(None) or by_cap.get(most, {}) for by_cap in found]
        seeds = sorted(set.intersection(*(set(s) for s in per_seed)))
        if seeds:
            out.append(Match(most, tuple(seeds), tuple(tuple(s[seed] for seed in seeds) for s in per_seed)))
    return out


def _by_cap_and_seed(cells: Cells, ensemble: Ensemble) -> dict[int | None, dict[int, Cell]]:
    out: dict[int | None, dict[int, Cell]] = {}
    for cell in cells.values():
        spec = cell["spec"]
        if spec["kind"] != ensemble.kind or spec.get("ablation") not in (None, "scale"):
            continue
        this = (spec["kind"], spec["stages"], spec["split"], spec["scale"], spec["sensors"])
        if this == ensemble:
            out.setdefault(cap(cell), {})[spec["seed"]] = cell
    return out


def benchmark(cells: Cells, method: str, split: str | None = None) -> list[Cell]:
    """The cells of a least-squares method or a baseline, one for each seed."""
    stem = f"benchmark-{method}{f'-{split}' if split else ''}-s"
    seeds = {name.removeprefix(stem): cell for name, cell in cells.items() if name.startswith(stem)}
    return [cell for seed, cell in sorted(seeds.items()) if seed.isdigit()]


def held_out(group: Sequence[Cell]) -> NDArray[np.float64] | None:
    """Mean absolute error of single samples on each cell's own test rows, (S, 10)."""
    rows = [cell["protocols"].get("held_out") for cell in group]
    return np.array([row["single"] for row in rows if row], dtype=float) if rows and all(rows) else None


def held_out_payloads(group: Sequence[Cell]) -> NDArray[np.float64] | None:
    """The same for each held-out payload (P, 10), averaged over the cells' seeds; None: a cell has no such rows."""
    rows = [cell["protocols"].get("held_out", {}).get("payloads") for cell in group]
    if not rows or any(r is None for r in rows) or len({len(r) for r in rows}) > 1:
        return None
    return np.mean(rows, axis=0)


def at_end(group: Sequence[Cell], protocol: str) -> NDArray[np.float64] | None:
    """|error| of the answer to each run of a protocol, (R, 10), averaged over the cells' seeds.

    For an ensemble the answer is its running mean at the end; for `AVERAGED` methods the mean over the second half.
    """
    if not group or any(protocol not in cell["protocols"] for cell in group):
        return None
    return np.mean([_answers(cell, cell["protocols"][protocol]) for cell in group], axis=0)


def at_first(group: Sequence[Cell], protocol: str) -> NDArray[np.float64] | None:
    """|error| of the first answer to each run of a protocol, (R, 10), averaged over the cells' seeds.

    For an ensemble that is its answer to the first sample, for least squares the estimate after one sample.
    """
    if not group or any("first" not in cell["protocols"].get(protocol, {}) for cell in group):
        return None
    return np.mean([cell["protocols"][protocol]["first"] for cell in group], axis=0)


class Answers(NamedTuple):
    """Errors (R, 10) of an ensemble on the runs of a protocol, with the cap on epochs and the seeds behind them."""

    errors: NDArray[np.float64]
    cap: int | None
    seeds: tuple[int, ...]


def both_stages(
    cells: Cells,
    kind: str,
    split: str,
    protocol: str,
    scale: str = "raw",
    read: Callable[[Sequence[Cell], str], NDArray[np.float64] | None] = at_end,
) -> Answers | None:
    """An ensemble on whole runs: mass and first moments from one stage, inertia from two, as the paper found better.

    It does not say which training it used there. read: `at_end` or `at_first`. None: a cell is missing.
    """
    found = matched(cells, Ensemble(kind, 1, split, scale), Ensemble(kind, 2, split, scale))
    if not found:
        return None
    one, two = (read(group, protocol) for group in found[0].cells)
    if one is None or two is None:
        return None
    return Answers(np.concatenate([one[:, :4], two[:, 4:]], axis=1), found[0].cap, found[0].seeds)


def _answers(cell: Cell, measured: Mapping[str, Any]) -> NDArray[np.float64]:
    averaged = "second_half" in measured and (method(cell) in AVERAGED or cell["spec"]["kind"] == "rival")
    return np.array(measured["second_half" if averaged else "running"], dtype=float)


def method(cell: Cell) -> str:
    """Name of a benchmark's method with its split; empty for an ensemble."""
    return cell["name"].removeprefix("benchmark-").rpartition("-s")[0] if cell["spec"]["kind"] == "benchmark" else ""


def mean_ratio(a: ArrayLike, b: ArrayLike) -> float:
    """Geometric mean of a/b over the parameters that neither of the two knows exactly; units drop out.

    >>> mean_ratio([1.0, 4.0, 0.0], [2.0, 2.0, 3.0])
    1.0
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    keep = (a > EXACT) & (b > EXACT)
    return float(np.exp(np.mean(np.log(a[keep] / b[keep])))) if keep.any() else 1.0


def on_many_arms(cells: Cells) -> dict[str, Cell]:
    """The study with the cells of the readings (many arms, a row for each payload) in place of those they repeat.

    Least squares are those of `rivals` at the study's rate; the training mean errs on every arm alike.
    """
    stages: dict[tuple, list[Cell]] = {}
    for cell in cells.values():
        if cell["spec"].get("ablation") == READING:
            stages.setdefault(_ensemble_of(cell), []).append(cell)
    many = {key: group for key, group in stages.items() if len(group) == 2}
    arms = max((len(cell["protocols"][REAL]["running"]) for group in many.values() for cell in group), default=0)
    out = {
        name: cell
        for name, cell in cells.items()
        if cell["spec"]["kind"] not in ("tree", "network")
        or cell["spec"].get("ablation") not in (None, "scale", READING)
        or cell["spec"]["sensors"] != "ideal"
        or _ensemble_of(cell) not in many
    }
    for cell in (cell for group in many.values() for cell in group):
        spec = dict(cell["spec"]) | {"ablation": "scale" if cell["spec"]["scale"] == "standard" else None}
        name = cell["name"].removeprefix(f"{READING}-")
        out[name] = {**cell, "name": name, "spec": spec}
    for method, rival in RIVAL_OF.items():
        name = f"benchmark-{method}-s0"
        if name in cells and rival in cells:
            protocols = {**cells[name]["protocols"], **cells[rival]["protocols"]}
            out[name] = {**cells[name], "protocols": protocols}
    for name, cell in cells.items():
        if name.startswith("benchmark-training-mean") and REAL in cell["protocols"] and arms:
            alike = {k: cell["protocols"][REAL].get(k) for k in ("running", "first")}
            real = {k: [np.mean(rows, axis=0).tolist()] * arms for k, rows in alike.items() if rows}
            out[name] = {**cell, "protocols": {**cell["protocols"], REAL: {**cell["protocols"][REAL], **real}}}
    return out


def _ensemble_of(cell: Cell) -> tuple[Any, ...]:
    """What the two stages of an ensemble share, and its seeds."""
    spec = cell["spec"]
    return spec["kind"], spec["scale"], spec["split"], cap(cell)
