"""The tables of the study, each with what it rests on; a cell that is not finished shows as –, not as a number."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, Table, parameter_columns, short
from armload.lab.study.numbers import EXACT, PAPER_EPOCHS, Cell, Cells, Ensemble, at_end, benchmark, held_out, matched
from armload.lab.study.spec import NOMINAL, REAL, SEMI_REAL

COMMAND = "armload reproduce taie2024"
MISSING = "–"
NOT_YET = f"–: does not apply, or not measured yet (`{COMMAND}` measures what is missing)."
LEARNERS = {"tree": "trees", "network": "networks", "mixed": "networks and trees"}
LEAST_SQUARES = {
    "rls": "RLS",
    "rls-filter": "filtered RLS",
    "rls-filter-calibrated": "filtered RLS calibrated as in [7]",
    "rls-filter-calibrated-other": "filtered RLS calibrated on another motion",
    "map": "MAP least squares",
    "map-tare": "MAP least squares with tare",
    "same-prior": "same-prior least squares",
    "hybrid": "hybrid, armload's default",
    "hybrid-tare": "hybrid with tare",
}
TRAINING_MEAN = "training mean"
BASELINES = (TRAINING_MEAN, LEAST_SQUARES["same-prior"])
SPLITS = {"row": "rows", "payload": "payloads"}
PROTOCOLS = {
    "held_out": "test rows, single samples",
    NOMINAL: "test payload, nominal arm",
    REAL: "test payload, real-like arms",
    SEMI_REAL: "test payload on a real log",
    "off_family": "other payloads",
    "other_motion": "other motions",
}
SPREAD = "± is the standard deviation over runs (test rows: over seeds)."

Row = tuple[str, NDArray[np.float64] | None]  # a method and its errors (R, 10)


# ---------------------------------------------------------------------- methods by protocols


def main_tables(cells: Cells) -> tuple[Table, ...]:
    """Mass, first moment and inertia: every method under every protocol."""
    rows = [*_ensemble_rows(cells), *_least_squares_rows(cells)]
    tables = []
    for group, part in GROUPS.items():
        unit = SHOWN_UNITS[part][0]
        columns = ("method", "split", "epochs", "seeds", *(f"{name} [{unit}]" for name in PROTOCOLS.values()))
        filled = tuple((*labels, *(group_shown(errors(p), part) for p in PROTOCOLS)) for *labels, errors in rows)
        title = f"Mean absolute error of the {group}"
        tables.append(Table(title, columns, filled, f"{SPREAD} {NOT_YET}", baselines_of(filled)))
    return tuple(tables)


def baselines_of(rows: Sequence[tuple[str, ...]]) -> tuple[int, ...]:
    """Which rows are baselines, to be set apart."""
    return tuple(k for k, row in enumerate(rows) if row[0].startswith(BASELINES))


def errors_of(group: Sequence[Cell]) -> Callable[[str], NDArray[np.float64] | None]:
    """Protocol → errors (R, 10) of cells that differ in their seed only."""
    return lambda protocol: held_out(group) if protocol == "held_out" else at_end(group, protocol)


def _ensemble_rows(cells: Cells) -> list[tuple[str, str, str, str, Callable]]:
    rows = []
    wanted = [Ensemble(kind, stages, split) for kind in ("tree", "network") for stages in (1, 2) for split in SPLITS]
    wanted += [Ensemble("network", stages, split, "standard") for stages in (1, 2) for split in SPLITS]
    wanted += [Ensemble("mixed", 1, split, scale) for scale in ("raw", "standard") for split in SPLITS]
    for ensemble in wanted:
        label = ensemble_shown(ensemble.kind, ensemble.scale, stages=ensemble.stages)
        found = matched(cells, ensemble)
        for match in found:
            seeds = ", ".join(map(str, match.seeds))
            rows.append((label, SPLITS[ensemble.split], cap_shown(match.cap), seeds, errors_of(match.cells[0])))
        if not found:
            rows.append((label, SPLITS[ensemble.split], MISSING, MISSING, lambda _: None))
    return rows


def _least_squares_rows(cells: Cells) -> list[tuple[str, str, str, str, Callable]]:
    rows = []
    for method, label in LEAST_SQUARES.items():
        found = benchmark(cells, method)
        rows.append((label, "none", "none", MISSING if not found else "none", errors_of(found)))
    for split, shown in SPLITS.items():
        found = benchmark(cells, "training-mean", split)
        seeds = ", ".join(str(cell["spec"]["seed"]) for cell in found) or MISSING
        rows.append((TRAINING_MEAN, shown, "none", seeds, errors_of(found)))
    return rows


def ensemble_shown(kind: str, scale: str = "raw", *, stages: int | None = None, most: int | None = None) -> str:
    """The name of an ensemble; `most` is named where it is less than the epochs of the paper."""
    parts = [LEARNERS[kind]] + ([stages_shown(stages)] if stages else []) + ["standardised"] * (scale == "standard")
    return ", ".join(parts) + capped(most)


def capped(most: int | None) -> str:
    """What to add to the name of networks that trained for fewer epochs than the paper's might."""
    return "" if most in (None, PAPER_EPOCHS) else f", ≤ {most} epochs"


