"""Parts of figures that several of them share: the three groups of parameters side by side, bars of errors, legends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS
from armload.lab.report.style import logarithmic, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOG_FROM = 30.0  # ratio of largest to smallest error from which an axis becomes logarithmic
_ROOM = 120  # characters of legend text that fit beside each other,
_GAP = 7  # as many of them as each line and gap take


def three_panels() -> tuple[Figure, list[tuple[Axes, str, slice, str]]]:
    """Axes, name, parameters and unit of the groups: mass and first moments above, inertia below."""
    figure = new_figure(6.2)
    grid: Any = figure.add_gridspec(2, 2, width_ratios=(1, 2.6))
    axes = (figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, :]))
    return figure, [
        (ax, name, part, SHOWN_UNITS[part][0]) for ax, (name, part) in zip(axes, GROUPS.items(), strict=True)
    ]


def three_in_a_row() -> tuple[Figure, Iterator[tuple[Axes, str, int, slice, str]]]:
    """Axes, name, number, parameters and unit of the groups, side by side."""
    figure = new_figure(4.6)
    axes = (figure.add_subplot(1, 3, k + 1) for k in range(3))
    groups = enumerate(zip(axes, GROUPS.items(), strict=True))
    return figure, ((ax, name, k, part, SHOWN_UNITS[part][0]) for k, (ax, (name, part)) in groups)


def bars_of_errors(
    errors: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64] | None]], styles: Mapping[str, dict[str, Any]]
) -> Figure:
    """Mean absolute error (10,) [SI] of each parameter with its spread, a colour for each label; a spread may be None.

    An axis is logarithmic where the largest error is far above the smallest.
    """
    width, count = 0.8 / len(errors), len(errors)
    with look():
        figure, panels = three_panels()
        for ax, name, part, unit in panels:
            means = SHOWN_SCALE * np.array([mean[part] for mean, _ in errors.values()])
            seen = means[(means > 1e-6) & np.isfinite(means)]
            log = seen.size > 0 and seen.max() > _LOG_FROM * seen.min()
            floor = 0.5 * float(seen.min()) if log else 0.0
            for m, (label, (_, spread)) in enumerate(errors.items()):
                height, up = np.maximum(means[m], floor), None if spread is None else SHOWN_SCALE * spread[part]
                ax.bar(
                    np.arange(means.shape[1]) + (m - 0.5 * (count - 1)) * width,
                    height - floor,
                    0.92 * width,
                    bottom=floor,
                    label=label if ax is panels[0][0] else "_nolegend_",
                    # an error bar ends where the axis does
                    yerr=None if up is None else np.stack([np.minimum(up, height - floor), up]),
                    error_kw={"elinewidth": 0.9, "ecolor": "#222222", "capsize": 1.5},
                    **styles[label],
                )
            if log:
                logarithmic(ax)
                ax.set_ylim(bottom=floor)
            parameters(ax, part)
            ax.set_title(name + (", logarithmic" if log else ""))
            ax.set_ylabel(f"mean absolute error [{unit}]")
        legend(figure, panels[0][0])
    return figure


def parameters(ax: Axes, part: slice) -> None:
    """A tick for each parameter of a group."""
    ax.set_xticks(np.arange(len(NAMES[part])), NAMES[part])
    ax.grid(axis="x", visible=False)


def legend(figure: Figure, ax: Axes) -> None:
    """Above the figure, in as few rows as its width allows, rows of equal length."""
    handles, labels = ax.get_legend_handles_labels()
    columns = len(labels)
    while columns > 1 and columns * (_GAP + max(map(len, labels))) > _ROOM < sum(len(x) + _GAP for x in labels):
        columns -= 1
    columns = -(-len(labels) // -(-len(labels) // columns))
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)
