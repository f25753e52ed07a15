"""The paper's claims without a number: what each is taken to mean, and how it is measured.

The paper defines none of "accurate", "flat", "close": each rule says in `criterion` what has to hold, and a stricter
reader finds the measured number beside the verdict.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.lab.study.numbers import (
    LEAST,
    Answers,
    Cell,
    Cells,
    Ensemble,
    at_end,
    at_first,
    benchmark,
    both_stages,
    held_out,
    matched,
    mean_ratio,
    spread,
)

REAL, NOMINAL = "test_payload_real_like", "test_payload_nominal"
FLAT_AFTER, SECOND_HALF = 2.85, 3.0  # [s] the paper's
FLAT = 5.0  # [% of the truth] that a flat line may move, ours
CLOSE = 2.0  # ratio of errors that still counts as close, ours


class Measured(NamedTuple):
    """A claim under one split: the number, its spread, whether the claim holds; cap on epochs and seeds behind it."""

    value: float
    spread: float | None
    holds: bool
    cap: int | None = None
    seeds: tuple[int, ...] = ()
    exact: bool = False  # one of the two errors is rounding only


class Rule(NamedTuple):
    """How a statement is judged: `measure(cells, learner, split)` gives a number in `unit`; None: a cell is missing."""

    measure: Callable[[Cells, str | None, str], Measured | None]
    unit: str
    criterion: str


def izz(cell: Cell, protocol: str = REAL) -> dict[str, NDArray[np.float64]] | None:
    """Izz of one run over time: t, single, running (T,), and their signed errors `single_error`, `running_error`."""
    curve = cell.get("izz", {}).get(protocol)
    if not curve:
        return None
    out = {name: np.array(curve[name], dtype=float) for name in ("t", "single", "running", "truth")}
    return out | {f"{name}_error": out[name] - out["truth"] for name in ("single", "running")}


def _curves(cells: Cells, kind: str | None, split: str) -> tuple[list[dict[str, NDArray]], int | None, tuple] | None:
    found = matched(cells, Ensemble(str(kind), 2, split))  # the inertia comes from two stages
    curves = [izz(cell) for cell in found[0].cells[0]] if found else []
    kept = [curve for curve in curves if curve is not None]
    return (kept, found[0].cap, found[0].seeds) if kept else None


def _first_step(cells: Cells, learner: str | None, split: str) -> Measured | None:
    own = both_stages(cells, str(learner), split, REAL, read=at_first)
    mean = at_first(benchmark(cells, "training-mean", split), REAL)
    if own is None or mean is None:
        return None
    return _over_arms(own, lambda errors: _percent_of_means(errors, mean))


def _over_arms(own: Answers, improvement: Callable[[NDArray], float]) -> Measured:
    """An improvement [%] of an ensemble's errors, its spread over the runs, and whether it counts as one."""
    value = improvement(own.errors)
    return Measured(value, spread(improvement, own.errors), value >= LEAST, own.cap, own.seeds)


def _flat(cells: Cells, learner: str | None, split: str) -> Measured | None:
    own = _curves(cells, learner, split)
    if own is None:
        return None
    moved = []
    for curve in own[0]:
        late = curve["running"][curve["t"] >= FLAT_AFTER]
        moved.append([100.0 * float(np.max(np.abs(late - late[-1]), initial=0.0) / abs(curve["truth"]))])
    values = np.array(moved)
    return Measured(float(values.mean()), spread(_mean, values), float(values.mean()) <= FLAT, *own[1:])


def _overshoot(cells: Cells, _learner: str | None, _split: str) -> Measured | None:
    curves = [c for c in map(izz, benchmark(cells, "rls")) if c is not None]
    if not curves:
        return None
    early, late = [], []
    for curve in curves:
        share = 100.0 * np.abs(curve["running_error"]) / abs(float(curve["truth"]))
        before = curve["t"] < SECOND_HALF
        early.append([float(np.max(share[before], initial=0.0))])
        late.append([float(np.max(share[~before], initial=0.0))])
    peak = float(np.mean(early))
    return Measured(peak, spread(_mean, np.array(early)), peak > max(100.0, float(np.mean(late))))


def _close(cells: Cells, learner: str | None, split: str) -> Measured | None:
    found = _real_and_nominal(cells, learner, split)
    if found is None:
        return None
    real, nominal = found

    def ratio(errors: NDArray) -> float:
        return mean_ratio(errors.mean(axis=0), nominal)

    value = ratio(real.errors)
    return Measured(value, spread(ratio, real.errors), value <= CLOSE, real.cap, real.seeds)


def _better_on_real(cells: Cells, learner: str | None, split: str) -> Measured | None:
    found = _real_and_nominal(cells, learner, split)
    if found is None:
        return None
    real, nominal = found
    return _over_arms(real, lambda errors: 100.0 * (1.0 - mean_ratio(errors.mean(axis=0)[:4], nominal[:4])))


