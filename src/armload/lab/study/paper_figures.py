"""Fig. 4 to 8 of Taie et al. 2024 in its form, and below the bars its numbers beside ours; from finished cells.

The text of the paper that is public holds no errors, only by how many percent one method errs less than another: these
are what the lower panels compare.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.inertia import NAMES
from armload.lab.report.panels import parameters
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS
from armload.lab.report.style import COLOURS, TRUTH, logarithmic, look, new_figure
from armload.lab.study.counterparts import benchmark_rows, curves, real_rows, training_rows
from armload.lab.study.numbers import EXACT, Cells, on_many_arms
from armload.lab.study.study_tables import LEARNERS, LEAST_SQUARES, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NETWORKS, _TREES = LEARNERS["network"], LEARNERS["tree"]
_COLOUR = {
    _NETWORKS: COLOURS[0],
    _TREES: COLOURS[1],
    LEAST_SQUARES["rls"]: COLOURS[2],
    LEAST_SQUARES["rls-filter"]: COLOURS[3],
    LEAST_SQUARES["rls-filter-calibrated"]: COLOURS[4],
}
_LOG_FROM = 20.0  # ratio of largest to smallest error from which an axis becomes logarithmic
_RANGE, _LEAST = "#BBBBBB", 1e-4  # of the readings; ratios below are drawn there
_FIGURE_OF = {4: ("fig4-tree-network", "fig4-network-tree"), 5: ("fig5-tree-network", "fig5-tree-network-about")}


def figures(cells: Cells, claims: Sequence[Mapping[str, Any]]) -> dict[int, Figure]:
    """Figure number → figure, for the figures that have something to show."""
    many, out = on_many_arms(cells), {}
    for number, groups in _FIGURE_OF.items():
        rows = _measured([row for row in training_rows(many, number - 3) if "rows" in row[0]], held_out=True)
        chosen = [claim for claim in claims if claim["id"].rpartition("-")[0] in groups]
        if rows:
            out[number] = _bars_and_ratios(rows, {"error of trees over that of networks": chosen}, _TREES)
    if rows := _measured([row for row in real_rows(many) if "log" not in row[0]]):
        out[6] = _bars_and_ratios(rows, {}, "")
    shown = [row for row in benchmark_rows(many) if row[0] in _COLOUR]
    if rows := _measured(shown):
        of = {
            f"error over that of {LEAST_SQUARES[rival]}": [
                claim for claim in claims if claim["id"].rpartition("-")[0] in (f"fig7-network-{to}", f"fig7-tree-{to}")
            ]
            for rival, to in (("rls", "rls"), ("rls-filter", "filter"))
        }
        out[7] = _bars_and_ratios(rows, of, "")
    drawn = {name: curve for name, curve in curves(many).items() if name in _COLOUR}
    return out | ({8: over_time(drawn)} if drawn else {})


def _measured(rows: Sequence[Row], held_out: bool = False) -> list[Row]:
    there = [(label, errors) for label, errors in rows if errors is not None]
    return [(label.split(",")[0] if held_out else label, errors) for label, errors in there]


def _bars_and_ratios(rows: Sequence[Row], below: Mapping[str, Sequence[Mapping[str, Any]]], of: str) -> Figure:
    """Mean absolute errors as bars, the three units apart and logarithmic; below them one panel of ratios for each of
    `below`. of: whose error stands above in the ratio; empty: the claim's own learner."""
    with look():
        figure = new_figure(3.0 + 2.6 * len(below))
        grid: Any = figure.add_gridspec(1 + len(below), 3, width_ratios=(1.6, 3, 6))
        first = None
        for k, (name, part) in enumerate(GROUPS.items()):
            ax = figure.add_subplot(grid[0, k])
            first = first or ax
            _bars(ax, rows, part)
            ax.set_title(name + ", logarithmic" * (ax.get_yscale() == "log"))
            ax.set_ylabel(f"error [{SHOWN_UNITS[part][0]}]")
        for k, (title, claims) in enumerate(below.items()):
            _ratios(figure.add_subplot(grid[1 + k, :]), title, claims, of)
        if first is not None:
            handles, labels = first.get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 3))
    return figure


