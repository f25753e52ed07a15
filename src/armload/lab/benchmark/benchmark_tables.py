"""The benchmark's tables: errors by population, over time, intervals, repeatability, and where the subject loses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from armload.inertia import NAMES
from armload.lab.benchmark.measured import Measured
from armload.lab.benchmark.populations import REPEAT
from armload.lab.benchmark.rows import BASELINES
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, Table, parameter_columns, short

Results = Mapping[str, Measured]  # by population
SUBJECTS = ("hybrid", "map-gp", "map")  # the first that is measured is what the tables judge
AHEAD = "◂"
MISSING = "–"
_CERTAIN = 2.0  # standard errors of a paired difference beyond which it counts


def subject(results: Results) -> str | None:
    """The method that the tables judge; None if it was not measured."""
    return next((name for name in SUBJECTS if any(name in m.rows for m in results.values())), None)


def row_names(results: Results) -> list[str]:
    """All rows of all populations, in order, the baselines last."""
    names = list(dict.fromkeys(row for m in results.values() for row in m.rows if row not in BASELINES))
    return names + [row for row in BASELINES if any(row in m.rows for m in results.values())]


def with_error(value: float, error: float) -> str:
    """A number in shown units to three digits ± its standard error to the same decimal.

    >>> with_error(0.02, 0.0016), with_error(0.02, float("nan"))
    ('20.0 ± 1.6', '20.0')
    """
    shown = SHOWN_SCALE * value
    decimals = int(np.clip(2 - np.floor(np.log10(max(abs(shown), 1e-3))), 0, 3))
    return f"{shown:.{decimals}f}" + (f" ± {SHOWN_SCALE * error:.{decimals}f}" if np.isfinite(error) else "")


def ahead(m: Measured, row: str, time: int, group: int, of: str | None) -> bool:
    """Whether a row's error is smaller than the subject's by more than two standard errors of the difference."""
    if of is None or row == of or of not in m.rows or row not in m.rows:
        return False
    mean, error = (x[time, group] for x in m.paired(row, of))
    return bool(np.isfinite(error) and mean < -_CERTAIN * error)


def populations_table(results: Results) -> Table:
    """What each population tries and how many episodes are measured."""
    rows = []
    for name, m in results.items():
        recipe = m.population.recipe
        tare = "none" if not m.population.has_tare else "same motion" if m.population.same_motion else "another motion"
        arm, first, last = ", ".join(recipe.worlds).replace("_", "-"), m.seed[0], m.seed[-1]
        seeds = f"{first}" if first == last else f"{first}–{last}"
        rows.append((name, m.population.tries, arm, ", ".join(recipe.payloads), tare, str(m.runs), seeds))
    columns = ("population", "tries", "arms", "payloads", "tare", "episodes", "seeds")
    return Table(
        "Populations", columns, tuple(rows), "Every episode has another arm, payload and motion, unless it says so."
    )


def group_table(results: Results, group: str, time: float) -> Table:
    """Mean absolute error of a group of parameters at one time: every row on every population."""
    of, k = subject(results), list(GROUPS).index(group)
    shown = {name: m for name, m in results.items() if name != REPEAT}
    names = row_names(shown)
    rows = []
    for row in names:
        cells = []
        for m in shown.values():
            if row not in m.rows:
                cells.append(MISSING)
                continue
            i, t = m.rows.index(row), m.index(time)
            text = with_error(m.grouped[i, :, t, k].mean(), m.standard_error(m.grouped)[i, t, k])
            cells.append(text + (f" {AHEAD}" if ahead(m, row, t, k, of) else ""))
        rows.append((row, *cells))
    unit = SHOWN_UNITS[GROUPS[group]][0]
    columns = ("method", *(m.population.title for m in shown.values()))
    note = f"± is the standard error over the episodes.{_ahead_of(of)}"
    return _table(f"Mean absolute error of the {group} after {time:g} s [{unit}]", columns, rows, note)


def time_table(m: Measured, group: str, of: str | None) -> Table:
    """Mean absolute error of a group of parameters over time, every row of one population."""
    k, error = list(GROUPS).index(group), m.standard_error(m.grouped)
    rows = []
    for i, row in enumerate(m.rows):
        cells = []
        for t in range(len(m.times)):
            text = with_error(m.grouped[i, :, t, k].mean(), error[i, t, k])
            cells.append(text + (f" {AHEAD}" if ahead(m, row, t, k, of) else ""))
        rows.append((row, *cells))
    unit = SHOWN_UNITS[GROUPS[group]][0]
    columns = ("method", *(f"{time:g} s" for time in m.times))
    title = f"{m.population.name}: mean absolute error of the {group} over time [{unit}]"
    return _table(title, columns, rows, f"± is the standard error over {m.runs} episodes.{_ahead_of(of)}{_refused(m)}")


def parameter_table(m: Measured, time: float) -> Table:
    """Mean absolute error of every parameter at one time, with standard error and the spread over the seeds."""
    t, error, spread = m.index(time), m.standard_error(m.absolute), m.seed_spread(m.absolute)
    rows = []
    for i, row in enumerate(m.rows):
        cells = []
        for p in range(10):
            seeds = f" ({short(SHOWN_SCALE * float(spread[i, t, p]), 2)})" if np.isfinite(spread[i, t, p]) else ""
            cells.append(with_error(m.absolute[i, :, t, p].mean(), error[i, t, p]) + seeds)
        rows.append((row, *cells))
    title = f"{m.population.name}: mean absolute error of each parameter after {m.times[t]:g} s"
    seeds = f"standard deviation of the means of the {len(m.comparison.seeds)} seeds"
    note = f"± standard error over {m.runs} episodes ({seeds}).{_refused(m)}"
    return _table(title, ("method", *parameter_columns()), rows, note)


def intervals_table(results: Results, time: float) -> Table:
    """Share of 95 % intervals that hold the truth, pooled over the parameters, and how wide they are."""
    shown = {name: m for name, m in results.items() if name != REPEAT}
    rows = []
    for row in row_names(shown):
        cells = []
        for m in shown.values():
            if row not in m.rows:
                cells.append(MISSING)
                continue
            i, t = m.rows.index(row), m.index(time)
            width = m.half_width[i, :, t].mean(axis=0) / m.absolute[i, :, t].mean(axis=0)
            cells.append(f"{m.coverage[i, t].mean():.0%} ({short(float(np.median(width)), 2)})")
        rows.append((row, *cells))
    columns = ("method", *(m.population.title for m in shown.values()))
    note = (
        "Share of the methods' own 95 % intervals that hold the truth, all parameters together (mean half-width over "
        "mean absolute error, median of the ten parameters; 2.5 for a Gaussian error that is known exactly)."
    )
    return _table(f"95 % intervals after {time:g} s", columns, rows, note)


def own_intervals_table(results: Results, time: float, row: str) -> Table:
    """Coverage and half-width of one method's intervals, parameter by parameter."""
    rows = []
    for name, m in results.items():
        if row in m.rows and name != REPEAT:
            i, t = m.rows.index(row), m.index(time)
            share, width = m.coverage[i, t], m.half_width[i, :, t].mean(axis=0)
            rows.append((name, *(f"{c:.0%} (±{short(SHOWN_SCALE * w, 2)})" for c, w in zip(share, width, strict=True))))
    title = f"{row}: coverage of the 95 % intervals after {time:g} s"
    note = "Share of the episodes whose interval holds the truth (± mean half-width, in the unit of the column)."
    return Table(title, ("population", *parameter_columns()), tuple(rows), note)


