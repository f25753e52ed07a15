"""Figures of a population: errors over time of every method, and how often its intervals hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armload.lab.benchmark.benchmark_tables import Results, row_names
from armload.lab.benchmark.measured import Measured
from armload.lab.report.panels import legend, three_in_a_row
from armload.lab.report.shown import SHOWN_SCALE
from armload.lab.report.style import logarithmic, look, styles_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figures(results: Results) -> dict[str, tuple[tuple[Figure, str], ...]]:
    """(figure, caption) pairs by population; a method looks the same in all of them."""
    names = row_names(results)
    baselines = [row for m in results.values() for row in m.comparison.baselines]
    styles = styles_of(names, list(dict.fromkeys(baselines)))
    return {
        name: (
            (
                error_over_time(m, styles),
                f"{name}: mean absolute error over time, all axes logarithmic; bars are ± one standard error.",
            ),
            (
                coverage_over_time(m, styles),
                f"{name}: share of the 95 % intervals that hold the truth, over time; dashed: 95 %.",
            ),
        )
        for name, m in results.items()
    }


def error_over_time(m: Measured, styles: dict[str, dict]) -> Figure:
    """Mean absolute error by group of parameters, log-log."""
    error = SHOWN_SCALE * m.standard_error(m.grouped)
    with look():
        figure, panels = three_in_a_row()
        for ax, group, k, _, unit in panels:
            for i, row in enumerate(m.rows):
                mean = SHOWN_SCALE * m.grouped[i, :, :, k].mean(axis=0)
                bar = np.minimum(np.nan_to_num(error[i, :, k]), 0.9 * mean)
                ax.errorbar(m.times, mean, yerr=bar, label=row, elinewidth=0.8, **styles[row])
            _over_time(ax, m, group, f"mean absolute error [{unit}]")
            logarithmic(ax)
        legend(figure, figure.axes[0])
    return figure


def coverage_over_time(m: Measured, styles: dict[str, dict]) -> Figure:
    """Share of the intervals that hold the truth, by group of parameters."""
    with look():
        figure, panels = three_in_a_row()
        for ax, group, _, part, _ in panels:
            for i, row in enumerate(m.rows):
                ax.plot(m.times, 100.0 * m.coverage[i, :, part].mean(axis=-1), label=row, marker=".", **styles[row])
            ax.axhline(95.0, color="#000000", linewidth=0.8, linestyle="--")
            _over_time(ax, m, group, "inside the 95 % interval [%]")
            ax.set_ylim(0.0, 102.0)
        legend(figure, figure.axes[0])
    return figure


def _over_time(ax: Any, m: Measured, title: str, label: str) -> None:
    ax.set_xscale("log")
    ax.set_xticks(m.times, [f"{time:g}" for time in m.times])
    ax.set_xticks([], minor=True)
    ax.set_xlabel("time [s]")
    ax.set_ylabel(label)
    ax.set_title(title)
