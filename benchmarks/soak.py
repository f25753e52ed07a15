"""Hours of a stream, faster than real time: does memory stay flat, and what does it cost?

    python benchmarks/soak.py --hours 6
    python benchmarks/soak.py --hours 0.25 --steady    # the same payload all the time
    python benchmarks/soak.py --hours 24 --rate 50     # fewer samples a second, for longer

One arm of the service (`Session`: gate, rows, posterior, hybrid, checks of the samples, answers ten times a second as
JSON, the state saved every minute) is fed by a simulated Panda at 200 samples per second (--rate) whose payload changes
every 15 s of the stream: ten minutes that another process has simulated, again and again, with a second's pause
between. The memory is set as the service sets its processes' (one arena of malloc). Once a simulated minute the
resident size of the process is noted. After the first quarter, in which buffers fill, a straight line is fitted to
about fifteen sizes minutes apart, with its 95 % interval: sizes a minute apart would not be independent. Processor time
is of all threads. The result is written after every quarter of a simulated hour, so that it can be stopped at any time.
"""

import argparse
import itertools
import json
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from scipy.stats import linregress
from scipy.stats import t as student

from armload.arms import arm, rated_mass
from armload.devices import Simulator, Source
from armload.payloads import draw_payload
from armload.recording import Sample
from armload.runtime.atomic import replacing
from armload.service import Session
from armload.simulation import Sensors, World

REPEATED = 600.0  # [s] that are simulated
PAUSE = 1.0  # [s]
NOTED = 20  # sizes, about, that stand in the result, and that the line is fitted to
RESULT = Path(__file__).parent / "results" / "soak.json"


def simulated(seconds, steady, rate):
    """Samples (N, 22) of a Panda whose payload changes every 15 s, or, steady, never does."""
    panda = arm("panda")
    rated, world = rated_mass(panda), World.real_like(panda, seed=1)
    held = [(15.0 * k, draw_payload("boxes", k, rated=rated) if k % 2 else None) for k in range(1, round(seconds / 15))]
    held = [(0.0, draw_payload("boxes", 1, rated=rated))] if steady else held
    more = {"rate": rate, "speed": None, "duration": seconds}
    with Simulator(panda, payloads=held, world=world, sensors=Sensors.of(panda), **more) as source:
        return np.array([np.concatenate([[sample.t], *sample[1:]]) for sample in source])


class Again(Source):
    """Samples that come again and again, a pause before each repetition."""

    def __init__(self, rows, rate):
        self.rows, self.name, self.n, self.rate = rows, "simulated", 7, rate

    def __iter__(self):
        for k in itertools.count():
            for row in self.rows:
                t = float(row[0]) + k * (float(self.rows[-1, 0]) + PAUSE)
                yield Sample(t, row[1:8], row[8:15], row[15:22])

    def close(self):
        pass


def resident():
    """[MB] of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def slope(hours, megabytes):
    """Slope of a straight line through sizes minutes apart, and the half-width of its 95 % interval [MB/h]."""
    line = linregress(hours, megabytes)
    return float(line.slope), float(student.ppf(0.975, len(hours) - 2) * line.stderr)


def summary(rows, rate, cpu, states):
    noted = [(round(h, 2), round(float(m), 1)) for h, m in rows[:: max(1, len(rows) // NOTED)]]
    late = np.array([row for row in noted if row[0] >= 0.25 * rows[-1][0]])
    mean, half = slope(*late.T) if len(rows) >= 2 * NOTED else (None, None)
    return {
        "hours": rows[-1][0],
        "rate": rate,
        "saves": len(states),
        "state, mean [MB]": float(np.mean(states)),
        "state, largest [MB]": max(states),
        "resident [MB]": {f"{h:.2f} h": m for h, m in noted},
        "last [MB]": rows[-1][1],
        "slope after the first quarter [MB/h]": mean,
        "half-width of its 95 % interval [MB/h]": half,
        "share of a core": cpu / (3600.0 * rows[-1][0]),
    }


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--rate", type=float, default=200.0, help="samples a second (default: 200)")
    parser.add_argument("--state", default="/tmp/armload-soak.npz")
    parser.add_argument("--steady", action="store_true")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    name = "_".join(["soak", *["steady"] * options.steady, *[f"{options.rate:g}hz"] * (options.rate != 200.0)])
    out = options.out or RESULT.with_stem(name)
    if os.environ.get("MALLOC_ARENA_MAX") != "1":  # it is read when a process begins
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "MALLOC_ARENA_MAX": "1"})
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as beside:
        samples = beside.submit(simulated, REPEATED, options.steady, options.rate).result()
    session = Session(Again(samples, options.rate), arm("panda"), every=0.1)
    minute, spoken, rows, states, began, skipped = 1, 0.0, [], [], 0.0, None
    for estimate in session.estimates(3600.0 * options.hours):
        if estimate.t >= 10.0 and skipped is None:  # what is loaded and compiled once is no cost of an hour
            began, skipped = time.process_time(), estimate.t
        if estimate.t - spoken >= 0.1:
            json.dumps(estimate.to_dict())
            spoken = estimate.t
        if estimate.t >= 60.0 * minute:
            states.append(session.identifier.save(options.state).stat().st_size / 1e6)
            rows.append((estimate.t / 3600.0, resident()))
            if minute % 15 == 0:
                cpu = (time.process_time() - began) * estimate.t / (estimate.t - skipped)
                result = summary(rows, options.rate, cpu, states)
                print(json.dumps(result), flush=True)
                with replacing(out) as part:
                    part.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
            minute += 1
    session.close()


if __name__ == "__main__":
    main()
