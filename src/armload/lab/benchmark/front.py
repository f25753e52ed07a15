"""The benchmark's first page: one picture and one table, drawn and written from the summary (benchmark.json)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armload.lab.benchmark.benchmark_tables import MISSING, SUBJECTS
from armload.lab.benchmark.populations import ALL, REPEAT
from armload.lab.benchmark.rows import BASELINES, TARED
from armload.lab.benchmark.targets import MISSED, NOT_CLEAR, REACHED
from armload.lab.evaluation import Table
from armload.lab.report import Section
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS
from armload.lab.report.style import logarithmic, look, new_figure, styles_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Summary = Mapping[str, Any]  # `results.summary_json`
_RIVALS = ("map-gp", "rls-filter")
_TIMES = (1.0, 6.0)  # [s] of the table
_EARLY = 0.1  # [s] until which an answer is called early
_ROWS = """`hybrid` is the default method. `map-gp` is the same physics without the learned parts. `rls-filter` is the
benchmark of the paper, recursive least squares behind a momentum observer; `+tare` marks its virtual calibration. Two
rows are baselines. `training mean` always answers the mean of the population's payloads. `same-prior least squares` has
their mean and covariance as its prior."""


def front(summary: Summary, picture: str = "", appendix: str = "") -> list[Section]:
    """The first page as sections for `write_markdown`.

    Args:
        summary: the benchmark as numbers (`results.summary_json`).
        picture, appendix: paths of the picture and of the page with all tables, as the page links to them.
    """
    of = _subject(summary)
    drawn = f"![Errors over time and coverage]({picture})\n\n*{_caption(summary)}*\n\n" if picture else ""
    parts = [Section("In plain words", drawn + "\n\n".join([_what(summary), _ROWS]), (table(summary),))]
    if of is not None:
        parts.append(Section(f"Where {of} loses", _losses(summary, of)))
        parts.append(Section("Targets", _targets(summary)))
    if appendix:
        parts.append(
            Section("Appendix", f"All tables, by population, time, method and parameter: [tables]({appendix}).")
        )
    return parts


def table(summary: Summary) -> Table:
    """Mean absolute error of the mass by population, and how often the subject's intervals hold."""
    of = _subject(summary)
    methods = (*([of] if of else []), *(name for name in _RIVALS if name != of), BASELINES[0])
    shown = [(method, time) for time in _TIMES for method in methods if (method, time) != (BASELINES[0], _TIMES[1])]
    rows = []
    for name, found in _populations(summary).items():
        cells = [_mass(summary, found["methods"], method, time) for method, time in shown]
        if of is not None:
            asked = of in found["methods"]
            cells.append(f"{100 * np.mean(found['methods'][of]['coverage']):.0f}" if asked else MISSING)
        rows.append((f"{name}: {ALL[name].tries}", *cells))
    heads = [f"{method}, {time:g} s" for method, time in shown]
    note = "± is the standard error over the episodes. `rls-filter` is calibrated wherever there is a tare."
    if of is not None:
        heads.append("intervals that hold [%]")
        note += (
            f" The last column: 95 % intervals of `{of}` that contain the truth, all ten parameters and all times "
            "together."
        )
    return Table("Mean absolute error of the mass [g]", ("population", *heads), tuple(rows), note)


def picture(summary: Summary) -> Figure:
    """Errors over time by group of parameters, and coverage, on the first population."""
    name, found = next(iter(_populations(summary).items()))
    times, methods = np.array(summary["times"]), found["methods"]
    styles = styles_of(list(methods), [row for row in methods if row in BASELINES])
    lost = {(loss["time"], loss["group"]) for loss in summary["losses"] if loss["population"] == name}
    of = _subject(summary)
    with look():
        figure = new_figure(6.2)
        axes: Any = figure.subplots(2, 2)
        for ax, (group, part) in zip(axes.flat, GROUPS.items(), strict=False):
            for method, numbers in methods.items():
                # the mean of the parameters' standard errors is at least that of their mean
                mean, error = (_means(numbers[key], part) for key in ("mae", "standard_error"))
                bar = np.minimum(np.nan_to_num(error), 0.9 * mean)
                ax.errorbar(times, mean, yerr=bar, label=method, elinewidth=0.9, **styles[method])
                if method == of:
                    marked = np.array([(float(t), group) in lost for t in times])
                    ax.plot(times[marked], mean[marked], "o", ms=11, mfc="none", mec="#D55E00", zorder=5)
            logarithmic(ax)
            ax.set_title(group)
            ax.set_ylabel(f"mean absolute error [{SHOWN_UNITS[part][0]}]")
        last = axes.flat[-1]
        lowest = 85.0  # [%]
        for method, numbers in methods.items():
            share = 100.0 * np.mean(np.array(numbers["coverage"], dtype=float), axis=1)
            last.plot(times, share, marker=".", **styles[method])
            lowest = min(lowest, 5.0 * np.floor(share.min() / 5.0 - 1.0))
        last.axhline(95.0, color="#000000", linewidth=0.8)
        last.set(title="95 % intervals that contain the truth", ylabel="all ten parameters [%]", ylim=(lowest, 101.0))
        for ax in axes.flat:
            ax.set_xscale("log")
            ax.set_xticks(times, [f"{time:g}" for time in times])
            ax.set_xticks([], minor=True)
            ax.set_xlabel("time [s]")
        handles, labels = axes.flat[0].get_legend_handles_labels()
        if lost:
            handles.append(last.plot([], [], "o", ms=11, mfc="none", mec="#D55E00")[0])
            labels.append(f"another method is ahead of {of}")
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _caption(summary: Summary) -> str:
    name, found = next(iter(_populations(summary).items()))
    return (
        f"Population {name}, {found['episodes']} episodes: mean absolute errors over time, with bars of ± one standard "
        "error (for a group of parameters at most that), and coverage. Errors and times are logarithmic."
    )


