"""How much faster than reality the simulation is: the 77 × 6 s data set, in the nominal and in a real-like world.

    python benchmarks/simulation_speed.py [--runs 77] [--workers 2]

Prints the ratio of simulated to elapsed time and writes benchmarks/results/simulation_speed.json.
"""

from __future__ import annotations

import time

from script import options, say, write

from armload.arms import arm
from armload.motion import taie2024
from armload.payloads import container_loadings
from armload.simulation import Run, Sensors, World, simulate_many

RATE = 3244 / 6  # [Hz] the paper's rows per run over its period


def main() -> None:
    asked = options(__doc__, runs=77, workers=2)
    panda, motion = arm("panda"), taie2024()
    payloads = (container_loadings() * asked.runs)[: asked.runs]
    cases = {
        "nominal, ideal sensors": (World.nominal(panda), Sensors.ideal()),
        "real-like, Panda's sensors": (World.real_like(panda, seed=0), Sensors.panda(panda).evenly()),
    }
    simulate_many(panda, [Run(motion)] * 2, rate=RATE)  # imports and compiles what is loaded on demand
    rows = []
    for name, (world, sensors) in cases.items():
        runs = [Run(motion, payload, world, sensors, seed) for seed, payload in enumerate(payloads)]
        start, busy = time.perf_counter(), time.process_time()
        logs = simulate_many(panda, runs, rate=RATE, workers=asked.workers)
        elapsed, busy = time.perf_counter() - start, time.process_time() - busy
        simulated = len(runs) * motion.duration
        rows.append(
            {
                "case": name,
                "runs": len(runs),
                "rows": sum(len(log) for log in logs),
                "simulated_s": simulated,
                "elapsed_s": round(elapsed, 3),
                "processor_s": round(busy, 3),
                "ratio": round(simulated / elapsed, 1),
            }
        )
        ratio = f"{simulated / elapsed:.0f} × real time"
        say(f"{name:<28} {simulated:.0f} s in {elapsed:.2f} s: {ratio}; {busy:.2f} s of processor time")
    what = "simulated time over elapsed time (ratio), physics, controller, world and sensors included"
    write("simulation_speed", {"what": what, "workers": asked.workers, "cases": rows})


if __name__ == "__main__":
    main()