def epochs_table(cells: Cells) -> Table:
    """How long the networks trained until their validation loss came to rest."""
    wanted = [
        Ensemble("network", stages, split, scale)
        for scale in ("raw", "standard")
        for stages in (1, 2)
        for split in SPLITS
    ]
    rows = []
    for ensemble in wanted:
        for match in matched(cells, ensemble):
            used = np.concatenate([np.ravel(cell["epochs"]) for cell in match.cells[0]])
            minutes = np.mean([cell["wall_s"] for cell in match.cells[0]]) / 60.0
            label = ensemble_shown("network", ensemble.scale, stages=ensemble.stages)
            seeds = ", ".join(map(str, match.seeds))
            spent = (f"{np.median(used):.0f}", f"{used.min():.0f}–{used.max():.0f}", f"{minutes:.1f}")
            rows.append((label, SPLITS[ensemble.split], cap_shown(match.cap), seeds, *spent))
    columns = ("method", "split", "cap", "seeds", "epochs, median", "epochs, range", "minutes")
    note = "Over members, stages and seeds; the minutes are those of training and measuring one cell. "
    note = note + NOT_YET if rows else f"Not measured yet: `{COMMAND}` measures it."
    return Table("Epochs the networks used", columns, tuple(rows), note)


def stages_shown(count: int) -> str:
    return ("single-stage", "two-stage")[count - 1]


def cap_shown(most: int | None) -> str:
    return "none" if most is None else f"≤ {most}" + ("" if most == PAPER_EPOCHS else " (capped)")


def value(mean: float, spread: float | None) -> str:
    """Mean ± spread in the units tables are shown in, three digits of the larger one; no spread where there is none."""
    if not np.isfinite(mean) or abs(mean) <= EXACT:
        return "0" if abs(mean) <= EXACT else short(SHOWN_SCALE * float(mean))
    apart = SHOWN_SCALE * float(spread) if spread is not None and spread > EXACT else 0.0
    shown = SHOWN_SCALE * float(mean)
    largest = float(f"{max(abs(shown), apart):.2e}")  # 9.996 is 10.0, with one decimal
    decimals = int(np.clip(2 - np.floor(np.log10(largest)), 0, 4))
    return f"{shown:.{decimals}f}" + (f" ± {apart:.{decimals}f}" if apart else "")


def group_shown(errors: NDArray | None, part: slice) -> str:
    return MISSING if errors is None else mean_and_spread(errors[:, part].mean(axis=1))


def mean_and_spread(values: NDArray) -> str:
    return value(float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else None)


def mass_shown(errors: NDArray) -> str:
    """The mean mass error of errors (R, 10), with its unit."""
    return f"{short(SHOWN_SCALE * float(errors[:, 0].mean()))} {SHOWN_UNITS[0]}"


def listing(parts: Sequence[str]) -> str:
    """ "a, b and c"."""
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]


def parameter_table(title: str, rows: Iterable[Row], note: str) -> Table:
    """Mean absolute error of each of the ten parameters, a row per method."""
    filled = []
    for label, errors in rows:
        shown = [MISSING] * 10 if errors is None else [mean_and_spread(errors[:, k]) for k in range(10)]
        filled.append((label, *shown))
    return Table(
        title, ("method", *parameter_columns()), tuple(filled), f"{note} {SPREAD} {NOT_YET}", baselines_of(filled)
    )
