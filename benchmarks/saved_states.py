"""What a service writes every minute: how large a stream's saved state is, and how long it takes.

    python benchmarks/saved_states.py [--seconds 180] [--case "profile, changing"]

A simulated Panda that differs from its model, at 200 samples a second, with the default method. *changing*: its payload
changes every 15 s; *steady*: it holds the same all the time. *profile*: of six logs of 20 s of the same arm; else there
is neither a profile nor a tare. After the first half minute a state is saved every five seconds of the stream, into a
folder for temporary files. Sizes are means and the largest; times, of a clock on the wall, are medians: until a state
is on the disk, and until one goes on (every fourth is read again). *deflated*: the same arrays by zlib at its quickest,
in place of `armload.runtime.sparing`, and the processor time of that alone; the stream waits while its state is saved.
"""

import tempfile
import time
import zlib
from pathlib import Path
from unittest.mock import patch

import numpy as np
from script import cases_of, options, say, write
from soak import simulated

from armload.arms import arm
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.posterior import learn_profile
from armload.runtime import packing
from armload.simulation import Run, Sensors, World, simulate_many

RATE = 200.0  # [Hz]
LOGS, LOG = 6, 20.0  # of the profile, [s] each
FROM, EVERY = 30.0, 5.0  # [s]
READ = 4  # one of so many states is read again
CASES = [f"{known}, {held}" for known in ("nothing", "profile") for held in ("steady", "changing")]


def profile(robot):
    """Of the same arm as `simulated`."""
    world, sensors = World.real_like(robot, seed=1), Sensors.of(robot)
    runs = [Run(random_motion(robot, seed, duration=LOG), None, world, sensors, seed) for seed in range(1, LOGS + 1)]
    return learn_profile(robot, simulate_many(robot, runs, rate=RATE, duration=LOG, workers=1))


def measured(robot, known, rows, path):
    """Sizes and times of the states of one stream."""
    stream, sizes, saving, reading, deflated = OnlineIdentifier(robot, profile=known), [], [], [], []
    for row in rows:
        stream.update(row[0], row[1:8], row[8:15], row[15:22])
        if row[0] - rows[0, 0] < FROM + EVERY * len(sizes):
            continue
        began = time.perf_counter()
        sizes.append(stream.save(path).stat().st_size / 1e6)
        saving.append(time.perf_counter() - began)
        if len(sizes) % READ == 0:
            began = time.perf_counter()
            OnlineIdentifier.restore(path, robot, profile=known).close()
            reading.append(time.perf_counter() - began)
            deflated.append(by_zlib(stream, path))
    stream.close()
    return {
        "states": len(sizes),
        "mean [MB]": float(np.mean(sizes)),
        "largest [MB]": max(sizes),
        "saving [s]": float(np.median(saving)),
        "going on [s]": float(np.median(reading)),
        "deflated, mean [MB]": float(np.mean([size for size, _ in deflated])),
        "deflating [s]": float(np.median([spent for _, spent in deflated])),
    }


def by_zlib(stream, path):
    """Size [MB] of a state whose arrays are written whole and deflated, and the processor time of deflating [s]."""
    with patch.object(packing, "spared", lambda _: None), np.load(stream.save(path)) as arrays:
        whole = b"".join(arrays[name].tobytes() for name in arrays.files)
    began = time.process_time()
    return len(zlib.compress(whole, 1)) / 1e6, time.process_time() - began


def main():
    asked = options(__doc__, seconds=180.0, case="")
    chosen, cases = cases_of("saved_states", CASES, asked.case)
    robot = arm("panda")
    known = profile(robot) if any(case.startswith("profile") for case in chosen) else None
    with tempfile.TemporaryDirectory() as folder:
        for case in chosen:
            rows = simulated(asked.seconds, case.endswith("steady"), RATE)
            of = known if case.startswith("profile") else None
            cases[case] = measured(robot, of, rows, Path(folder) / "state.npz")
            say(f"{case}: {cases[case]}")
    write("saved_states", {"seconds": asked.seconds, "rate [Hz]": RATE, "cases": cases})


if __name__ == "__main__":
    main()
