"""What a model-based controller gains from the identified payload: tracking error and external-torque residual.

    python benchmarks/closed_loop.py [--seeds 8] [--jobs 1] [--quick]

A simulated Panda under joint torque control at 1 kHz (`armload.simulation.JointImpedance`: inverse dynamics of the
model, libfranka's example stiffness). Every seed is another arm that differs from its model as real ones do
(`World.real_like`), with other motions. It runs empty for 20 s (the tare), then 6 s with a payload nobody declared;
from these two logs the default method identifies it. A third motion is then followed with nothing declared, with what
was identified, and with the truth. The residual is a momentum observer's of 20 1/s that knows the declared payload, on
what the sensors show; nothing touches the arm. Writes benchmarks/results/closed_loop.json,
docs/pictures/closed_loop.png and the table in docs/why.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import markdown_table, mean_and_spread, rounded
from study_of_arms import Study

from armload.arms import Arm
from armload.inertia import InertialParameters
from armload.lab.report.style import COLOURS, look, new_figure
from armload.motion import Motion, random_motion
from armload.posterior import HybridIdentifier
from armload.recording import Recording
from armload.regression import FilteredRegression
from armload.simulation import JointImpedance, Sensors, World, torque_controlled

DECLARED = ("nothing", "identified", "truth")
SETTLE = 1.0  # [s] before a log begins
OBSERVER = 20.0  # [1/s]
STARTING = 0.3  # [s] until the observer has started
# boxes held off the flange's axis: mass [kg], centre of mass [m], edges [m]
_BOXES = (
    (0.5, (0.03, 0.00, 0.06), (0.08, 0.06, 0.10)),
    (1.5, (0.05, -0.03, 0.09), (0.12, 0.10, 0.16)),
    (2.8, (-0.04, 0.05, 0.10), (0.16, 0.14, 0.18)),
)


def box(mass: float, com: tuple[float, float, float], edges: tuple[float, float, float]) -> InertialParameters:
    """A homogeneous box about the flange."""
    square = np.square(edges)
    return InertialParameters.from_com(mass, com, mass / 12.0 * np.diag(square.sum() - square), "panda_link8")


PAYLOADS = {f"{mass:g} kg": box(mass, com, edges) for mass, com, edges in _BOXES}


def follow(
    robot: Arm,
    world: World,
    motion: Motion,
    held: InertialParameters | None,
    told: InertialParameters | None,
    seed: int,
) -> tuple[Recording, Recording]:
    """A motion followed with one payload held and one declared: the noise-free log, and what the sensors show."""
    law = JointImpedance(robot if told is None else robot.with_payload(told), motion)
    start, lasting = motion.position([0.0])[0], motion.duration
    truth = torque_controlled(robot, law, start, lasting, held, world=world, settle=SETTLE).recording
    return truth, Sensors.panda(robot).observe(truth, seed)


def tare_of(robot: Arm, world: World, seed: int) -> Recording:
    """20 s of the empty arm on a motion of its own."""
    return follow(robot, world, random_motion(robot, 1000 + seed, duration=20.0, harmonics=10), None, None, seed)[1]


def errors(robot: Arm, motion: Motion, truth: Recording) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Tracking error of the joints (N, n) [rad] and of the flange (N,) [m]."""
    wanted = motion.position(truth.t)
    rows = slice(None, None, 10)
    away = robot.frame_pose(truth.q[rows])[1] - robot.frame_pose(wanted[rows])[1]
    return truth.q - wanted, np.linalg.norm(away, axis=1)


def residual(robot: Arm, told: InertialParameters | None, log: Recording) -> NDArray[np.float64]:
    """External torque (N, n) [N·m] that a momentum observer believes in, with the declared payload in its model."""
    model = robot if told is None else robot.with_payload(told)
    return -FilteredRegression(model, OBSERVER)(log.t, log.q, log.dq, log.tau)[0]


def rms(x: NDArray[np.float64], axis: int | None = None) -> Any:
    return np.sqrt(np.mean(np.square(x), axis=axis))


def measure(robot: Arm, seed: int) -> tuple[list[dict[str, Any]], dict[str, dict[str, list[float]]]]:
    """One row per payload and declaration; and for a figure, the heaviest payload's errors and residuals over time.

    Of the residuals, those of joint 2 of the first arm.
    """
    world = World.real_like(robot, seed)
    identifier = HybridIdentifier(robot, tare_of(robot, world, seed))
    excitation, work = (random_motion(robot, base + seed, duration=6.0) for base in (2000, 3000))
    rows, curves = [], {}
    for k, (name, held) in enumerate(PAYLOADS.items()):
        log = follow(robot, world, excitation, held, None, 10 * seed + k)[1]
        found = identifier.run(log).parameters
        for declared, told in zip(DECLARED, (None, found, held), strict=True):
            truth, seen = follow(robot, world, work, held, told, 10 * seed + k)
            joints, flange = errors(robot, work, truth)
            started = seen.t - seen.t[0] > STARTING
            external = residual(robot, told, seen)[started]
            shown = {"t": truth.t[::10], "flange": 1e3 * flange, "t seen": seen.t[started], "external": external[:, 1]}
            curves[declared] = {name: values.tolist() for name, values in shown.items()}
            rows.append(
                {
                    "seed": seed,
                    "payload": name,
                    "declared": declared,
                    "declared_mass_kg": 0.0 if told is None else told.mass,
                    "joint_error_mrad": 1e3 * rms(joints),
                    "joint_error_mrad_per_joint": np.round(1e3 * rms(joints, 0), 3).tolist(),
                    "flange_error_mm": 1e3 * rms(flange),
                    "flange_error_max_mm": 1e3 * flange.max(),
                    "residual_Nm": rms(external),
                    "residual_Nm_per_joint": np.round(rms(external, 0), 4).tolist(),
                    "residual_max_Nm": np.abs(external).max(),
                }
            )
    return rows, curves if seed == 0 else {}