def _what(summary: Summary) -> str:
    episodes = sum(found["episodes"] for found in summary["populations"].values())
    text = (
        f"{episodes} simulated logs of a {summary['robot']} at {summary['rate']:g} Hz, called episodes, in "
        f"{len(summary['populations'])} populations. Every episode has another arm, payload and motion, unless the "
        "population says otherwise. No method was trained on them, and no real arm is among them. An estimate at time "
        "t uses all samples up to t."
    )
    of = _subject(summary)
    name, found = next(iter(_populations(summary).items()))
    if of is None or of not in found["methods"]:
        return text
    numbers, parts = found["methods"][of], []
    for k, time in enumerate(summary["times"]):
        if time in (0.1, *_TIMES):
            groups = (f"{_round(_means(numbers['mae'], p)[k])} {SHOWN_UNITS[p][0]}" for p in GROUPS.values())
            parts.append(f"after {time:g} s " + ", ".join(groups))
    return text + f"\n\nErrors of `{of}` on `{name}` (mass, first moments, inertia): {'; '.join(parts)}."


def _losses(summary: Summary, of: str) -> str:
    losses = summary["losses"]
    compared = sum(of in found["methods"] for found in _populations(summary).values())
    count = 3 * len(summary["times"]) * compared
    text = (
        f"`{of}` is compared with every other row at {len(summary['times'])} times, for three groups of parameters, on "
        f"{compared} populations: {count} cells. In {len(losses)} cells another row is ahead by more than two standard "
        "errors of the paired difference."
    )
    parts = []
    for title, chosen in (
        (f"Up to {_EARLY:g} s", [loss for loss in losses if loss["time"] <= _EARLY]),
        ("Later", [loss for loss in losses if loss["time"] > _EARLY]),
    ):
        if chosen:
            worst = max(chosen, key=lambda loss: loss["error"] / loss["better"])
            groups, rows = (Counter(loss[key] for loss in chosen) for key in ("group", "which"))
            ahead = f"Ahead in them: {_counts(rows)}. Worst: {_cell(worst)}."
            parts.append(f"- {title}: {len(chosen)} cells ({_counts(groups)}). {ahead}")
    return "\n\n".join([text, *(["\n".join(parts)] if parts else [])])


def _counts(count: Counter[str]) -> str:
    return ", ".join(f"{name} {n}" for name, n in count.items())


def _cell(loss: Mapping[str, Any]) -> str:
    unit = SHOWN_UNITS[GROUPS[loss["group"]]][0]
    values = (f"{_round(SHOWN_SCALE * loss[key])} {unit}" for key in ("error", "better"))
    return f"{loss['group']} on `{loss['population']}` after {loss['time']:g} s, {' against '.join(values)}"


def _targets(summary: Summary) -> str:
    count = Counter(target["verdict"] for target in summary["targets"])
    text = f"Of {count.total()} targets, " + ", ".join(f"{count[v]} {v}" for v in (REACHED, NOT_CLEAR, MISSED)) + "."
    missed = [
        f"- {t['target']}: {t['group']} on `{t['population']}` after {t['time']:g} s, {t['ratio']:.2f} times"
        for t in summary["targets"]
        if t["verdict"] == MISSED
    ]
    return text + ("\n\nMissed:\n\n" + "\n".join(missed) if missed else "")


def _subject(summary: Summary) -> str | None:
    rows = {row for found in summary["populations"].values() for row in found["methods"]}
    return next((name for name in SUBJECTS if name in rows), None)


def _populations(summary: Summary) -> dict[str, Any]:
    """All but the repeated payload; that one, if it is all there is."""
    shown = {name: found for name, found in summary["populations"].items() if name != REPEAT}
    return shown or dict(summary["populations"])


def _mass(summary: Summary, methods: Mapping[str, Any], name: str, time: float) -> str:
    found = next((methods[row] for row in (name + TARED, name) if row in methods), None)
    if found is None or time not in summary["times"]:
        return MISSING
    k = summary["times"].index(time)
    error, spread = (SHOWN_SCALE * (found[key][k][0] or np.nan) for key in ("mae", "standard_error"))
    return _round(error) + (f" ± {spread:.{_digits(error)}f}" if np.isfinite(spread) else "")


def _means(values: Any, part: slice) -> NDArray[np.float64]:
    """Mean over a group of parameters (T,), in shown units; None reads as not a number."""
    return SHOWN_SCALE * np.array(values, dtype=float)[:, part].mean(axis=1)


def _round(value: float) -> str:
    return f"{value:.{_digits(value)}f}"


def _digits(value: float) -> int:
    return 0 if value >= 10.0 else 1 if value >= 1.0 else 2