def paired_table(results: Results, a: str, b: str, group: str) -> Table:
    """Two methods on the same episodes: ratio of their errors, and the mean difference with its standard error."""
    k, rows = list(GROUPS).index(group), []
    times: Sequence[float] = ()
    for name, m in results.items():
        if a in m.rows and b in m.rows and name != REPEAT:
            ratio, (mean, error), times = m.ratio(a, b), m.paired(a, b), m.times.tolist()
            cells = [f"{short(float(ratio[t, k]))} ({with_error(mean[t, k], error[t, k])})" for t in range(len(times))]
            rows.append((name, *cells))
    unit = SHOWN_UNITS[GROUPS[group]][0]
    note = f"Error of {a} over error of {b}: below 1, {a} is better (mean difference ± its standard error, {unit})."
    title = f"{a} against {b}, {group}"
    return Table(title, ("population", *(f"{time:g} s" for time in times)), tuple(rows), note)


def repeatability_table(m: Measured, times: Sequence[float]) -> Table:
    """Standard deviation of each parameter over motions and noise, one payload on one arm."""
    rows = [
        (row, f"{m.times[t]:g}", *(short(SHOWN_SCALE * float(x)) for x in m.repeatability[i, t]))
        for t in (m.index(time) for time in times)
        for i, row in enumerate(m.rows)
        if row not in BASELINES
    ]
    seeds, counts = np.unique(m.seed, return_counts=True)
    note = (
        f"Standard deviation of the estimates over {counts.max()} motions, each with another tare and other noise, one "
        f"payload on one arm; root mean square over {len(seeds)} such pair{'' if len(seeds) == 1 else 's'}."
    )
    return Table("Repeatability", ("method", "after [s]", *parameter_columns()), tuple(rows), note)


