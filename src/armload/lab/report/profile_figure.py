"""Where a profile knows its arm, and how the arm drifted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.arms import Arm
from armload.errors import ReportError
from armload.lab.report.style import COLOURS, look, new_figure, whole
from armload.runtime.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armload.posterior import Profile

# what a file would say of its making: the same profile makes the same bytes
_UNDATED: dict[str, dict[str, None]] = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
_RANDOM = 1500  # poses of the whole joint space that are shown


def profile_figure(profile: Profile, arm: Arm) -> Figure:
    """Above: the frame's origin over many poses, coloured by what is left unknown of the smooth torque; below: drift.

    The colour is the largest joint's standard deviation over that of an arm of which nothing was seen: 1 is unknown.
    """
    rng = np.random.default_rng(0)
    low, high = np.maximum(arm.limits.position_low, -np.pi), np.minimum(arm.limits.position_high, np.pi)
    poses = np.concatenate([rng.uniform(low, high, size=(_RANDOM, arm.n)), profile.poses])
    unseen = np.sqrt(profile.scales.features[:, : profile.features.pose].mean(axis=1))
    share = (profile.uncertainty(poses) / unseen).max(axis=1)
    places = arm.frame_pose(poses)[1]
    with look():
        figure = new_figure(6.8)
        parts: Any = figure.subfigures(2, 1, height_ratios=[1.5, 1.0])
        above, below = parts
        side, top = above.subplots(1, 2)
        reach = np.hypot(places[:, 0], places[:, 1])
        for ax, x, y, names in (
            (side, reach, places[:, 2], ("distance from the base's axis [m]", "height [m]")),
            (top, places[:, 0], places[:, 1], ("x [m]", "y [m]")),
        ):
            scale = {"vmin": 0, "vmax": 1, "cmap": "viridis"}
            small, large = {"s": 7, "linewidths": 0}, {"s": 16, "edgecolors": "black", "linewidths": 0.3}
            ax.scatter(x[:_RANDOM], y[:_RANDOM], c=share[:_RANDOM], label="any pose", **small, **scale)
            dots = ax.scatter(x[_RANDOM:], y[_RANDOM:], c=share[_RANDOM:], label="of the logs", **large, **scale)
            ax.set_xlabel(names[0])
            ax.set_ylabel(names[1])
            ax.set_aspect("equal", adjustable="datalim")
        side.legend(loc="upper right")
        above.colorbar(dots, ax=[side, top], label="unknown share of the smooth torque")
        ax = below.subplots()
        k = np.arange(len(profile.sessions)) + 1
        for j in range(profile.n):
            dash = "-" if j < len(COLOURS) else "--"
            offsets = [session.offset[j] for session in profile.sessions]
            ax.plot(k, offsets, dash, marker="o", markersize=3, color=COLOURS[j % len(COLOURS)], label=f"joint {j + 1}")
        ax.set_xlabel("session")
        whole(ax.xaxis)
        ax.set_ylabel("offset [N·m]")
        below.legend(*ax.get_legend_handles_labels(), ncols=min(8, profile.n), loc="outside upper center")
    return figure


def write_profile_figure(profile: Profile, arm: Arm, path: str | Path) -> None:
    """The figure as PNG, PDF or SVG, by the ending of the file; it appears whole or not at all.

    Raises:
        ReportError: it cannot be written, or has another ending.
    """
    form = Path(path).suffix.lstrip(".").lower() or "png"
    figure = profile_figure(profile, arm)
    try:
        with look(), replacing(Path(path)) as part:
            figure.savefig(part, format=form, dpi=110, metadata=_UNDATED.get(form))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise ReportError(f"{path} cannot be written: {reason}") from None
