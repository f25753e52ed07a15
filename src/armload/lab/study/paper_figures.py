"""Fig. 4 to 8 of Taie et al. 2024 drawn from finished cells; what is not measured yet is left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.lab.report.panels import bars_of_errors, legend
from armload.lab.report.shown import SHOWN_SCALE, SHOWN_UNITS
from armload.lab.report.style import COLOURS, TRUTH, look, new_figure
from armload.lab.study.counterparts import benchmark_rows, curves, real_rows, training_rows
from armload.lab.study.numbers import Cells
from armload.lab.study.study_tables import BASELINES, LEARNERS, LEAST_SQUARES, TRAINING_MEAN, Row, ensemble_shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_METHODS = (
    LEARNERS["network"],
    LEARNERS["tree"],
    *(LEAST_SQUARES[method] for method in ("rls", "rls-filter", "rls-filter-calibrated")),
    ensemble_shown("network", "standard"),
    *(LEAST_SQUARES[method] for method in ("map", "map-tare")),
)
_COLOUR_OF = dict(zip(_METHODS, COLOURS, strict=True)) | dict(zip(BASELINES, ("#8A8A8A", "#4D4D4D"), strict=True))
_HATCH_OF = {"payloads held out": "////", "real-like arms": "////", "real log": "...."}


def figures(cells: Cells) -> dict[int, Figure]:
    """Figure number → figure, for the figures that have something to show."""
    bars = {
        4: training_rows(cells, 1),
        5: training_rows(cells, 2),
        6: real_rows(cells),
        7: benchmark_rows(cells, reduced=True),
    }
    out = {number: error_bars(rows) for number, rows in bars.items() if any(e is not None for _, e in rows)}
    shown = curves(cells)
    return out | ({8: over_time(shown)} if shown else {})


def error_bars(rows: Sequence[Row]) -> Figure:
    """Mean absolute error of each parameter with its spread, a colour per method; the three units apart."""
    shown = [(label, errors) for label, errors in rows if errors is not None]
    found = {label: (e.mean(axis=0), e.std(axis=0, ddof=1) if len(e) > 1 else None) for label, e in shown}
    return bars_of_errors(found, {label: _style(label) for label in found})


def over_time(shown: dict[str, dict[str, Any]]) -> Figure:
    """Izz of one run: lines are running means (ensembles) or estimates (least squares), dots single estimates."""
    truth = SHOWN_SCALE * float(next(iter(shown.values()))["truth"])
    with look():
        figure = new_figure(3.8)
        ax = figure.add_subplot()
        ax.axhline(truth, color=TRUTH, linewidth=1.2, label="truth")
        for label, curve in shown.items():
            colour = _style(label)["color"]
            dash = ":" if label.startswith(TRAINING_MEAN) else "-"
            ax.plot(curve["t"], SHOWN_SCALE * curve["running"], dash, color=colour, label=label)
            if not np.array_equal(curve["single"], curve["running"]):
                ax.plot(curve["t"], SHOWN_SCALE * curve["single"], ".", color=colour, markersize=3, alpha=0.5)
        ax.set_ylim(truth - 2.0 * abs(truth), truth + 2.0 * abs(truth))  # what overshoots more leaves the picture
        ax.set_xlim(0.0, max(float(curve["t"][-1]) for curve in shown.values()))
        ax.set_xlabel("time since the start of the motion [s]")
        ax.set_ylabel(f"Izz [{SHOWN_UNITS[-1]}]")
        legend(figure, ax)
    return figure


def _style(label: str) -> dict[str, Any]:
    """A method has one colour in all figures; a hatch tells what it was measured on."""
    parts = [part for part in label.split(", ") if not part.startswith("≤")]
    hatch = _HATCH_OF.get(parts[-1])
    if parts[0] in LEARNERS.values() and parts[-1] != "standardised":
        parts = parts[:1]
    colour = _COLOUR_OF[", ".join(parts)]
    if label.startswith(TRAINING_MEAN):
        hatch = "////"
    return {"color": colour} | ({"hatch": hatch, "edgecolor": "white", "linewidth": 0.0} if hatch else {})
