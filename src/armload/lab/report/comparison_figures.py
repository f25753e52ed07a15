"""Figures of a comparison: errors as bars and over time, estimates with their intervals, one parameter over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armload.inertia import NAMES, Z95
from armload.lab.report.panels import bars_of_errors, legend, parameters, three_panels
from armload.lab.report.shown import SHOWN_SCALE, SHOWN_UNITS
from armload.lab.report.style import TRUTH, logarithmic, look, method_styles, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from armload.lab.evaluation import Comparison


def error_bars(comparison: Comparison) -> Figure:
    """Mean absolute error of every method and parameter at the last time, as in Fig. 4-7 of Taie et al. 2024."""
    styles = {
        name: {"color": style["color"], "edgecolor": "white", "linewidth": 0.0}
        | ({"hatch": "////"} if name in comparison.baselines else {})
        for name, style in method_styles(comparison).items()
    }
    spread = [None] * len(styles) if len(comparison.labels) == 1 else comparison.spread[:, -1]
    return bars_of_errors(
        dict(zip(comparison.methods, zip(comparison.mae[:, -1], spread, strict=True), strict=True)), styles
    )


def estimates(comparison: Comparison, run: int = 0) -> Figure:
    """Estimates of one run at the end, with the methods' own 95 % intervals, beside the truth."""
    styles = method_styles(comparison)
    with look():
        figure, panels = three_panels()
        count = len(comparison.methods)
        for ax, title, part, unit in panels:
            truth = SHOWN_SCALE * comparison.truth[run, part]
            places = np.arange(len(truth))
            ax.hlines(truth, places - 0.45, places + 0.45, color=TRUTH, linewidth=1.6, label="truth", zorder=3)
            for m, name in enumerate(comparison.methods):
                phi = SHOWN_SCALE * comparison.phi[m, run, -1, part]
                half = SHOWN_SCALE * Z95 * comparison.std[m, run, -1, part]
                ax.errorbar(
                    places + (m - 0.5 * (count - 1)) * 0.8 / count,
                    phi,
                    yerr=np.where(np.isfinite(half), half, 0.0),
                    fmt="s" if name in comparison.baselines else "o",
                    markersize=4,
                    elinewidth=1.0,
                    color=styles[name]["color"],
                    label=name,
                )
            _limit(ax, SHOWN_SCALE * comparison.phi[:, run, -1, part], truth)
            _mark_cut_off(ax, comparison, run, part, styles)
            parameters(ax, part)
            ax.set_title(title)
            ax.set_ylabel(f"estimate [{unit}]")
        legend(figure, panels[0][0])
    return figure


def error_over_time(comparison: Comparison, parameter: int = 0) -> Figure:
    """Mean absolute error of one parameter over time; bands are ± one standard deviation over the runs."""
    styles, unit = method_styles(comparison), SHOWN_UNITS[parameter]
    mae, spread = SHOWN_SCALE * comparison.mae[:, :, parameter], SHOWN_SCALE * comparison.spread[:, :, parameter]
    with look():
        figure = new_figure(3.6)
        ax = figure.add_subplot()
        floor = 0.5 * np.min(mae[mae > 0], initial=np.inf)
        for m, name in enumerate(comparison.methods):
            ax.plot(comparison.times, mae[m], label=name, **styles[name])
            if len(comparison.labels) > 1 and name not in comparison.baselines:
                low, high = np.maximum(mae[m] - spread[m], floor), mae[m] + spread[m]
                ax.fill_between(comparison.times, low, high, color=styles[name]["color"], alpha=0.12, linewidth=0)
        if np.isfinite(floor):
            logarithmic(ax)
        _time_axis(ax, comparison)
        ax.set_ylabel(f"mean absolute error of {NAMES[parameter]} [{unit}]")
        legend(figure, ax)
    return figure


def parameter_over_time(comparison: Comparison, run: int = 0, parameter: int = 9) -> Figure:
    """One parameter of one run over time with its truth, as in Fig. 8 of Taie et al. 2024 (there: Izz).

    For a learned method the line is the cumulative average; dots are the mean prediction between two points of time,
    recovered from that average: (n₂·x̄₂ − n₁·x̄₁)/(n₂ − n₁).
    """
    styles, unit = method_styles(comparison), SHOWN_UNITS[parameter]
    with look():
        figure = new_figure(3.8)
        ax = figure.add_subplot()
        truth = SHOWN_SCALE * comparison.truth[run, parameter]
        ax.axhline(truth, color=TRUTH, linewidth=1.2, label="truth")
        values = SHOWN_SCALE * comparison.phi[:, run, :, parameter]
        _limit(ax, values[:, len(comparison.times) // 3 :], np.array([truth]))
        low, high = ax.get_ylim()
        for m, name in enumerate(comparison.methods):
            averaged = name in comparison.averaged
            label = f"{name}, cumulative average" if averaged else name
            late = values[m, len(comparison.times) // 2 :]
            label += " (off scale)" if not np.any((late > low) & (late < high)) else ""
            ax.plot(comparison.times, values[m], label=label, **styles[name])
            if averaged:
                n = comparison.samples[m, run]
                new = np.diff(n) > 0
                single = np.diff(n * values[m])[new] / np.diff(n)[new]
                middle = 0.5 * (comparison.times[1:] + comparison.times[:-1])[new]
                ax.plot(middle, single, ".", markersize=4, color=styles[name]["color"], alpha=0.6)
        _time_axis(ax, comparison)
        ax.set_ylabel(f"{NAMES[parameter]} [{unit}]")
        legend(figure, ax)
    return figure


def _limit(ax: Axes, values: np.ndarray, truth: np.ndarray) -> None:
    """Limits that show the truth and most methods: one that is far off must not flatten the rest."""
    far = np.nanmax(np.abs(values - truth[0] if truth.size == 1 else values - truth), axis=-1).ravel()
    half = 2.5 * np.nanmedian(far[np.isfinite(far)]) if np.isfinite(far).any() else 0.0
    half = max(half, 0.15 * float(np.max(np.abs(truth))), 1e-6)
    ax.set_ylim(float(truth.min()) - half, float(truth.max()) + half)


def _mark_cut_off(ax: Axes, comparison: Comparison, run: int, part: slice, styles: dict[str, dict]) -> None:
    """A triangle at the edge for every estimate beyond it."""
    low, high = ax.get_ylim()
    for m, name in enumerate(comparison.methods):
        phi = SHOWN_SCALE * comparison.phi[m, run, -1, part]
        x = np.arange(len(phi)) + (m - 0.5 * (len(comparison.methods) - 1)) * 0.8 / len(comparison.methods)
        for edge, beyond, marker in ((low, phi < low, "v"), (high, phi > high, "^")):
            for place in x[beyond]:
                ax.plot(place, edge, marker, color=styles[name]["color"], markersize=6, clip_on=False)


def _time_axis(ax: Axes, comparison: Comparison) -> None:
    if len(comparison.times) > 1:
        ax.set_xlim(comparison.times[0], comparison.times[-1])
    else:  # a line of one point would not be seen
        for line in ax.lines:
            line.set_marker("o")
    ax.set_xlabel("time since the start of the motion [s]")
