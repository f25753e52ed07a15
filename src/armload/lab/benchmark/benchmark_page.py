"""All tables of the benchmark: one list of sections, as Markdown for the docs and as HTML with figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from armload.lab.benchmark import benchmark_tables as tables
from armload.lab.benchmark.benchmark_run import Size
from armload.lab.benchmark.benchmark_tables import Results, subject
from armload.lab.benchmark.populations import PRIOR, REPEAT
from armload.lab.benchmark.rows import BOUND, left_out
from armload.lab.benchmark.targets import targets_table
from armload.lab.report import Section
from armload.lab.report.shown import GROUPS, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Benchmark"
APPENDIX = "Benchmark: all tables"
_COMMAND = "armload benchmark"
SHOWN = (0.1, 1.0, 6.0)  # [s]
PAIRS = (("hybrid", "map-gp"), ("hybrid", "rls-filter+tare"))
_TARGETS = f"""A cell is one population, time and group of parameters. {tables.AHEAD} marks a row that is ahead by more
than two standard errors of the paired difference."""
_ROWS = f"""Each row is a method of the [catalogue](methods.md), on the same logs as every other row. `+tare` marks
virtual calibration: the method's answer to the tare is subtracted (Kurdas et al., ICRA 2022). The same name without it
ignores the tare and, where a tool was mounted, knows the tool. All other methods use the tare in their own equations.
Two baselines are in every table: the mean of {PRIOR}, and least squares with the mean and covariance of the same
payloads as a prior."""


def sections(
    results: Results, size: Size, figures: Mapping[str, tuple[tuple[Figure, str], ...]] | None = None
) -> list[Section]:
    """The benchmark as sections for `write_report`; without figures, and with fewer tables, for Markdown.

    Args:
        results: what is measured, by population. size: how much was asked for.
        figures: by population, for the report.
    """
    drawn, of = figures or {}, subject(results)
    shown = {name: m for name, m in results.items() if name != REPEAT}
    out = [
        Section(
            "Targets, and where the default method loses",
            _TARGETS,
            (targets_table(results), tables.losses_table(results)),
        ),
        Section("What was run", _what_was_run(results, size), (tables.populations_table(results),)),
    ]
    if shown:
        by_time = tuple(tables.group_table(results, group, time) for group in GROUPS for time in _times(size))
        out.append(Section("Errors by population", _ROWS, by_time))
        widths = tuple(tables.intervals_table(results, time) for time in _times(size))
        own = () if of is None else tuple(tables.own_intervals_table(results, t, of) for t in _times(size)[-2:])
        out.append(
            Section(
                "Intervals", "Coverage: how often the methods' own 95 % intervals contain the truth.", (*widths, *own)
            )
        )
    pairs = tuple(
        tables.paired_table(results, a, b, group)
        for a, b in PAIRS
        if any(a in m.rows and b in m.rows for m in shown.values())
        for group in GROUPS
    )
    if pairs:
        text = "Both methods answer the same episodes, so the difference is known better than either error."
        out.append(Section("Method against method", text, pairs))
    if REPEAT in results:
        text = "The same payload on one arm again and again: how much the answer moves, whatever its error."
        out.append(Section("Repeatability", text, (tables.repeatability_table(results[REPEAT], _times(size)[-2:]),)))
    out.append(Section("Cost", "Computing time of an answer.", (tables.cost_table(results),)))
    for name, m in shown.items():
        detail: list[Table] = [tables.parameter_table(m, time) for time in _times(size)[-2:]]
        if name == "reference" or drawn:
            detail = [*(tables.time_table(m, group, of) for group in GROUPS), *detail]
        efficiency = tables.efficiency_table(m, _times(size)[-2:])
        if efficiency is not None and (name in ("reference", "container") or drawn):
            detail.append(efficiency)
        if name == "reference" or drawn:
            out.append(
                Section(
                    f"Population: {name}", m.population.tries.capitalize() + ".", tuple(detail), drawn.get(name, ())
                )
            )
    return out


def _times(size: Size) -> tuple[float, ...]:
    return tuple(time for time in SHOWN if time in size.times) or size.times[-2:]


def command_of(size: Size) -> str:
    """What measures as much again."""
    usual = Size()
    more = f" --episodes {size.episodes}" if size.episodes != usual.episodes else ""
    return f"{_COMMAND}{more}" + (f" --rate {size.rate:g}" if size.rate != usual.rate else "")


def _what_was_run(results: Results, size: Size) -> str:
    trained = {row: text for m in results.values() for row, text in m.trained.items()}
    split = "; ".join(f"`{row}` was trained on other episodes ({text})" for row, text in trained.items())
    parts = [
        f"`{command_of(size)}` on simulated logs of a {size.robot} at {size.rate:g} Hz, "
        f"{sum(m.runs for m in results.values())} episodes. Split: no method sees these episodes before it answers "
        "them, and nothing is trained on their seeds"
        + (f"; {split}." if split else ".")
        + " All arms are simulated, in the ways their populations say; no real arm is among them.",
        "A time counts from a run's first sample; an estimate rests on all samples up to then.",
        "Cannot take part: " + ", ".join(f"`{name}` ({why})" for name, why in left_out().items()) + ".",
    ]
    unfinished = {name: m.unfinished for name, m in results.items() if m.unfinished}
    if unfinished:
        named = ", ".join(f"{name} ({', '.join(rows)})" for name, rows in unfinished.items())
        parts.append(f"Not finished, and left out of the tables: {named}. The same command goes on.")
    absent = [name for name in size.populations if name not in results]
    if absent:
        parts.append(f"Not measured yet: {', '.join(absent)}.")
    if any(m.bound is None for m in results.values()):
        parts.append(f"The row `{BOUND}` is not measured everywhere: efficiencies are missing there.")
    few = [name for name, m in results.items() if m.runs < 30]
    if few:
        parts.append(f"Fewer than 30 episodes, shares of intervals are coarse: {', '.join(few)}.")
    return "\n\n".join(parts)
