"""How long `armload identify` takes on a long log, from the command to the answer.

    python benchmarks/identify_time.py [--seconds 60] [--method hybrid]

A simulated Panda at 1 kHz with 8 % of the samples lost, a tare of 20 s on another motion, both as CSV and as Parquet
files. The command runs in a process of its own: wall and processor seconds include the start of Python, reading and
checking. Written to benchmarks/results/identify_time.json, with the load of the machine: wall seconds of a busy one
say little.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from script import options, write

from armload import arm
from armload.motion import random_motion
from armload.payloads import test_payload
from armload.recording import write_recording
from armload.simulation import Sensors, World, simulate

TARE = 20.0  # [s]


def timed(folder: Path, ending: str, method: str) -> dict[str, float]:
    """Wall and processor time [s] of one command, and what it answered."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    logs = (str(folder / f"run.{ending}"), "--tare", str(folder / f"tare.{ending}"))
    command = (sys.executable, "-m", "armload", "identify", *logs, "--robot", "panda", "--method", method, "--json")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall_s": round(wall, 2), "processor_s": round(used, 2), "mass_kg": json.loads(done.stdout)["mass"]}


def main() -> None:
    asked = options(__doc__, seconds=60.0, method="hybrid")
    robot = arm("panda")
    world, sensors = World.real_like(robot, 1), Sensors.panda(robot)
    motions = (random_motion(robot, 1, duration=asked.seconds, harmonics=10), random_motion(robot, 2, duration=TARE))
    with tempfile.TemporaryDirectory() as name:
        folder, samples = Path(name), {}
        for part, motion, payload, seed in zip(("run", "tare"), motions, (test_payload(), None), (2, 1), strict=True):
            log = simulate(robot, motion, payload, world=world, sensors=sensors, seed=seed)
            samples[part] = len(log)
            for ending in ("csv", "parquet"):
                write_recording(folder / f"{part}.{ending}", log)
        found = {ending: timed(folder, ending, asked.method) for ending in ("csv", "parquet")}
    write("identify_time", {"samples": samples, "truth_kg": test_payload().parameters.mass, "identify": found})


if __name__ == "__main__":
    main()
