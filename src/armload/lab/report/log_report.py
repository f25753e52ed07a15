"""The report of a log of an unknown payload: how the arm moved, what it felt, what each method made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from armload.arms import Arm
from armload.estimators import Estimate
from armload.inertia import NAMES, UNITS, Z95
from armload.lab.report import recording_figures as recordings
from armload.lab.report.html import Section
from armload.lab.report.shown import Table
from armload.lab.report.style import COLOURS, look, new_figure
from armload.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS = (slice(0, 1), slice(1, 4), slice(4, 10))
_SETTLED = 0.15  # share of the log after which estimates decide what an axis shows


def log_report(
    recording: Recording, arm: Arm, traces: Mapping[str, Sequence[Estimate]], *, introduction: str = ""
) -> list[Section]:
    """Sections for `write_report`: estimates at the end, estimates over time, the recording.

    Args:
        recording: the log. arm: the bare arm.
        traces: each method's estimates along the log, the last at its end (`Identifier.trace`).
        introduction: paragraphs of your own, put first.
    """
    where = f"{arm.name}, about {arm.frame}; {len(recording)} samples, {recording.duration:.2f} s."
    return [
        Section("Every method", introduction, (_table(traces, where),)),
        Section(
            "Estimates over time",
            "Bands are the 95 % intervals the methods themselves state. No truth is known: methods that agree may "
            "still share an error of the arm's model.",
            figures=tuple(
                (over_time(traces, part), f"{', '.join(NAMES[part])} over time; estimates far outside are cut off.")
                for part in _PANELS
            ),
        ),
        Section(
            "The recording",
            f"Source: {recording.source}.",
            figures=(
                (recordings.motion(recording), f"Joint position and velocity: {recording.rate:.0f} Hz."),
                (recordings.torques(recording, arm), recordings.TORQUES_CAPTION),
            ),
        ),
    ]


def over_time(traces: Mapping[str, Sequence[Estimate]], part: slice) -> Figure:
    """Estimates of some parameters along a log, one panel each, with the methods' own 95 % intervals."""
    names, units = NAMES[part], UNITS[part]
    start = min(trace[0].t for trace in traces.values())
    with look():
        columns = 1 if len(names) == 1 else 3
        rows = -(-len(names) // columns)
        figure = new_figure(0.6 + 2.4 * rows)
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for p, (ax, name, unit) in enumerate(zip(axes, names, units, strict=True), start=part.start):
            settled = []
            for (method, trace), colour in zip(traces.items(), COLOURS, strict=False):
                t = np.array([e.t for e in trace]) - start
                value = np.array([e.phi[p] for e in trace])
                half = Z95 * np.array([e.std[p] for e in trace])
                half = np.where(np.isfinite(half), half, 0.0)
                ax.plot(t, value, color=colour, label=method)
                ax.fill_between(t, value - half, value + half, color=colour, alpha=0.12, linewidth=0)
                settled.append(value[t >= _SETTLED * t[-1]])
            shown = np.concatenate(settled)
            low, high = np.percentile(shown, [2, 98])
            room = max(0.3 * (high - low), 1e-6)
            ax.set_ylim(low - room, high + room)
            ax.set_title(f"{name} [{unit}]", loc="left", fontsize=9)
        for ax in axes[-columns:]:
            ax.set_xlabel("time [s]")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=min(4, len(traces)))
    return figure


def _table(traces: Mapping[str, Sequence[Estimate]], where: str) -> Table:
    """A row for each parameter, a column for each method: as many as there are fit beside each other."""
    rows = []
    for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        last = [(float(trace[-1].phi[k]), Z95 * float(trace[-1].std[k])) for trace in traces.values()]
        cells = (f"{value:+.4f} ± {half:.4f}" if np.isfinite(half) else f"{value:+.4f}" for value, half in last)
        rows.append((f"{name} [{unit}]", *cells))
    note = f"± is half of the method's own 95 % interval. {where}"
    return Table("Estimates at the end", ("parameter", *traces), tuple(rows), note)
