"""One look for all figures: a colour per method, distinct for the colour-blind, readable at page width."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from armload.lab.evaluation import Comparison

# Okabe & Ito, "Color Universal Design", 2008, without the yellow that vanishes on white.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8C6D31", "#332288")
TRUTH = "#000000"
_BASELINES = ("#8A8A8A", "#4D4D4D")
WIDTH = 8.6  # [in] of a figure: the page's width at 96 dpi

_LOOK: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # ships with matplotlib: the same picture on every machine
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.edgecolor": "#555555",
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.6,
    "figure.facecolor": "white",
    "text.parse_math": False,  # a name of a file or folder is no formula, whatever it holds
    "svg.hashsalt": "armload",  # the same comparison gives the same file
    "svg.fonttype": "path",
}


def method_styles(comparison: Comparison) -> dict[str, dict]:
    """Colour and line style of every method, the same in all figures of a comparison; baselines are grey and dashed."""
    return styles_of(comparison.methods, comparison.baselines)


def styles_of(methods: Sequence[str], baselines: Sequence[str]) -> dict[str, dict]:
    """Colour and line style by method; `baselines` are those of the methods that are grey and dashed."""
    styles, own = {}, [name for name in methods if name not in baselines]
    for k, name in enumerate(own):
        dash = ("-", (0, (5, 1.5)), (0, (2, 1)))[min(k // len(COLOURS), 2)]
        styles[name] = {"color": COLOURS[k % len(COLOURS)], "linestyle": dash}
    for k, name in enumerate(baselines):
        styles[name] = {"color": _BASELINES[k % 2], "linestyle": (":", "--")[k % 2]}
    return styles


@contextmanager
def look() -> Iterator[None]:
    """The style sheet, for the time of drawing and of saving; nothing global remains."""
    import matplotlib as mpl

    with mpl.rc_context(_LOOK), warnings.catch_warnings():
        # a name in a script that the one font lacks is drawn as boxes: whoever reads can do nothing about it
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from")
        yield


def new_figure(height: float) -> Figure:
    """An empty figure of page width and `height` [in], drawn by the Agg backend without pyplot's global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def logarithmic(ax: Axes) -> None:
    """Make the y axis logarithmic, with plain numbers at its ticks: matplotlib's own are formulas, which `look` leaves
    unread."""
    from matplotlib.ticker import LogFormatter

    class Plain(LogFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            return f"{x:g}" if super().__call__(x, pos) else ""

    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(Plain())
    ax.yaxis.set_minor_formatter(Plain())


def whole(axis: Axis, most: int = 9) -> None:
    """At most so many ticks, at whole numbers: there is no half of a log, a payload or a session."""
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(most, integer=True, min_n_ticks=1))
