"""How far answers hold on arms that measure motor current: windows of a real pair, and heavy payloads in simulation.

    ARMLOAD_REAL_DATA=FOLDER python benchmarks/motor_side.py [--cases 40] [--arms ur10e,ur5e] [--worlds real_like]

Real: every window of 1, 2 and 4 s of the loaded UR10e (2.805 kg) in which a joint moves, with the unloaded run as a
tare and without one. Simulated: boxes of 0.5 to 1 times what the arm is rated for, on another arm, motion (half of them
with stops) and seed in each case, without a tare and with one of 20 s on another motion; the first 1, 2 and 6 s. Each
is one `identify`. Writes benchmarks/results/motor_side.json and a table of docs/real_arms.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from real_logs import data
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Arm, Recording, arm, read_recording
from armload.arms import rated_mass
from armload.identification import identify
from armload.lab.episodes.motion_kinds import MotionSource
from armload.payloads import Payload, draw_payload
from armload.simulation import Run, Sensors, World, simulate_many

LOAD = 2.805  # [kg] on the real UR10e
LENGTHS = (1.0, 2.0, 4.0)  # [s] of the real log's windows
TIMES = (1.0, 2.0, 6.0)  # [s] since a simulated run began
MOVES = 0.05  # [rad/s] of the fastest joint, at its fastest: slower windows show a standing arm
KINDS = ("reference", "point-to-point", "long", "pick-and-place")
FIRST_SEED = 77_000  # nothing is trained on it


def asked_of(log: Recording, robot: Arm, tare: Recording | None, truth: NDArray) -> dict[str, Any]:
    """What `identify` says of a log, against the payload's mass, or all ten parameters (10,) of it."""
    answer = identify(log, robot, tare=tare)
    half = 0.5 * (answer.phi_high - answer.phi_low)
    inside = (answer.phi_low[: len(truth)] <= truth) & (truth <= answer.phi_high[: len(truth)])
    return {
        "error": float(answer.phi[0] - truth[0]),
        "half": float(half[0]),
        "inside": inside.tolist(),
        "interval": answer.interval,
        "determined": bool(answer.determined[0]),
        "share": float(truth[0]),
    }


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Of many answers: errors and half-widths of the mass, and how many intervals held, with its standard error."""
    error = np.abs([x["error"] for x in found])
    share = error / np.array([x["share"] for x in found])
    inside = np.array([x["inside"] for x in found])
    calibrated = np.array([x["interval"] == "calibrated" for x in found])
    told = np.array([x["determined"] for x in found])
    held = inside[:, 0]
    out = {
        "answers": len(found),
        "mean_error_kg": round(float(error.mean()), 3),
        "mean_error_percent": round(100 * float(share.mean()), 1),
        "error_percent_5_50_95": np.percentile(100 * share, [5, 50, 95]).round(1).tolist(),
        "bias_kg": round(float(np.mean([x["error"] for x in found])), 3),
        "mean_half_width_kg": round(float(np.mean([x["half"] for x in found])), 3),
        "mass_inside": round(float(held.mean()), 3),
        "of_calibrated": [int(held[calibrated].sum()), int(calibrated.sum())],
        "of_determined": [int(held[told].sum()), int(told.sum())],
    }
    return out if inside.shape[1] == 1 else out | {"all_inside": round(float(inside.mean()), 3)}


def real() -> dict[str, Any]:
    """Windows of the loaded run."""
    robot = arm("ur10e")
    loaded, tare = (read_recording(data() / f"ur10e_{x}.csv", robot) for x in ("loaded_2805g", "unloaded"))
    out, end = {}, loaded.t[-1]
    for length in LENGTHS:
        starts = np.arange(loaded.t[0], end - length, length)
        windows = [w for s in starts if np.abs((w := loaded.between(s, s + length)).dq).max() > MOVES]
        for name, before in (("tare", tare), ("no tare", None)):
            found = [asked_of(w, robot, before, np.array([LOAD])) for w in windows]
            out[f"{length:g} s, {name}"] = summary(found)
            say(f"real {length:g} s, {name}: {out[f'{length:g} s, {name}']}")
    return out


def heavy(robot: Arm, seed: int) -> Payload:
    """Boxes of half of what the arm is rated for, or more."""
    rated = rated_mass(robot)
    drawn = (draw_payload("boxes", 1000 * seed + k, rated) for k in range(1000))
    return next(box for box in drawn if 0.5 * rated <= box.parameters.mass <= rated)


def simulated(name: str, worlds: str, count: int) -> dict[str, Any]:
    """Heavy payloads on simulated arms."""
    robot = arm(name)
    source, sensors = MotionSource(robot), Sensors.of(robot)
    runs, tares, boxes = [], [], []
    for k in range(count):
        seed = FIRST_SEED + k
        motion = source.draw(KINDS[k % len(KINDS)], np.random.default_rng([seed, 0]), TIMES[-1])
        before = source.draw("long", np.random.default_rng([seed, 1]), 20.0, "", source.centre(motion), 0.3)
        world = getattr(World, worlds)(robot, seed)
        boxes.append(heavy(robot, seed))
        runs.append(Run(motion, boxes[-1], world, sensors, seed))
        tares.append(Run(before, None, world, sensors, seed + 500_000))
    logs = simulate_many(robot, runs, rate=200.0, duration=TIMES[-1], workers=1)
    empty = simulate_many(robot, tares, rate=200.0, duration=20.0, workers=1)
    out = {}
    for what in ("no tare", "tare"):
        for time in TIMES:
            found = [
                asked_of(log.between(0.0, time), robot, tare if what == "tare" else None, box.parameters.phi)
                for log, tare, box in zip(logs, empty, boxes, strict=True)
            ]
            out[f"{time:g} s, {what}"] = summary(found)
            say(f"{name} {worlds} {time:g} s, {what}: {out[f'{time:g} s, {what}']}")
    return out


def table(result: dict[str, Any]) -> str:
    """A row for each kind of log."""
    rows = []
    for group, kinds in result.items():
        for kind, found in kinds.items() if isinstance(kinds, dict) else ():
            if "answers" not in found:
                continue
            time, tare = kind.split(", ")
            low, middle, high = found["error_percent_5_50_95"]
            rows.append(
                [
                    "real UR10e, 2.805 kg" if group == "real_ur10e" else f"simulated {group.split(', ')[0]}",
                    {"tare": "yes", "no tare": "no"}[tare],
                    time,
                    str(found["answers"]),
                    f"{middle:g} ({low:g} … {high:g})",
                    f"{found['mean_half_width_kg']:.2f}",
                    f"{100 * found['mass_inside']:.0f} %",
                    "{} of {}".format(*found["of_calibrated"]),
                ]
            )
    columns = (
        "log",
        "tare",
        "length",
        "answers",
        "error of the mass [%]",
        "half-width [kg]",
        "inside",
        "of calibrated",
    )
    return markdown_table(columns, "lllrrrrr", rows)


def main() -> None:
    asked = options(__doc__, cases=40, arms="ur10e,ur5e", worlds="real_like")
    result = {"simulated_cases": asked.cases, "real_ur10e": real()}
    for worlds in asked.worlds.split(","):
        for name in asked.arms.split(","):
            result[f"{name}, {worlds}"] = simulated(name, worlds, asked.cases)
    write("motor_side", result)
    write_table(ROOT / "docs" / "real_arms.md", "motor side", table(result))


if __name__ == "__main__":
    main()
