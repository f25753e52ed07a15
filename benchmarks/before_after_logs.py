"""The logs and streams that before_after.py gives to two versions of armload, simulated once and written as files."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from armload import Recording, arm, read_recording, simulate, write_recording
from armload.arms import payload_regressor, rated_mass
from armload.devices import Simulator
from armload.lab.benchmark.populations import ALL
from armload.lab.episodes import simulate_episodes
from armload.motion import random_motion
from armload.payloads import draw_payload, test_payload
from armload.simulation import Sensors, World

FIRST_SEED, SEEDS = 910_001, 5
RATE, SECONDS, TARE = 500.0, 3.0, 10.0  # [Hz], [s]
TIMES = (0.1, 1.0, SECONDS)  # [s] of the hybrid's answers; the other methods' are at the end
OTHERS = ("map-gp", "map", "ols", "wls", "momentum", "rls", "rls-filter", "log-cholesky", "polynomial")
SLOW, SLOW_ON = ("ekf", "lmi", "rtls"), 6  # logs, of different populations
STREAMS = {"panda": "panda", "panda, tare": "panda", "ur5e": "ur5e", "ur5e, tare": "ur5e"}
STREAM_SEED, EMPTY, LASTS = 910_101, 3.0, 8.0  # [s]
WINDOWS = (10.0, 12.0, 14.0)  # [s] of the real Panda log, with a payload's torque added
Truth = dict[str, dict[str, list[float]]]


def write_episodes(folder: Path, seeds: int) -> Truth:
    """Write every episode's logs and the plan of what to ask of them: (key, method, with its tare, times [s]).

    Returns the truth (10,) of each log, by what the hybrid is asked: relative to its tare, and as if there were none.
    """
    robot, truth, plan = arm("panda"), {}, {}
    for number, population in enumerate(ALL.values()):
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            drawn = population.episodes(robot, seed, 1)[0]
            episode = replace(drawn, duration=SECONDS, tare_duration=min(drawn.tare_duration, TARE))
            name, made = f"{population.name}-{seed}", next(simulate_episodes([episode], rate=RATE))
            tared = made.tare is not None
            write_recording(folder / f"{name}.npz", made.run)
            if made.tare is not None:
                write_recording(folder / f"{name}-tare.npz", made.tare)
            empty = replace(episode, tare_motion=None)
            truth[name] = {"hybrid, tare": made.truth.phi.tolist(), "hybrid, no tare": empty.truth.phi.tolist()}
            methods = OTHERS + ("joint",) * tared + ("difference",) * population.same_motion
            methods += SLOW if seed == FIRST_SEED and number % (len(ALL) // SLOW_ON) == 0 else ()
            plan[name] = [
                ("hybrid, no tare", "hybrid", False, TIMES),
                *[("hybrid, tare", "hybrid", True, TIMES)] * tared,
                *((method, method, tared, (SECONDS,)) for method in methods),
            ]
        print(population.name, "simulated", file=sys.stderr, flush=True)
    (folder / "plan.json").write_text(json.dumps(plan))
    return truth


def write_streams(folder: Path) -> None:
    """Write every stream, empty at first and then with half of what the arm may carry; some with a tare."""
    for name, which in STREAMS.items():
        robot = arm(which)
        conditions = {"world": World.real_like(robot, STREAM_SEED), "sensors": Sensors.of(robot).evenly()}
        payload = draw_payload("boxes", STREAM_SEED, 0.5 * rated_mass(robot))
        motion, held = random_motion(robot, STREAM_SEED), [(EMPTY, payload)]
        live = Simulator(robot, motion, held, speed=None, duration=LASTS, seed=STREAM_SEED, **conditions)
        write_recording(folder / f"{name}.npz", Recording(*map(np.array, zip(*live, strict=True))))  # type: ignore[arg-type]
        if name.endswith("tare"):
            motion = random_motion(robot, STREAM_SEED + 1, duration=TARE, harmonics=10)
            write_recording(folder / f"{name}-tare.npz", simulate(robot, motion, seed=STREAM_SEED, **conditions))
    (folder / "streams.json").write_text(json.dumps(STREAMS))


def real_commands(data: Path, folder: Path) -> dict[str, tuple[str, ...]]:
    """What `armload identify` is asked of the real logs in `data`, as in real_logs.py."""
    loaded, empty, alone = (
        str(data / f"{name}.csv") for name in ("ur10e_loaded_2805g", "ur10e_unloaded", "panda_unloaded_1khz")
    )
    ur10e, panda = ("--robot", str(data / "ur10e.urdf"), "--frame", "tool0"), ("--robot", "panda")
    asked: dict[str, tuple[str, ...]] = {
        "UR10e, 2.805 kg, tare": (loaded, "--tare", empty, *ur10e),
        "UR10e, 2.805 kg": (loaded, *ur10e),
        "UR10e, empty": (empty, *ur10e),
        "Panda, empty": (alone, *panda),
    }
    robot, payload = arm("panda"), test_payload().parameters
    log, tare = read_recording(alone, robot), folder / "real-tare.npz"
    ddq = savgol_filter(log.dq, 101, 3, deriv=1, delta=1 / log.rate, axis=0)
    added = payload_regressor(robot.frame_motion(log.q), log.dq, ddq) @ payload.phi
    carrying, start = Recording(log.t, log.q, log.dq, log.tau + added), float(log.t[0])
    write_recording(tare, log.between(start, start + TARE))
    for at in WINDOWS:
        window, name = folder / f"real-{at:g}.npz", f"Panda, {payload.mass:.2f} kg added, from {at:g} s"
        write_recording(window, carrying.between(start + at, start + at + SECONDS))
        asked[f"{name}, tare"] = (str(window), "--tare", str(tare), *panda)
        asked[name] = (str(window), *panda)
    return asked
