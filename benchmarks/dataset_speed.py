"""How much faster than reality the paper's data set is built: simulation, sensors and Parquet together.

    python benchmarks/dataset_speed.py [--rows 3244]

Prints the ratio of simulated to elapsed time and writes benchmarks/results/dataset_speed.json.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
import time
from pathlib import Path

from armload import arm
from armload.lab.dataset import build_dataset
from armload.motion import taie2024
from armload.payloads import container_loadings
from armload.simulation import Run, Sensors, simulate_many


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=3244)
    rows = parser.parse_args().rows
    panda, motion, loadings = arm("panda"), taie2024(), container_loadings()
    simulate_many(
        panda, [Run(motion)] * 2, rate=rows / motion.duration
    )  # imports and compiles what is loaded on demand
    with tempfile.TemporaryDirectory() as folder:
        started, busy = time.perf_counter(), time.process_time()
        dataset = build_dataset(
            Path(folder) / "data",
            panda,
            [motion],
            loadings,
            sensors=Sensors.panda(panda),
            rows_per_run=rows,
            progress=False,
        )
        elapsed, busy = time.perf_counter() - started, time.process_time() - busy
        size = (Path(folder) / "data" / "table.parquet").stat().st_size
    simulated = len(loadings) * motion.duration
    result = {
        "what": "simulated time over elapsed time (ratio): simulation, sensors, Parquet, hash",
        "command": "python benchmarks/dataset_speed.py",
        "rows": len(dataset),
        "simulated_s": simulated,
        "elapsed_s": round(elapsed, 2),
        "processor_s": round(busy, 2),
        "ratio": round(simulated / elapsed, 1),
        "parquet_mb": round(size / 1e6, 1),
        "cores": os.cpu_count(),
        "load_before": [round(x, 2) for x in os.getloadavg()],
        "machine": platform.machine(),
    }
    print(json.dumps(result, indent=1))
    target = Path(__file__).parent / "results" / "dataset_speed.json"
    target.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
