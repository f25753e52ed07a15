"""The README's picture: a Panda on the excitation motion, and the default method's estimate while it moves.

    python benchmarks/readme_picture.py

Writes docs/pictures/identify.png. The logs are those of examples/simulate_two_logs.py: a simulated Panda that differs
from its model as real ones do, and a tare of the empty arm on another motion.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from armload import HybridIdentifier, arm
from armload.motion import random_motion, taie2024
from armload.payloads import test_payload
from armload.simulation import Sensors, World, simulate

TARGET = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "identify.png"
SEED = 1
BLUE, GREY, RED = "#0072b2", "#999999", "#d55e00"


def main() -> None:
    robot, motion, truth = arm("panda"), taie2024(), test_payload().parameters
    world, sensors = World.real_like(robot, SEED), Sensors.panda(robot)
    log = simulate(robot, motion, truth, world=world, sensors=sensors, seed=SEED)
    other = random_motion(robot, SEED, duration=20.0, harmonics=10)
    tare = simulate(robot, other, None, world=world, sensors=sensors, seed=SEED + 1)
    trace = HybridIdentifier(robot, tare).trace(log, every=40)
    t = np.array([e.t for e in trace]) - log.t[0]
    phi, half = np.array([e.phi for e in trace]), 1.96 * np.array([e.std for e in trace])

    figure = Figure(figsize=(9.6, 3.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.15, 1, 1))
    scene = figure.add_subplot(grid[:, 0], projection="3d")
    times = np.linspace(0.0, motion.duration, 7)[:-1]
    q = motion(times)[0]
    _, joints = robot.link_poses(q)
    _, flange = robot.frame_pose(q)
    for k in range(len(times)):
        line = np.vstack([np.zeros(3), joints[k], flange[k]])
        scene.plot(*line.T, color=GREY if k else "black", lw=3 if k == 0 else 1.5, alpha=1 if k == 0 else 0.5)
        scene.scatter(*flange[k], color=RED, s=60, alpha=1 if k == 0 else 0.4)
    scene.set(xlim=(-0.6, 0.6), ylim=(-0.6, 0.6), zlim=(0, 1.2), box_aspect=(1, 1, 1))
    scene.set_title("one motion, joint torque only", fontsize=10)
    scene.tick_params(labelsize=6)

    shown = ((0, "mass [kg]", 1.0), (3, "m·rz [g·m]", 1e3), (1, "m·rx [g·m]", 1e3), (9, "Izz [g·m²]", 1e3))
    for panel, (index, label, scale) in enumerate(shown):
        axes = figure.add_subplot(grid[panel % 2, 1 + panel // 2])
        value, width, true = scale * phi[:, index], scale * half[:, index], scale * truth.phi[index]
        axes.fill_between(t, value - width, value + width, color=BLUE, alpha=0.2, lw=0, label="95 %, calibrated")
        axes.plot(t, value, color=BLUE, label="hybrid, with a tare")
        axes.axhline(true, color="black", lw=0.8, ls="--", label="truth")
        reach = 4.0 * width[len(width) // 2]
        axes.set(ylabel=label, ylim=(true - reach, true + reach), xlim=(0, t[-1]))
        axes.tick_params(labelsize=7)
        if panel % 2:
            axes.set_xlabel("time [s]")
        if panel == 1:
            axes.legend(fontsize=7, frameon=False, loc="upper right")
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(TARGET, metadata={"Software": None})
    print(f"wrote {TARGET.relative_to(TARGET.parents[2])}, {TARGET.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
