"""The report of a comparison as a list of sections: copy `default_report`, change it, hand it to `write_report`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from armload.arms import Arm
from armload.inertia import NAMES
from armload.lab.report import comparison_figures as figures
from armload.lab.report import recording_figures as recordings
from armload.lab.report.html import Section
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, short

if TYPE_CHECKING:
    from armload.lab.evaluation import Comparison, EvaluationRun

_IZZ = NAMES.index("Izz")


def default_report(
    comparison: Comparison, runs: Sequence[EvaluationRun] = (), arm: Arm | None = None, *, introduction: str = ""
) -> list[Section]:
    """What `armload demo` and `armload report` show.

    Args:
        comparison: from `compare`.
        runs: the runs compared; the first one's motion and torques are drawn. Without runs, those are left out.
        arm: the bare arm, for the torques; without it they are left out.
        introduction: paragraphs of your own, put first.
    """
    c = comparison
    sections = [
        Section("Summary", "\n\n".join(filter(None, [introduction, _verdict(c)])), (c.summary(), c.estimates(0))),
        Section(
            "Errors at the end",
            "Mean absolute error over the runs, each method on the same recordings. 1 g·m² is 10⁻³ kg·m².",
            (c.table(),),
            (
                (figures.error_bars(c), f"Mean absolute error after {c.times[-1]:.2f} s{_bars(c)}."),
                (
                    figures.estimates(c),
                    f"Estimates of {c.labels[0]} with each method's own 95 % interval; black lines are the truth. "
                    "Triangles mark estimates beyond the axis.",
                ),
            ),
        ),
        Section(
            "Errors over time",
            "An estimate is worth more the earlier it is right. A learned method that averages its predictions and a "
            "least-squares method that gathers information both improve while the motion goes on.",
            (c.over_time(0), c.over_time(_IZZ)),
            (
                (figures.error_over_time(c, 0), f"Mean absolute error of the mass over time{_bars(c)}."),
                (
                    figures.parameter_over_time(c, 0, _IZZ),
                    f"Izz of {c.labels[0]} over time. " + _averages(c) + "Curves far outside are cut off.",
                ),
            ),
        ),
        Section(
            "Intervals",
            "A method that states an interval can be wrong about its own error. A 95 % interval that holds the truth "
            "in far fewer than 95 % of the runs is too narrow; one that always holds it may be too wide. The share "
            f"rests on {_count(c.labels, 'run')} only.",
            (c.intervals(),),
        ),
    ]
    if runs:
        log = runs[0].recording
        shown = [
            (
                recordings.motion(log),
                f"Joint position and velocity of {runs[0].label}: {log.rate:.0f} Hz, {len(log)} samples.",
            )
        ]
        if arm is not None:
            shown.append((recordings.torques(log, arm), recordings.TORQUES_CAPTION))
        sections.append(Section("The recording", f"Source: {log.source}.", figures=tuple(shown)))
    return [*sections, Section("What this does not prove", _limits(c))]


def _verdict(c: Comparison) -> str:
    """Who is best, by group, and who fails to beat the baselines, in sentences."""
    group_error = {name: c.mae[:, -1, part].mean(axis=1) for name, part in GROUPS.items()}
    own = [m for m, name in enumerate(c.methods) if name not in c.baselines]
    base = [m for m, name in enumerate(c.methods) if name in c.baselines]
    lines = []
    for name, part in GROUPS.items():
        e = group_error[name]
        best = min(own, key=lambda m: e[m])
        value, unit = short(SHOWN_SCALE * float(e[best])), SHOWN_UNITS[part][0]
        lines.append(f"**{name}** {c.methods[best]}, {value} {unit}")
    text = (
        f"{_count(own, 'method')} on {_count(c.labels, 'run')}. "
        + "Smallest mean error at the end: "
        + "; ".join(lines)
        + "."
    )
    behind = []
    for m in own:
        lost = [name for name, e in group_error.items() if e[m] >= min(e[b] for b in base)]
        if lost:
            behind.append(f"{c.methods[m]} ({', '.join(lost)})")
    if behind:
        text += "\n\nNo better than the better of the two baselines: " + "; ".join(behind) + "."
    return text + f"\n\nThe baselines know: {c.prior}. Held out: {c.split}."


def _count(things: Sequence, word: str) -> str:
    return f"{len(things)} {word}" + ("" if len(things) == 1 else "s")


def _bars(c: Comparison) -> str:
    return "" if len(c.labels) == 1 else f", ± one standard deviation over {_count(c.labels, 'run')}"


def _averages(c: Comparison) -> str:
    if not c.averaged:
        return ""
    return f"For {', '.join(c.averaged)}, dots are the mean prediction between two points, lines their running mean. "


def _limits(c: Comparison) -> str:
    text = (
        f"The errors hold for the {_count(c.labels, 'run')} shown: payloads of {c.truth[:, 0].min():.2f} to "
        f"{c.truth[:, 0].max():.2f} kg on these motions of {c.robot}. "
    )
    if len(np.unique(c.truth, axis=0)) == 1:
        text += "One payload says nothing about others. "
    return text + (
        "A method trained on a family of payloads carries that family as a prior; the row of the training mean shows "
        "what the prior alone is worth, the row of same-prior least squares what it is worth together with the "
        "rigid-body model. Spread is over the runs listed, not over arms, worlds or training seeds, "
        "unless the split says so."
    )