def _bars(ax: Axes, rows: Sequence[Row], part: slice) -> None:
    """A bar for each method and parameter; what is known exactly has none."""
    width = 0.8 / len(rows)
    for m, (label, errors) in enumerate(rows):
        means = np.zeros(0) if errors is None else SHOWN_SCALE * errors[:, part].mean(axis=0)
        at = np.arange(len(means)) + (m - 0.5 * (len(rows) - 1)) * width
        seen = means > SHOWN_SCALE * EXACT
        hatch = "////" if label.endswith("real-like arms") else None
        colour = _COLOUR[label.split(",")[0]]
        ax.bar(at[seen], means[seen], 0.92 * width, color=colour, label=label, hatch=hatch, edgecolor="white", lw=0.3)
    shown = SHOWN_SCALE * np.concatenate([e[:, part].mean(axis=0) for _, e in rows if e is not None])
    if shown.max() > _LOG_FROM * shown[shown > SHOWN_SCALE * EXACT].min(initial=np.inf):
        logarithmic(ax)
    parameters(ax, part)


def _ratios(ax: Axes, title: str, claims: Sequence[Mapping[str, Any]], of: str) -> None:
    """For each claim the paper's ratio of errors (diamond), ours with its interval (dot), and where it lies under all
    readings of the text (grey)."""
    there = [claim for claim in claims if claim["ours"] is not None]
    sides = {True: _TREES, False: _NETWORKS}
    for tree, name in sides.items():
        own = [claim for claim in there if of or ("-tree-" in claim["id"]) == tree]
        if of and not tree:
            continue
        shift = 0.0 if of else 0.16 if tree else -0.16
        colour = TRUTH if of else _COLOUR[name]
        label = "" if of else f", {name}"
        for k, claim in enumerate(own):
            inverted = bool(of) and claim["id"].startswith("fig4-network")  # the paper calls the networks better
            paper, ours, low, high, least, most = (
                _ratio(claim, key, inverted) for key in ("paper", "ours", "high", "low", *_REACH)
            )
            x = NAMES.index(claim["parameter"]) + shift
            first = k == 0
            ax.plot(
                [x, x],
                sorted((least, most)),
                color=_RANGE,
                lw=5,
                solid_capstyle="butt",
                zorder=1,
                label="ours, all readings" if first and (of or tree) else None,
            )
            ax.plot([x, x], sorted((low, high)), color=colour, lw=1.4, zorder=2)
            ax.plot([x], [ours], "o", color=colour, ms=5, zorder=3, label=f"ours, 95 %{label}" if first else None)
            ax.plot(
                [x], [paper], "D", mfc="white", mec=colour, ms=6, zorder=4, label=f"paper{label}" if first else None
            )
    ax.axhline(1.0, color="#555555", lw=0.9)
    logarithmic(ax)
    ax.set_xlim(-0.5, len(NAMES) - 0.5)
    parameters(ax, slice(0, len(NAMES)))
    ax.set_title(title)
    ax.set_ylabel("ratio of errors")
    if there:
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


_REACH = ("reach-low", "reach-high")


def _ratio(claim: Mapping[str, Any], key: str, inverted: bool) -> float:
    """A claim's percentage as the ratio of errors; a bound that is missing is the number itself."""
    value = claim["reach"][_REACH.index(key)] if key in _REACH else claim[key]
    left = 1.0 - (claim["ours"] if value is None else value) / 100.0
    left = max(left, _LEAST)
    return 1.0 / left if inverted else left


def over_time(shown: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Izz of one run: each ensemble's single answers (dots) and running mean (red in the paper), least squares beside.

    The axis ends at three times the truth: what overshoots more leaves the picture.
    """
    truth = SHOWN_SCALE * float(next(iter(shown.values()))["truth"])
    panels = {
        "ensembles: answers and running mean": [n for n in (_NETWORKS, _TREES) if n in shown],
        "least squares: estimates": [name for name in shown if name not in (_NETWORKS, _TREES)],
    }
    with look():
        figure = new_figure(3.6)
        for k, (title, names) in enumerate(panels.items()):
            ax = figure.add_subplot(1, 2, k + 1)
            ax.axhline(truth, color=TRUTH, lw=1.2, label="truth")
            for name in names:
                curve, colour = shown[name], _COLOUR[name]
                ax.plot(curve["t"], SHOWN_SCALE * curve["running"], color=colour, label=name)
                if not np.array_equal(curve["single"], curve["running"]):
                    ax.plot(curve["t"], SHOWN_SCALE * curve["single"], ".", color=colour, ms=3, alpha=0.5)
            ax.axvline(2.85 if k == 0 else 3.0, color="#999999", lw=0.8, ls=":")
            ax.set_ylim(-truth, 3.0 * truth)
            ax.set_xlim(0.0, max(float(curve["t"][-1]) for curve in shown.values()))
            ax.set_xlabel("time since the start of the motion [s]")
            ax.set_ylabel(f"Izz [{SHOWN_UNITS[-1]}]")
            ax.set_title(title)
            ax.legend(loc="upper right", frameon=True, framealpha=0.9, edgecolor="none")
    return figure
