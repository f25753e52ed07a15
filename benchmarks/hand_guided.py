"""Identification while a person guides the arm by hand, as when a robot is taught.

    python benchmarks/hand_guided.py [--seeds 6] [--jobs 1] [--quick]

A simulated Panda (another real-like arm for every seed, a tare of the empty arm) holds a payload nobody declared. While
its enabling button is pressed it compensates the gravity of what was declared
(`armload.simulation.GravityCompensation`) and a person leads it: one hand
at the flange, the other at the elbow, each a spring and damper towards a point that
follows a slow random path and wanders by about a centimetre. When the button is let go, the robot holds its pose. The
joints' torque sensors see the hands as they see the payload. Each method is given

    guided    the samples while the person guides
    all       the whole log, pauses included
    pauses    the samples of the pauses, when nobody touches
    led       another log: the robot is stiff, carries the payload and follows the hand's force (admittance control)

Writes benchmarks/results/hand_guided.json, docs/pictures/hand_guided.png and the table in docs/why.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop import PAYLOADS, SETTLE, tare_of
from numpy.typing import NDArray
from script import markdown_table, mean_and_spread, rounded
from study_of_arms import Study

from armload.arms import Arm
from armload.estimators import Identifier
from armload.identification import METHODS
from armload.inertia import InertialParameters
from armload.lab.report.style import COLOURS, look, new_figure
from armload.motion import FourierMotion, Motion, random_motion
from armload.recording import Recording
from armload.simulation import GravityCompensation, JointImpedance, Sensors, World, torque_controlled

LOGS = ("guided", "all", "pauses", "led")
TRIED = ("hybrid", "map-gp", "rls-filter")
GUIDED, HELD = 3.0, 2.0  # [s] button pressed, button let go
ROUNDS = 5
SHOWN = 1  # seed of the session in the figure
GRIP = 0.3  # [s] a hand takes to grip before, and to leave after
CALM = 0.2  # [s] more that a pause must have lasted to count
ELBOW = "panda_link4"
# of the order of a human arm's (Gomi & Osu, J. Neuroscience 18, 1998); our choice
STIFFNESS, DAMPING = 300.0, 30.0  # [N/m], [N·s/m]
TURNING, TURN_DAMPING = 10.0, 0.5  # [N·m/rad], [N·m·s/rad]
EVERY = 4  # [ms] a hand's push is computed anew
WANDER = 0.008  # [m] rms in each axis
DRAG = 20.0  # [N·s/m] of flange speed, against which a robot under admittance control is led; our choice
CALMER = 0.7  # of the travel a random motion may have: a person is not as quick as a robot


@dataclass(frozen=True)
class Schedule:
    """When the button is pressed: `rounds` times GUIDED seconds guided, then HELD seconds let go."""

    rounds: int = ROUNDS

    @property
    def duration(self) -> float:
        return self.rounds * (GUIDED + HELD)

    def guided(self, t: Any) -> Any:
        """Whether the arm is guided at t [s]."""
        return (np.asarray(t) % (GUIDED + HELD) < GUIDED) & (np.asarray(t) >= 0.0)

    def way(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """How much of the path is behind at t, 0 … 1: from rest to rest in every round."""
        done = np.clip(t, 0.0, self.duration)
        k = np.minimum(done // (GUIDED + HELD), self.rounds - 1)
        return (k + _smooth(np.clip((done - k * (GUIDED + HELD)) / GUIDED, 0.0, 1.0))) / self.rounds

    def grip(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """How firmly the hands hold at t, 0 … 1."""
        since = np.asarray(t) % (GUIDED + HELD)
        leaving = np.clip(1.0 - (since - GUIDED) / GRIP, 0.0, 1.0) * (t >= 0.0)
        coming = np.clip(1.0 - (GUIDED + HELD - since) / GRIP, 0.0, 1.0)
        return _smooth(np.maximum(leaving, coming))

    def untouched(self, t: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether a pause has lasted long enough, and no hand is there."""
        since = t % (GUIDED + HELD)
        return (since > GUIDED + GRIP + CALM) & (since < GUIDED + HELD - GRIP)


