"""Figures of a recording: how the arm moves, measured torque and the torque of the bare-arm model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import NDArray

from armload.arms import Arm
from armload.lab.report.style import COLOURS, look, new_figure
from armload.recording import Recording
from armload.regression import FilteredRegression, first_order_lag

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS = 600  # drawn at most: a curve is half a page wide
_RATE = 200.0  # [Hz] at which torques are lagged before they are drawn
_GAIN = 50.0  # [1/s] of the lag behind which torques are drawn
TORQUES_CAPTION = (
    "Measured joint torque and what the bare-arm model needs for the same motion, both behind the same lag "
    f"({_GAIN:.0f} 1/s). The shaded difference is the payload, friction and the model's error."
)


def motion(recording: Recording) -> Figure:
    """Joint position and velocity over time."""
    log = recording.select(slice(None, None, -(-len(recording) // _POINTS)))
    t = log.t - log.t[0]
    with look():
        figure = new_figure(4.8)
        upper, lower = figure.subplots(2, 1, sharex=True)
        for j in range(log.n):
            dash = "-" if j < len(COLOURS) else "--"
            style = {"color": COLOURS[j % len(COLOURS)], "linewidth": 1.3, "linestyle": dash}
            upper.plot(t, log.q[:, j], label=f"joint {j + 1}", **style)
            lower.plot(t, log.dq[:, j], **style)
        upper.set_ylabel("position q [rad]")
        lower.set_ylabel("velocity dq [rad/s]")
        lower.set_xlabel("time [s]")
        lower.set_xlim(t[0], t[-1])
        figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=min(8, log.n))
    return figure


def torques(recording: Recording, arm: Arm) -> Figure:
    """Measured joint torque and the bare arm's torque on the same motion: the payload (and friction) is between them.

    Both are drawn behind the lag F = λ/(s + λ), λ = `_GAIN`, so that no acceleration is needed (`regression.rows`).
    """
    t, measured, bare = lagged_torques(recording, arm)
    with look():
        columns = 2
        rows = -(-recording.n // columns)
        figure = new_figure(0.6 + 1.7 * rows)
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
        for ax in axes.ravel()[recording.n :]:
            ax.set_visible(False)
        for j, ax in enumerate(axes.ravel()[: recording.n]):
            ax.fill_between(t, measured[:, j], bare[:, j], color="#56B4E9", alpha=0.3, linewidth=0)
            ax.plot(t, measured[:, j], color=COLOURS[0], linewidth=1.2, label="measured")
            ax.plot(t, bare[:, j], color=COLOURS[3], linewidth=1.2, linestyle=(0, (4, 1.5)), label="bare-arm model")
            ax.set_title(f"joint {j + 1}", loc="left", fontsize=9)
            ax.set_xlim(t[0], t[-1])
            if j % columns == 0:
                ax.set_ylabel("torque [N·m]")
            ax.tick_params(labelbottom=True)
            if j + columns >= recording.n:
                ax.set_xlabel("time [s]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def lagged_torques(recording: Recording, arm: Arm) -> tuple[NDArray, NDArray, NDArray]:
    """Time (K,) since the start, F[tau] and F[tau_bare] (K, n), from where the lag has forgotten its start."""
    log = recording.select(slice(None, None, max(1, int(recording.rate / _RATE))))
    r, _ = FilteredRegression(arm, _GAIN)(log.t, log.q, log.dq, log.tau)
    measured = first_order_lag(log.t, log.tau, _GAIN)
    t = log.t - log.t[0]
    keep = t >= 5.0 / _GAIN
    if keep.sum() < 2:  # a very short log: show it, transient and all
        keep = t >= 0.0
    every = -(-int(keep.sum()) // _POINTS)
    return t[keep][::every], measured[keep][::every], (measured - r)[keep][::every]
