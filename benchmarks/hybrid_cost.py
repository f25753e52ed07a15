"""What an update of the hybrid costs, in time and in memory, as ratios in one run.

    python benchmarks/hybrid_cost.py [--seconds 20]

A simulated Panda at 1 kHz with a tare; every sample goes through `HybridIdentifier.update` on one core. Updates that
solve (one every 0.1 s) are counted apart from those that only accumulate. Written to
benchmarks/results/hybrid_cost.json: times as ratios to the 1 ms between two samples and to scikit-learn's
`BaggingRegressor.predict` on one row in the same run; memory as the size of the identifier's state at a quarter and at
the end of the run.
"""

from __future__ import annotations

import time

import numpy as np
from script import options, write
from sklearn.ensemble import BaggingRegressor
from threadpoolctl import threadpool_limits

from armload import arm
from armload.estimators import FilteredRecursiveLeastSquares, Identifier
from armload.motion import random_motion
from armload.payloads import test_payload
from armload.posterior import HybridIdentifier, SmoothPosteriorLeastSquares
from armload.simulation import Sensors, World, simulate

SAMPLE = 1e-3  # [s]


def state_bytes(identifier: Identifier) -> int:
    """Bytes of all arrays an identifier holds, whatever holds them."""
    seen: set[int] = set()

    def size(thing: object) -> int:
        if id(thing) in seen:
            return 0
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            return thing.nbytes
        if isinstance(thing, dict):
            return sum(map(size, thing.values()))
        if isinstance(thing, list | tuple | set):
            return sum(map(size, thing))
        return size(vars(thing)) if hasattr(thing, "__dict__") else 0

    return size(identifier)


def measure(identifier: Identifier, log) -> dict[str, float]:
    """Thread CPU time [s] of every update, heavy ones apart; wall time; size of the state."""
    identifier.reset()
    times, quarter = np.empty(len(log)), 0
    began = time.perf_counter()
    for k, sample in enumerate(log):
        start = time.thread_time()
        identifier.update(sample)
        times[k] = time.thread_time() - start
        if k == len(log) // 4:
            quarter = state_bytes(identifier)
    wall = time.perf_counter() - began
    heavy = times > 5.0 * np.median(times) + 5e-4
    return {
        "light_median": float(np.median(times[~heavy])),
        "light_p999": float(np.quantile(times[~heavy], 0.999)),
        "heavy_median": float(np.median(times[heavy])) if heavy.any() else 0.0,
        "heavy_share": float(heavy.mean()),
        "mean": float(times.mean()),
        "wall_mean": wall / len(log),
        "state_bytes_at_a_quarter": quarter,
        "state_bytes_at_the_end": state_bytes(identifier),
    }


def sklearn_row() -> float:
    """Median time [s] of one row through scikit-learn's own bag of five trees."""
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(3000, 22)), rng.normal(size=(3000, 10))
    bag = BaggingRegressor(n_estimators=5, random_state=0).fit(X, y)
    times = []
    for k in range(200):
        start = time.thread_time()
        bag.predict(X[k : k + 1])
        times.append(time.thread_time() - start)
    return float(np.median(times))


def main() -> None:
    seconds = options(__doc__, seconds=20.0).seconds
    robot = arm("panda")
    world, sensors = World.real_like(robot, 1), Sensors.panda(robot)
    motion = random_motion(robot, 1, duration=seconds, harmonics=10)
    tare = simulate(robot, random_motion(robot, 2, duration=20.0, harmonics=10), world=world, sensors=sensors, seed=1)
    log = simulate(robot, motion, test_payload(), world=world, sensors=sensors, seed=2)
    with threadpool_limits(1):
        row = sklearn_row()
        found = {
            "hybrid": measure(HybridIdentifier(robot, tare), log),
            "map-gp": measure(SmoothPosteriorLeastSquares(robot, tare), log),
            "rls-filter": measure(FilteredRecursiveLeastSquares(robot), log),
        }
    result = {
        "samples": len(log),
        "sample_time_s": SAMPLE,
        "sklearn_row_s": row,
        "methods": found,
        "ratio_to_1_ms": {name: {k: v / SAMPLE for k, v in m.items() if "bytes" not in k} for name, m in found.items()},
        "ratio_to_sklearn_row": {name: m["light_median"] / row for name, m in found.items()},
    }
    write("hybrid_cost", result)


if __name__ == "__main__":
    main()