def _smooth(x: Any) -> Any:
    """0 to 1 from rest to rest, least jerk."""
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def wander(t: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A hand's unsteadiness at t (N,) [s]: (N, 3) [m], slow, in changing directions."""
    frequency, phase = rng.uniform(0.2, 1.2, size=(8, 3)), rng.uniform(0.0, 2.0 * np.pi, size=(8, 3))
    waves = np.cos(2.0 * np.pi * frequency * t[:, None, None] + phase)
    return WANDER * np.sqrt(2.0 / len(frequency)) * waves.sum(axis=1)


class Person:
    """Two hands as springs and dampers: (t, q, dq) → joint torque. What they push with is kept in `force` [N]."""

    def __init__(self, robot: Arm, path: Motion, schedule: Schedule, seed: int) -> None:
        self._robot, self._elbow = robot, replace(robot, frame=ELBOW)
        rng = np.random.default_rng([seed, 7])
        self._t = np.arange(-SETTLE, schedule.duration + 0.01, 1e-3)
        q = path.position(path.duration * schedule.way(self._t))
        self._turn, flange = robot.frame_pose(q)
        elbow = self._elbow.frame_pose(q[:, : self._elbow.n])[1]
        self._flange, self._at_elbow = flange + wander(self._t, rng), elbow + wander(self._t, rng)
        self._speed = np.gradient(self._flange, 1e-3, axis=0), np.gradient(self._at_elbow, 1e-3, axis=0)
        self._grip = schedule.grip(self._t)
        self._torque = np.zeros(robot.n)
        self.force: dict[float, float] = {}

    def __call__(self, t: float, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        k = round((t - self._t[0]) / 1e-3)
        if k % EVERY == 0:
            self._torque = self._push(t, k, q, dq)
        return self._torque

    def _push(self, t: float, k: int, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        grip = self._grip[k]
        if grip == 0.0:
            self.force[t] = 0.0
            return np.zeros_like(q)
        (R,), (p,) = self._robot.frame_pose(q[None])
        J = self._robot.frame_motion(q[None]).jacobian[0]
        omega, v = np.split(J @ dq, 2)
        force = R.T @ (STIFFNESS * (self._flange[k] - p) + DAMPING * self._speed[0][k]) - DAMPING * v
        away = R.T @ self._turn[k]
        axis = 0.5 * np.array([away[2, 1] - away[1, 2], away[0, 2] - away[2, 0], away[1, 0] - away[0, 1]])
        torque = J.T @ np.concatenate([TURNING * axis - TURN_DAMPING * omega, force])
        m = self._elbow.n
        (R,), (p,) = self._elbow.frame_pose(q[None, :m])
        J = self._elbow.frame_motion(q[None, :m]).jacobian[0, 3:]
        other = R.T @ (STIFFNESS * (self._at_elbow[k] - p) + DAMPING * self._speed[1][k]) - DAMPING * (J @ dq[:m])
        torque[:m] += J.T @ other
        self.force[t] = float(grip * np.linalg.norm(force))
        return grip * torque


class Leader:
    """A hand that leads a stiff robot along a path: DRAG times the flange's speed, and its own unsteadiness."""

    def __init__(self, robot: Arm, path: Motion, seed: int) -> None:
        self._robot, rng = robot, np.random.default_rng([seed, 8])
        self._t = np.arange(-SETTLE, path.duration + 0.01, 1e-3)
        speed = np.gradient(robot.frame_pose(path.position(self._t))[1], 1e-3, axis=0)
        grip = _smooth(np.clip(self._t / GRIP, 0.0, 1.0))
        self.push = grip[:, None] * (DRAG * speed + STIFFNESS * wander(self._t, rng))
        self._torque = np.zeros(robot.n)

    def __call__(self, t: float, q: NDArray[np.float64], _: NDArray[np.float64]) -> NDArray[np.float64]:
        k = round((t - self._t[0]) / 1e-3)
        if k % EVERY == 0:
            R = self._robot.frame_pose(q[None])[0][0]
            self._torque = self._robot.frame_motion(q[None]).jacobian[0, 3:].T @ (R.T @ self.push[k])
        return self._torque


class Taught:
    """Gravity compensation while the button is pressed, holding the pose at which it was let go otherwise."""

    def __init__(self, model: Arm, schedule: Schedule) -> None:
        self._model, self._schedule = model, schedule
        self._yield, self._hold = GravityCompensation(model), None

    def __call__(self, t: float, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._schedule.guided(t):
            self._hold = None
            return self._yield(t, q, dq)
        if self._hold is None:
            still = np.zeros((len(q), 2))
            self._hold = JointImpedance(self._model, FourierMotion(q, still, still, period=1.0))
        return self._hold(t, q, dq)


def guide(
    robot: Arm, world: World, held: InertialParameters, schedule: Schedule, seed: int
) -> tuple[Recording, NDArray[np.float64]]:
    """Guide the arm along a random path: its log, and time and force (2, N) of the hand at the flange [s, N]."""
    path = random_motion(robot, 4000 + seed, duration=schedule.rounds * GUIDED, harmonics=3).scaled(CALMER)
    person, start = Person(robot, path, schedule, seed), path.position([0.0])[0]
    law, lasting = Taught(robot, schedule), schedule.duration
    run = torque_controlled(robot, law, start, lasting, held, world=world, external=person, settle=SETTLE)
    push = np.array(list(person.force.items())).T
    return Sensors.panda(robot).observe(run.recording, seed), push[:, push[0] >= 0.0]


def lead(robot: Arm, world: World, held: InertialParameters, seed: int) -> tuple[Recording, NDArray[np.float64]]:
    """Lead the stiff arm along another path: its log, and the hand's force (N,) [N]."""
    path = random_motion(robot, 5000 + seed, duration=ROUNDS * GUIDED, harmonics=3).scaled(CALMER)
    hand, start = Leader(robot, path, seed), path.position([0.0])[0]
    law, lasting = JointImpedance(robot, path), path.duration
    run = torque_controlled(robot, law, start, lasting, held, world=world, external=hand, settle=SETTLE)
    return Sensors.panda(robot).observe(run.recording, 100 + seed), np.linalg.norm(hand.push, axis=1)


def judged(identifier: Identifier, log: Recording, held: InertialParameters) -> dict[str, Any]:
    """What a method says of a log, against the truth."""
    estimate = identifier.run(log)
    away, half = np.abs(estimate.phi - held.phi), 1.96 * estimate.std
    return {
        "method": identifier.name,
        "mass_kg": float(estimate.phi[0]),
        "mass_half_width_kg": float(half[0]),
        "mass_error_kg": float(away[0]),
        "first_moment_error_gm": 1e3 * float(np.linalg.norm(away[1:4])),
        "mass_covered": bool(away[0] <= half[0]),
        "covered_of_ten": int(np.sum(away <= half)),
    }


def measure(robot: Arm, seed: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """One row per log and method; and for a figure, the hybrid's mass over time of the session SHOWN."""
    world, (name, held) = World.real_like(robot, seed), list(PAYLOADS.items())[seed % len(PAYLOADS)]
    tare, schedule = tare_of(robot, world, seed), Schedule()
    methods = {method: METHODS[method].make(robot, tare) for method in TRIED}
    log, (at, push) = guide(robot, world, held, schedule, seed)
    led, force = lead(robot, world, held, seed)
    parts = {
        "guided": log.select(schedule.guided(log.t)),
        "all": log,
        "pauses": log.select(schedule.untouched(log.t)),
        "led": led,
    }
    rows, guiding = [], push[schedule.guided(at)]
    pushes = {"guided": guiding, "all": guiding, "pauses": np.zeros(1), "led": force}
    for part, seen in parts.items():
        for method in TRIED:
            row = judged(methods[method], seen, held)
            rows.append(
                {
                    "seed": seed,
                    "payload": name,
                    "true_mass_kg": held.mass,
                    "log": part,
                    **row,
                    "push_mean_N": float(pushes[part].mean()),
                }
            )
    if seed != SHOWN:
        return rows, {}
    curves: dict[str, Any] = {"push": [at.tolist(), push.tolist()], "mass": held.mass}
    for part in ("guided", "pauses"):
        trace = methods["hybrid"].trace(parts[part], every=200)
        curves[part] = np.array([(e.t, e.phi[0], 1.96 * e.std[0]) for e in trace]).T.tolist()
    return rows, curves


def summarise(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean and standard deviation over the seeds, per log and method; coverage as a share."""
    out = []
    for part in LOGS:
        for method in TRIED:
            mine = [row for row in rows if (row["log"], row["method"]) == (part, method)]
            entry: dict[str, Any] = {"log": part, "method": method, "seeds": len(mine)}
            relative = [100.0 * row["mass_error_kg"] / row["true_mass_kg"] for row in mine]
            entry["mass_error_percent"] = mean_and_spread(relative)
            entry["first_moment_error_gm"] = mean_and_spread([row["first_moment_error_gm"] for row in mine])
            entry["mass_covered"] = sum(row["mass_covered"] for row in mine)
            entry["covered_of_all_percent"] = float(np.mean([10.0 * row["covered_of_ten"] for row in mine]))
            entry["push_mean_N"] = float(np.mean([row["push_mean_N"] for row in mine]))
            out.append(entry)
    return out


SAID = {
    "guided": "only while guided",
    "all": "the same with its pauses",
    "pauses": "only the pauses",
    "led": "all, led by force while the robot is stiff",
}


def table(summary: list[dict[str, Any]]) -> str:
    """The summary as Markdown."""
    columns = "samples given", "the hand pushes [N]", "method", "mass error [%]", "first moment error [g·m]"
    columns += "mass within its 95 % interval", "of all ten [%]"
    rows = [
        (
            SAID[entry["log"]],
            f"{entry['push_mean_N']:.0f}",
            entry["method"],
            rounded(*entry["mass_error_percent"]),
            rounded(*entry["first_moment_error_gm"]),
            f"{entry['mass_covered']} of {entry['seeds']}",
            f"{entry['covered_of_all_percent']:.0f}",
        )
        for entry in summary
    ]
    return markdown_table(columns, "lrlrrrr", rows)


def draw(_: Any, rows: list[dict[str, Any]], curves: dict[str, Any], file: Path) -> None:
    """One session over time, and all sessions."""
    schedule, colour = Schedule(), dict(zip(TRIED, COLOURS, strict=False))
    with look():
        figure = new_figure(3.9)
        grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 2.2), width_ratios=(1.25, 1.0))
        push, mass = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        t, force = curves["push"]
        push.plot(t, force, color="#555555", lw=1.2)
        push.set(ylabel="hand at the\nflange [N]", xticklabels=[], ylim=(0, None))
        push.set_title(f"a person guides, {curves['mass']:g} kg held (shaded: lets go)")
        for part, said, shade in (
            ("pauses", "from the pauses", COLOURS[0]),
            ("guided", "from what was guided", COLOURS[3]),
        ):
            at, value, half = np.array(curves[part])
            mass.fill_between(at, value - half, value + half, color=shade, alpha=0.25, lw=0, step="post")
            mass.plot(at, value, color=shade, label=said, drawstyle="steps-post", marker=".", ms=3)
        mass.axhline(curves["mass"], color="black", lw=0.9, ls="--", label="truth")
        mass.set(xlabel="time [s]", ylabel="mass, hybrid, 95 % [kg]", ylim=(-0.3, 1.7 * curves["mass"]))
        mass.legend(loc="upper right", ncols=3, columnspacing=1.0, handlelength=1.4)
        for axes in (push, mass):
            axes.set_xlim(0, schedule.duration)
            for k in range(schedule.rounds):
                axes.axvspan(k * (GUIDED + HELD) + GUIDED, (k + 1) * (GUIDED + HELD), color="#EEEEEE", lw=0, zorder=0)
        every = figure.add_subplot(grid[:, 1])
        for shift, method in zip((-0.22, 0.0, 0.22), TRIED, strict=True):
            for k, part in enumerate(LOGS):
                mine = [row for row in rows if (row["log"], row["method"]) == (part, method)]
                error = [max(100.0 * row["mass_error_kg"] / row["true_mass_kg"], 0.05) for row in mine]
                covered = np.array([row["mass_covered"] for row in mine])
                at, error = np.full(len(error), k + shift), np.array(error)
                every.plot(
                    at[covered], error[covered], "o", color=colour[method], ms=5, label=method if k == 2 else None
                )
                every.plot(at[~covered], error[~covered], "o", color=colour[method], ms=5, mfc="none")
        every.set(yscale="log", xlim=(-0.5, 3.5), xticks=range(4), ylabel="error of the mass [%]")
        every.set_xticklabels(["guided", "with its\npauses", "pauses\nonly", "led by\nforce"])
        every.set_title("all sessions (open: outside its 95 % interval)")
        every.grid(axis="x", visible=False)
        every.legend(loc="lower left")
        figure.savefig(file, dpi=100)


STUDY = Study(
    name="hand_guided",
    mark="hand guided",
    seeds=6,
    conditions={
        "arm": "panda, World.real_like, one per seed; Sensors.panda; 20 s of tare on another motion",
        "schedule": f"{ROUNDS} times {GUIDED:g} s guided, {HELD:g} s held; {ROUNDS * GUIDED:g} s led",
        "hands": f"{STIFFNESS:g} N/m, {DAMPING:g} N·s/m, wander {1e3 * WANDER:g} mm rms; flange and {ELBOW}",
    },
    measure=measure,
    summarise=summarise,
    table=table,
    draw=draw,
)

if __name__ == "__main__":
    STUDY.run()