def _real_and_nominal(cells: Cells, learner: str | None, split: str) -> tuple[Answers, NDArray] | None:
    real, nominal = (both_stages(cells, str(learner), split, protocol) for protocol in (REAL, NOMINAL))
    return None if real is None or nominal is None else (real, nominal.errors.mean(axis=0))


def _no_filter(cells: Cells, learner: str | None, split: str) -> Measured | None:
    own = both_stages(cells, str(learner), split, REAL)
    methods = ("rls-filter", "rls-filter-calibrated")  # those of [7]
    others = [e for m in methods if (e := at_end(benchmark(cells, m), REAL)) is not None]
    if own is None or len(others) < len(methods):
        return None
    best = min(others, key=lambda e: mean_ratio(e.mean(axis=0), own.errors.mean(axis=0)))
    value = _percent_of_means(own.errors, best)
    return Measured(value, spread(_percent_of_means, own.errors, best), value >= LEAST, own.cap, own.seeds)


def _trees_better(cells: Cells, _learner: str | None, split: str) -> Measured | None:
    wanted = [Ensemble(kind, stages, split) for kind in ("tree", "network") for stages in (1, 2)]
    return _held_out_comparison(cells, wanted, lambda e: np.concatenate(e[:2], 1), lambda e: np.concatenate(e[2:], 1))


def _mixed_better(cells: Cells, _learner: str | None, split: str) -> Measured | None:
    wanted = [Ensemble(kind, 1, split) for kind in ("mixed", "tree", "network")]

    def better_of_the_two(errors: list[NDArray]) -> NDArray:
        tree, network = errors[1:]
        return tree if mean_ratio(tree.mean(axis=0), network.mean(axis=0)) < 1.0 else network

    return _held_out_comparison(cells, wanted, lambda e: e[0], better_of_the_two)


def _held_out_comparison(
    cells: Cells,
    wanted: list[Ensemble],
    ours: Callable[[list[NDArray]], NDArray],
    theirs: Callable[[list[NDArray]], NDArray],
) -> Measured | None:
    """Improvement over all parameters on held-out single samples; spread over seeds at the cap that has most."""
    pairs = []
    for match in matched(cells, *wanted):
        errors = [held_out(group) for group in match.cells]
        there = [e for e in errors if e is not None]
        if len(there) == len(wanted):
            pairs.append((match, ours(there), theirs(there)))
    if not pairs:
        return None
    match, a, b = pairs[0]
    value = _percent_of_means(a, b)
    many = max(pairs, key=lambda pair: len(pair[0].seeds))
    return Measured(value, spread(_percent_of_means, *many[1:]), value >= LEAST, match.cap, match.seeds)


def _percent_of_means(a: NDArray, b: NDArray) -> float:
    return 100.0 * (1.0 - mean_ratio(a.mean(axis=0), b.mean(axis=0)))


def _mean(values: NDArray) -> float:
    return float(values.mean())


RULES = {
    "first-step": Rule(
        _first_step,
        "% less error than the training mean",
        "on real-like arms the first estimate, from one sample, errs less than the mean of the training payloads, "
        "which looks at no measurement: the least that accurate can mean (geometric mean over the ten parameters; by "
        "group of parameters under The first time step)",
    ),
    "flat": Rule(
        _flat,
        "% of the truth",
        f"in one run on a real-like arm the running mean of Izz stays within {FLAT:g} % of the truth of its last value "
        f"after {FLAT_AFTER:g} s",
    ),
    "overshoot": Rule(
        _overshoot,
        "% of the truth, peak error",
        f"in one run on a real-like arm the error of RLS on Izz peaks before {SECOND_HALF:g} s, above 100 % of the "
        "truth, the error of the answer 0",
    ),
    "close": Rule(
        _close,
        "× the simulated error",
        f"errors on real-like arms are at most {CLOSE:g} times those on the nominal arm (geometric mean over the "
        "parameters)",
    ),
    "better-on-real": Rule(
        _better_on_real,
        "% less error than simulated",
        "errors of mass and first moments are smaller on real-like arms than on the nominal arm (geometric mean over "
        "these four)",
    ),
    "no-filter": Rule(
        _no_filter,
        "% less error than filtered RLS",
        "on real-like arms the ensemble, fed raw signals, errs less than filtered RLS and than filtered RLS calibrated "
        "as in [7] (geometric mean over the parameters; the number is against the better of the two)",
    ),
    "trees-better": Rule(
        _trees_better,
        "% less error than networks",
        "trees err less than networks on held-out rows of the simulated data set (geometric mean over the parameters "
        "and over one stage and two)",
    ),
    "mixed-better": Rule(
        _mixed_better,
        "% less error than the better of trees and networks",
        "the mixed ensemble errs less than the better of the two on held-out rows of the simulated data set, one "
        "stage, all at the same cap on epochs (geometric mean over the parameters)",
    ),
}
