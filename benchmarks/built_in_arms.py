"""Every built-in arm by its name alone: what its description weighs, and what is found on simulated and on real logs.

    ARMLOAD_REAL_DATA=FOLDER python benchmarks/built_in_arms.py

Writes benchmarks/results/built_in_arms.json. Simulated: a box on an arm that is not as its description says, with a
tare along another motion, by the method that `identify` takes. Real: logs of a KUKA of unknown model and of a UR10, no
truth known; beside the answer, how the torque of the bare description fits: measured = slope·model + friction·tanh +
offset, joint by joint, by least squares. Nothing in armload is fitted on them.
"""

from __future__ import annotations

import numpy as np
from real_logs import data
from script import say, write

from armload import Arm, Recording, arm, read_recording
from armload.arms import ARMS, FRICTION_WIDTH
from armload.identification import identify
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.simulation import Sensors, World, simulate

SEEDS = (0, 1)
REAL = (("kuka_lwr_100hz.csv", "iiwa7"), ("kuka_lwr_100hz.csv", "iiwa14"), ("ur10_ros2_bag.db3", "ur10"))


def mass(log: Recording, robot: Arm, tare: Recording | None = None) -> dict:
    """The mass that `identify` answers, and how."""
    answer = identify(log, robot, tare=tare)
    low, high = answer.phi_low[0], answer.phi_high[0]
    return {
        "method": answer.method,
        "mass_kg": round(answer.mass, 3),
        "low_kg": round(low, 3),
        "high_kg": round(high, 3),
        "held": answer.held,
    }


def simulated(robot: Arm, seed: int) -> dict:
    """A box on an arm that differs from its description, with a tare."""
    how = {"world": World.real_like(robot, seed), "sensors": Sensors.of(robot), "rate": 250.0}
    box = draw_payload("boxes", seed, rated=robot.rated_payload).parameters
    log = simulate(robot, random_motion(robot, seed), box, seed=seed, **how)
    tare = simulate(robot, random_motion(robot, seed + 10), seed=seed + 50, **how)
    return {"truth_kg": round(box.mass, 3)} | mass(log, robot, tare)


def fit(log: Recording, robot: Arm) -> dict:
    """By joint: slope of the measured torque over the bare arm's, their correlation, and the rms of what is left."""
    some = slice(None, None, 10)
    q, dq, tau = log.q[some], log.dq[some], log.tau[some]
    model = robot.torque(q, dq, np.gradient(log.dq, log.t, axis=0)[some])
    slope, together, left = [], [], []
    for j in range(robot.n):
        columns = np.column_stack([model[:, j], np.tanh(dq[:, j] / FRICTION_WIDTH), np.ones(len(q))])
        found = np.linalg.lstsq(columns, tau[:, j], rcond=None)[0]
        slope.append(round(float(found[0]), 2))
        together.append(round(float(np.corrcoef(model[:, j], tau[:, j])[0, 1]), 2))
        left.append(round(float(np.std(tau[:, j] - columns @ found)), 2))
    return {
        "rms_model_N_m": np.round(model.std(axis=0), 2).tolist(),
        "slope": slope,
        "correlation": together,
        "rms_left_N_m": left,
    }


def main() -> None:
    folder, arms = data(), {}
    for name, facts in ARMS.items():
        robot = arm(name)
        say(name)
        arms[name] = {
            "moving_links_kg": round(float(robot.link_parameters[:, 0].sum()), 3),
            "weight_kg": facts.weight,
            "simulated": [simulated(robot, seed) for seed in SEEDS],
        }
    real = {}
    for file, name in REAL:
        robot = arm(name)
        log = read_recording(folder / file, robot)
        real[f"{file} as {name}"] = mass(log, robot) | fit(log, robot)
    command = "ARMLOAD_REAL_DATA=FOLDER python benchmarks/built_in_arms.py"
    write("built_in_arms", {"command": command, "arms": arms, "real_logs": real})


if __name__ == "__main__":
    main()
