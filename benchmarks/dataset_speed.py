"""How much faster than reality the paper's data set is built: simulation, sensors and Parquet together.

    python benchmarks/dataset_speed.py [--rows 3244]

Prints the ratio of simulated to elapsed time and writes benchmarks/results/dataset_speed.json.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from script import options, write

from armload import arm
from armload.lab.dataset import build_dataset
from armload.motion import taie2024
from armload.payloads import container_loadings
from armload.simulation import Run, Sensors, simulate_many


def main() -> None:
    rows = options(__doc__, rows=3244).rows
    panda, motion, loadings = arm("panda"), taie2024(), container_loadings()
    simulate_many(panda, [Run(motion)] * 2, rate=rows / motion.duration)  # compiles what is loaded on demand
    kept = {"sensors": Sensors.panda(panda), "rows_per_run": rows, "progress": False}
    with tempfile.TemporaryDirectory() as folder:
        started, busy = time.perf_counter(), time.process_time()
        dataset = build_dataset(Path(folder) / "data", panda, [motion], loadings, **kept)
        elapsed, busy = time.perf_counter() - started, time.process_time() - busy
        size = (Path(folder) / "data" / "table.parquet").stat().st_size
    simulated = len(loadings) * motion.duration
    result = {
        "what": "simulated time over elapsed time (ratio): simulation, sensors, Parquet, hash",
        "rows": len(dataset),
        "simulated_s": simulated,
        "elapsed_s": round(elapsed, 2),
        "processor_s": round(busy, 2),
        "ratio": round(simulated / elapsed, 1),
        "parquet_mb": round(size / 1e6, 1),
    }
    write("dataset_speed", result)


if __name__ == "__main__":
    main()
