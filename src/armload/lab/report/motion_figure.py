"""What a motion does beside the limits of each joint: position, velocity, acceleration and torque over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from armload.arms import Arm
from armload.arms.units import heading, marked
from armload.errors import ReportError
from armload.lab.report.style import COLOURS, look, new_figure
from armload.motion import Motion, check_joints, rated_load
from armload.runtime.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INSTANTS = 600
_WRITTEN = 0.17  # of an axis's height, which a number at its edge takes
_EDGE = "#B00020"  # of the limits


def motion_figure(motion: Motion, arm: Arm) -> Figure:
    """A row for each joint, a column for each quantity; limits as lines, the torque empty and with the rated payload.

    A limit far beyond what the motion uses is written at the edge instead of drawn.

    Raises:
        MotionError: the motion has another number of joints than the arm.
    """
    check_joints(motion, arm)
    t = np.linspace(0.0, motion.duration, _INSTANTS)
    q, dq, ddq = motion(t)
    limits, load = arm.limits, rated_load(arm)
    curves = [("position", [q], limits.position_low, limits.position_high)]
    for what, x, most in (("velocity", dq, limits.velocity), ("acceleration", ddq, limits.acceleration)):
        curves.append((what, [x], -most, most))
    torques = [arm.torque(q, dq, ddq)] + ([] if load is None else [arm.with_payload(load).torque(q, dq, ddq)])
    curves.append(("torque", torques, -limits.effort, limits.effort))
    with look():
        figure = new_figure(1.15 * arm.n + 0.6)
        axes = figure.subplots(arm.n, len(curves), sharex=True, squeeze=False)
        for column, (what, lines, low, high) in enumerate(curves):
            axes[0, column].set_title(heading(what, limits.slides))
            for j in range(arm.n):
                axis = axes[j, column]
                for k, values in enumerate(lines):
                    axis.plot(t, values[:, j], color=COLOURS[k], lw=1.3)
                _limit(axis, np.concatenate([x[:, j] for x in lines]), float(low[j]), float(high[j]))
                axis.tick_params(labelsize=7)
        for j, name in enumerate(arm.joint_names):
            short = name.removeprefix(f"{arm.name}_").removesuffix("_joint")
            axes[j, 0].set_ylabel(marked(short, limits.slides, j).replace(" ", "\n"), fontsize=8)
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        held = "" if load is None else "; torque empty (blue) and with the rated payload (orange)"
        figure.suptitle(f"{motion.name} on {arm.name}: limits in red{held}", fontsize=9.5)
    return figure


def write_motion_figure(motion: Motion, arm: Arm, path: str | Path) -> None:
    """The figure as PNG, PDF or SVG, by the ending of the file.

    Raises:
        ReportError: the file cannot be written.
    """
    figure = motion_figure(motion, arm)
    try:
        with look(), replacing(path) as temporary:
            figure.savefig(temporary, format=Path(path).suffix.lstrip(".") or "png", dpi=150)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise ReportError(f"{path} cannot be written: {reason}") from None


def _limit(axis, values: np.ndarray, low: float, high: float) -> None:
    """Lines at the limits where they are near, else their numbers at the edge."""
    span = max(float(np.ptp(values)), 0.02)
    least, most = float(values.min()), float(values.max())
    bottom, top = least - 0.15 * span, most + 0.15 * span
    written: list[str] = []
    for at, edge in ((low, "bottom"), (high, "top")):
        if not np.isfinite(at):
            continue
        if (at > bottom - 1.2 * span) if edge == "bottom" else (at < top + 1.2 * span):
            axis.axhline(at, color=_EDGE, lw=0.9)
            bottom, top = min(bottom, at - 0.05 * span), max(top, at + 0.05 * span)
        else:
            y = 0.03 if edge == "bottom" else 0.97
            axis.text(0.99, y, f"{at:.3g}", transform=axis.transAxes, ha="right", va=edge, fontsize=6, color=_EDGE)
            written.append(edge)
    # room for the numbers: no curve, and no line of a limit, comes to where they stand
    for _ in written:
        if "bottom" in written:
            bottom = min(bottom, (least - _WRITTEN * top) / (1.0 - _WRITTEN))
        if "top" in written:
            top = max(top, (most - _WRITTEN * bottom) / (1.0 - _WRITTEN))
    axis.set_ylim(bottom, top)
