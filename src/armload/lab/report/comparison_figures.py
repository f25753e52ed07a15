"""Figures of a comparison: errors as bars and over time, estimates with their intervals, one parameter over time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.inertia import NAMES, Z95
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS
from armload.lab.report.style import TRUTH, look, method_styles, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from armload.lab.evaluation import Comparison

_TITLES = ("mass", "first moment", "inertia about the frame's origin")
_LOG_FROM = 30.0  # ratio of largest to smallest error from which an axis becomes logarithmic


def error_bars(comparison: Comparison, at: int = -1) -> Figure:
    """Mean absolute error of every method and parameter at times[at], as in Fig. 4-7 of Taie et al. 2024."""
    styles = method_styles(comparison)
    mae, spread = SHOWN_SCALE * comparison.mae[:, at], SHOWN_SCALE * comparison.spread[:, at]
    with look():
        figure, axes = _three_axes()
        for ax, part, unit, title in _groups(axes):
            values = mae[:, part]
            positive = values[(values > 0) & np.isfinite(values)]
            log = positive.size > 0 and positive.max() > _LOG_FROM * positive.min()
            floor = 0.5 * positive.min() if log else 0.0
            width = 0.8 / len(comparison.methods)
            for m, name in enumerate(comparison.methods):
                x = np.arange(values.shape[1]) + (m - 0.5 * (len(comparison.methods) - 1)) * width
                height = np.maximum(values[m], floor)
                down = np.minimum(spread[m, part], height - floor)  # an error bar ends where the axis does
                ax.bar(
                    x,
                    height - floor,
                    0.92 * width,
                    bottom=floor,
                    color=styles[name]["color"],
                    label=name if ax is axes[0] else "_nolegend_",
                    hatch="////" if name in comparison.baselines else None,
                    edgecolor="white",
                    linewidth=0.0,
                    yerr=None if len(comparison.labels) == 1 else np.stack([down, spread[m, part]]),
                    error_kw={"elinewidth": 0.9, "ecolor": "#222222", "capsize": 1.5},
                )
            if log:
                ax.set_yscale("log")
                ax.set_ylim(bottom=floor)
            ax.set_xticks(np.arange(values.shape[1]), NAMES[part])
            ax.grid(axis="x", visible=False)
            ax.set_title(title + (", logarithmic" if log else ""))
            ax.set_ylabel(f"mean absolute error [{unit}]")
        _legend(figure, axes[0])
    return figure


def estimates(comparison: Comparison, run: int = 0) -> Figure:
    """Estimates of one run at the end, with the methods' own 95 % intervals, beside the truth."""
    styles = method_styles(comparison)
    with look():
        figure, axes = _three_axes()
        count = len(comparison.methods)
        for ax, part, unit, title in _groups(axes):
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
            ax.set_xticks(places, NAMES[part])
            ax.grid(axis="x", visible=False)
            ax.set_title(title)
            ax.set_ylabel(f"estimate [{unit}]")
        _legend(figure, axes[0])
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
            ax.set_yscale("log")
        _time_axis(ax, comparison)
        ax.set_ylabel(f"mean absolute error of {NAMES[parameter]} [{unit}]")
        _legend(figure, ax)
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
        _legend(figure, ax)
    return figure


def _three_axes() -> tuple[Figure, list[Axes]]:
    """Mass and first moments above, inertia below: the three have their own unit."""
    figure = new_figure(6.2)
    grid: Any = figure.add_gridspec(2, 2, width_ratios=(1, 2.6))
    return figure, [figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, :])]


def _groups(axes: list[Axes]) -> Iterator[tuple[Axes, slice, str, str]]:
    """Axes, parameters, unit and title of the three groups."""
    for ax, part, title in zip(axes, GROUPS.values(), _TITLES, strict=True):
        yield ax, part, SHOWN_UNITS[part][0], title


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


def _legend(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    room = 120  # characters of legend text that fit beside each other, 7 of them for each line and gap
    ncols = len(labels)
    while ncols > 1 and ncols * (7 + max(map(len, labels))) > room and sum(len(x) + 7 for x in labels) > room:
        ncols -= 1
    ncols = -(-len(labels) // -(-len(labels) // ncols))  # rows of equal length
    figure.legend(handles, labels, loc="outside upper center", ncols=ncols)