def efficiency_table(m: Measured, times: Sequence[float]) -> Table | None:
    """Bound over root mean square error; None where the bound was not measured."""
    if m.efficiency is None:
        return None
    rows = [
        (row, f"{m.times[t]:g}", *(f"{x:.2f}" for x in m.efficiency[i, t]))
        for t in (m.index(time) for time in times)
        for i, row in enumerate(m.rows)
    ]
    note = (
        "Standard deviation of the Bayesian Cramér–Rao bound over the root mean square error: 1 leaves nothing in the "
        "data. The bound knows the payload family's mean and covariance, as the baselines do, and expects an arm's "
        "mismatch as stated for any arm: above 1, these arms are milder than that, or the method knows more."
    )
    return Table(f"{m.population.name}: efficiency", ("method", "after [s]", *NAMES), tuple(rows), note)


def losses(results: Results) -> list[dict]:
    """Where another row is ahead of the subject: population, time [s], group, errors of both [SI], the best row."""
    of, found = subject(results), []
    for name, m in results.items():
        if of not in m.rows or of is None or name == REPEAT:
            continue
        for t, time in enumerate(m.times):
            for k, group in enumerate(GROUPS):
                better = [row for row in m.rows if ahead(m, row, t, k, of)]
                if better:
                    error = {row: float(m.grouped[m.rows.index(row), :, t, k].mean()) for row in (of, *better)}
                    best = min(better, key=lambda row: error[row])
                    cell = {"population": name, "time": float(time), "group": group}
                    found.append(cell | {"error": error[of], "better": error[best], "which": best})
    return found


def losses_table(results: Results) -> Table:
    """Where another row is ahead of the subject, the one that is most."""
    of, rows = subject(results), []
    if of is None:
        why = f"Nothing is judged: none of {', '.join(SUBJECTS)} was measured."
        return Table("Where the default loses", ("population", "after", "group"), (), why)
    for loss in losses(results):
        unit = SHOWN_UNITS[GROUPS[loss["group"]]][0]
        values = (f"{short(SHOWN_SCALE * loss[key])} {unit}" for key in ("error", "better"))
        rows.append((loss["population"], f"{loss['time']:g} s", loss["group"], *values, loss["which"]))
    columns = ("population", "after", "group", of, "better", "which")
    note = (
        f"Every population, time and group where some row is ahead of {of} by more than two standard errors of the "
        "paired difference."
    )
    return Table(f"Where {of} loses", columns, tuple(rows), note if rows else "Nowhere. " + note)


def cost_table(results: Results) -> Table:
    """Computing time of an episode."""
    rows = []
    for row in row_names(results):
        walls = [m.comparison.wall[m.rows.index(row)] for m in results.values() if row in m.rows]
        rows.append((row, short(1e3 * float(np.median(np.concatenate(walls))))))
    note = "Median over all episodes, tare included, answers at the tables' times only; one core of a shared machine."
    return _table("Computing time of an episode [ms]", ("method", "time"), rows, note)


def _ahead_of(of: str | None) -> str:
    return f" {AHEAD}: ahead of {of} by more than two standard errors of the paired difference." if of else ""


def _refused(m: Measured) -> str:
    words = ", ".join(f"{row} {count}" for row, count in m.refused.items())
    return f" Not answered, counted as an answer of zero: {words}." if words else ""


def _table(title: str, columns: tuple[str, ...], rows: list[tuple[str, ...]], note: str) -> Table:
    return Table(title, columns, tuple(rows), note, tuple(k for k, row in enumerate(rows) if row[0] in BASELINES))
