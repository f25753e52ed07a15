"""The curves of the page: which parameters share a plot, in which colours, and what of their numbers is shown."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES, UNITS

# Okabe & Ito, "Color Universal Design", 2008: distinct for the colour-blind
COLOURS = ((0, 114, 178), (213, 94, 0), (0, 158, 115))
_WIDER = 1.5  # times the narrowest present interval that is shown beyond the values
_UNKNOWN = 1e9  # half-width of an interval of which nothing is known, in any unit
_ALIKE = 5.0  # times the narrowest: present intervals up to this wide are shown whole

HEIGHT = 122  # [px] of a plot
PADDING = (8, 14, 0, 0)  # [px] above, right, below, left
# uPlot takes the least of 1, 2, 2.5, 5, 10, … that leaves `space` [px] between two ticks: at most twice as much. The y
# axis has HEIGHT − 8 − 24 px: at uPlot's own 30 px between them that can mean one tick, at half of it at least three.
AXES = ({"size": 24, "gap": 2, "ticks": {"size": 4}}, {"size": 58, "gap": 3, "ticks": {"size": 4}, "space": 15})


class Group(NamedTuple):
    """Parameters of one plot: their places in phi, and how many of the unit it shows are one in SI.

    uPlot writes no more than three decimals beside a tick: moments, which are small, are shown in thousandths.
    """

    title: str
    places: tuple[int, ...]
    scale: float = 1.0

    @property
    def unit(self) -> str:
        """That the plot shows."""
        return ("" if self.scale == 1.0 else "10⁻³ ") + UNITS[self.places[0]]


GROUPS = (
    Group("mass", (0,)),
    Group("first moments", (1, 2, 3), 1e3),
    Group("moments of inertia", (4, 7, 9), 1e3),
    Group("products of inertia", (5, 6, 8), 1e3),
)


def series_of(group: Group) -> tuple[dict[str, Any], ...]:
    """uPlot's series: time, then for each parameter the ends of its interval, the truth and, above it, the value."""
    out: list[dict[str, Any]] = [{"label": "t [s]"}]
    for colour, place in zip(COLOURS, group.places, strict=False):
        stroke, name = _css(colour), f"{NAMES[place]} [{group.unit}]"
        out += [
            {"label": f"{name} high", "width": 0, "stroke": _css(colour, 0.0), "points": {"show": False}},
            {"label": f"{name} low", "width": 0, "stroke": _css(colour, 0.0), "points": {"show": False}},
            {"label": f"{name} truth", "width": 2, "stroke": stroke, "dash": (6, 5), "points": {"show": False}},
            {"label": name, "width": 2, "stroke": stroke, "points": {"show": False}},
        ]
    return tuple(out)


def bands_of(group: Group) -> tuple[dict[str, Any], ...]:
    """uPlot's bands: the intervals."""
    return tuple({"series": (4 * k + 1, 4 * k + 2), "fill": _css(COLOURS[k], 0.16)} for k in range(len(group.places)))


def legend_of(group: Group) -> str:
    """One line of HTML that says what the colours are, with units."""
    keys = "".join(
        f'<span style="margin-left:0.7em;white-space:nowrap"><span style="color:{_css(colour)}">&#9632;</span>'
        f"&nbsp;{NAMES[place]}</span>"
        for colour, place in zip(COLOURS, group.places, strict=False)
    )
    return f'<b>{group.title}</b> <span style="white-space:nowrap">[{group.unit}]</span>{keys}'


def data_of(group: Group, t: NDArray[np.float64], rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """uPlot's data for `series_of`, in the group's unit, from a history of phi, half-widths and truth.

    Intervals are cut to what leaves the curves readable: the range of the values and of the truth, and somewhat more
    than the present intervals. Every number is finite, as one that is not would leave uPlot without a scale: where
    nobody knows the truth its line lies under that of the value, of the same colour and width, which hides it; before
    the first estimate the values are 0, with intervals as wide as the plot.

    Args:
        t: (N,) [s]. rows: (N, 30).
    """
    if not len(t):
        t, rows = np.array([0.0, 1.0]), np.full((2, 30), np.nan)
    elif len(t) == 1:  # a scale needs two
        t, rows = np.array([t[0] - 0.1, t[0]]), np.repeat(rows, 2, axis=0)
    places = list(group.places)
    phi, half, truth = (group.scale * part[:, places] for part in (rows[:, :10], rows[:, 10:20], rows[:, 20:]))
    phi, half = np.where(np.isfinite(phi), phi, 0.0), np.where(np.isfinite(half), half, _UNKNOWN)
    lowest, highest = _range(phi, half[-1], truth)
    out = [t]
    for k in range(len(places)):
        ends = np.clip([phi[:, k] + half[:, k], phi[:, k] - half[:, k]], lowest, highest)
        value = np.clip(phi[:, k], lowest, highest)
        out += [ends[0], ends[1], np.where(np.isfinite(truth[:, k]), truth[:, k], value), value]
    return tuple(np.ascontiguousarray(x) for x in out)


def _range(phi: NDArray, now: NDArray, truth: NDArray) -> tuple[float, float]:
    """What a plot shows: the middle nine tenths of the values, the present ones, the truth and some room."""
    seen = np.concatenate([np.quantile(phi, [0.05, 0.95], axis=0).ravel(), phi[-1], truth[np.isfinite(truth)]])
    low, high = float(seen.min()), float(seen.max())
    room = max(_WIDER * float(np.min(now)), 0.35 * (high - low), 1e-6)
    room = min(room, max(3.0 * (high - low), 1e-2)) if np.min(now) >= _UNKNOWN else room
    ends = phi[-1] + np.array([[-1.0], [1.0]]) * now
    whole = ends[:, (now <= _ALIKE * np.min(now)) & (now < _UNKNOWN)]  # one far wider is cut
    return min(low - room, whole[0].min(initial=np.inf)), max(high + room, whole[1].max(initial=-np.inf))


def _css(colour: tuple[int, int, int], alpha: float = 1.0) -> str:
    return f"rgba({colour[0]},{colour[1]},{colour[2]},{alpha:g})"