QUANTITIES = {
    "joint_error_mrad": "joints [mrad rms]",
    "flange_error_mm": "flange [mm rms]",
    "residual_Nm": "residual [N·m rms]",
    "residual_max_Nm": "largest residual [N·m]",
}


def summarise(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean and standard deviation over the seeds, per payload and declaration."""
    out = []
    for name in dict.fromkeys(row["payload"] for row in rows):
        for declared in DECLARED:
            mine = [row for row in rows if (row["payload"], row["declared"]) == (name, declared)]
            entry: dict[str, Any] = {"payload": name, "declared": declared, "seeds": len(mine)}
            for quantity in QUANTITIES:
                entry[quantity] = mean_and_spread([row[quantity] for row in mine])
            out.append(entry)
    return out


def table(summary: list[dict[str, Any]]) -> str:
    """The summary as Markdown."""
    rows = [(e["payload"], e["declared"], *(rounded(*e[quantity]) for quantity in QUANTITIES)) for e in summary]
    return markdown_table(("payload", "declared", *QUANTITIES.values()), "ll" + "r" * len(QUANTITIES), rows)


def draw(summary: list[dict[str, Any]], _: Any, curves: dict[str, dict[str, list[float]]], file: Path) -> None:
    """One run over time, and all runs."""
    styles = dict(zip(DECLARED, ((COLOURS[3], "-"), (COLOURS[0], "-"), ("black", (0, (2, 1)))), strict=True))
    names = list(PAYLOADS)
    with look():
        figure = new_figure(5.4)
        (over, outside), (tracking, alarm) = figure.subplots(2, 2)
        for declared in DECLARED:
            (colour, dash), one = styles[declared], curves[declared]
            over.plot(one["t"], one["flange"], color=colour, linestyle=dash, label=f"declared: {declared}")
            outside.plot(one["t seen"], one["external"], color=colour, linestyle=dash, lw=1.2)
        over.set(
            title=f"one run, {names[-1]} held", xlabel="time [s]", ylabel="flange off its path [mm]", ylim=(0, None)
        )
        outside.set(title="the same run, nothing touches the arm", xlabel="time [s]")
        outside.set(ylabel="external torque seen,\njoint 2 [N·m]")
        figure.legend(loc="outside upper center", ncols=3)
        for axes, quantity, label in (
            (tracking, "flange_error_mm", "flange off its path [mm rms]"),
            (alarm, "residual_max_Nm", "largest torque seen\nwithout a touch [N·m]"),
        ):
            for shift, declared in zip((-0.25, 0.0, 0.25), DECLARED, strict=True):
                mean, spread = np.array([entry[quantity] for entry in summary if entry["declared"] == declared]).T
                at = np.arange(len(names)) + shift
                axes.errorbar(at, mean, spread, fmt="o", color=styles[declared][0], ms=6, capsize=3, lw=1.2)
                for x, value, above in zip(at, mean, spread, strict=True):
                    axes.text(x, 1.1 * (value + above), f"{value:.2g}", ha="center", va="bottom", fontsize=8)
            axes.set(xticks=range(len(names)), xticklabels=names, xlim=(-0.5, 2.5), ylabel=label, yscale="log")
            axes.yaxis.set_major_formatter("{x:g}")
            axes.grid(axis="x", visible=False)
            axes.set_ylim(top=1.8 * axes.get_ylim()[1])
        tracking.set_title(f"all runs: mean and spread over {summary[0]['seeds']} arms")
        alarm.set_title("all runs: a weaker collision goes unnoticed")
        figure.savefig(file, dpi=100)


STUDY = Study(
    name="closed_loop",
    mark="closed loop",
    seeds=8,
    conditions={
        "arm": "panda, World.real_like, one per seed; Sensors.panda",
        "controller": "joint impedance with inverse dynamics, moderate_stiffness, 1 kHz, effort limits",
        "identification": "hybrid: 6 s of log with nothing declared, 20 s of tare on another motion",
        "observer_1_per_s": OBSERVER,
    },
    measure=measure,
    summarise=summarise,
    table=table,
    draw=draw,
)

if __name__ == "__main__":
    STUDY.run()
