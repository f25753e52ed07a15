"""How much faster compiled prediction and batched training are than scikit-learn's, as ratios within one run.

    python benchmarks/learner_speed.py            writes benchmarks/results/learner_speed.json

The data have the paper's payload count and row width; what is measured does not depend on their physics. Both sides of
a ratio run in turns in one process, and each time is the median of repeated blocks. The ratio is of processor time, all
threads counted, with BLAS on one thread: wall time on a shared machine measures the neighbours (it is recorded too).
"""

from __future__ import annotations

import statistics
import time
import warnings
from collections.abc import Callable

import numpy as np
from script import write
from threadpoolctl import threadpool_limits

from armload.ensembles import BaggingEnsemble, NetworkLearner
from armload.runtime.version import package_versions

ROWS, PAYLOADS, MEMBERS = 20_000, 77, 5
SEEDS = 3  # of the comparison of losses


def table(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Rows (t, q, dq, tau) of 77 payloads on one made-up motion, and their phi."""
    rng = np.random.default_rng(seed)
    t = rng.uniform(0, 6, ROWS)
    payload = rng.integers(PAYLOADS, size=ROWS)
    phi = rng.normal(size=(PAYLOADS, 10)) * ([0.4] + [0.03] * 3 + [3e-3] * 6)
    wave = np.sin(np.outer(t, rng.uniform(0.5, 4, 14)) + rng.uniform(0, 6, 14))
    tau = 20 * np.sin(np.outer(t, rng.uniform(0.5, 4, 7))) + (phi[payload] / phi.std(0)) @ rng.normal(size=(10, 7))
    return np.column_stack([t, wave, tau + 0.1 * rng.normal(size=tau.shape)]), phi[payload]


def race(ours: Callable[[], object], theirs: Callable[[], object], inner: tuple[int, int], blocks: int) -> dict:
    """Median processor and wall time of each [s], in turns after one unmeasured call of both, and the ratio."""
    ours(), theirs()
    times: dict[str, list[tuple[float, float]]] = {"armload": [], "scikit_learn": []}
    for _ in range(blocks):
        for kept, run, count in zip(times.values(), (ours, theirs), inner, strict=True):
            cpu, wall = time.process_time(), time.perf_counter()
            for _ in range(count):
                run()
            kept.append(((time.process_time() - cpu) / count, (time.perf_counter() - wall) / count))
    out = {}
    for name, kept in times.items():
        cpu, wall = zip(*kept, strict=True)
        out[name] = {"cpu_s": statistics.median(cpu), "wall_s": statistics.median(wall), "spread": max(cpu) / min(cpu)}
    return out | {"ratio": out["scikit_learn"]["cpu_s"] / out["armload"]["cpu_s"]}


def _epoch_race(X: np.ndarray, y: np.ndarray, batch: int) -> dict:
    """An epoch of five networks: one batched computation against scikit-learn in two processes' worth of threads.

    Differences of fits of 3 and of 1 epochs, so that set-up, bootstrap and start of workers do not count; wall time.
    """
    from sklearn.ensemble import BaggingRegressor
    from sklearn.neural_network import MLPRegressor

    scaled = (X - X.mean(0)) / X.std(0), (y - y.mean(0)) / y.std(0)

    def ours(epochs: int) -> None:
        learner = NetworkLearner(max_epochs=epochs, batch=batch)
        BaggingEnsemble(learner, members=MEMBERS).fit(X, y, X[:200], y[:200])

    def theirs(epochs: int) -> None:
        mlp = MLPRegressor(hidden_layer_sizes=(500,), batch_size=batch, max_iter=epochs, alpha=0.0, random_state=0)
        BaggingRegressor(mlp, n_estimators=MEMBERS, random_state=0, n_jobs=2).fit(*scaled)

    out: dict = {}
    for name, run in (("armload", ours), ("scikit_learn", theirs)):
        run(1)
        walls = []
        for _ in range(3):
            marks = [time.perf_counter()]
            for epochs in (1, 5):
                run(epochs)
                marks.append(time.perf_counter())
            walls.append((marks[2] - marks[1] - (marks[1] - marks[0])) / 4)
        out[name] = {"wall_s": statistics.median(walls), "spread": max(walls) / min(walls)}
    return out | {"ratio": out["scikit_learn"]["wall_s"] / out["armload"]["wall_s"]}


def _validation_losses(seed: int) -> tuple[float, float]:
    """Validation loss of five networks after 20 epochs, ours and scikit-learn's, on the same rows."""
    from sklearn.neural_network import MLPRegressor

    X, y = table(seed)
    X, y = (X - X.mean(0)) / X.std(0), (y - y.mean(0)) / y.std(0)
    train, held = slice(3000, None), slice(0, 3000)
    bag = BaggingEnsemble(NetworkLearner(max_epochs=20), members=MEMBERS, seed=seed, scale="none")
    bag.fit(X[train], y[train], X[held], y[held])
    ours = float(np.mean([np.mean((m - y[held]) ** 2) for m in bag.compiled_.members(X[held])]))
    theirs = []
    rng = np.random.default_rng(seed)
    for member in range(MEMBERS):
        rows = 3000 + rng.integers(len(X) - 3000, size=len(X) - 3000)
        mlp = MLPRegressor(hidden_layer_sizes=(500,), batch_size=200, max_iter=20, alpha=0.0, random_state=member)
        mlp.set_params(tol=0.0, n_iter_no_change=1000).fit(X[rows], y[rows])
        theirs.append(np.mean((mlp.predict(X[held]) - y[held]) ** 2))
    return ours, float(np.mean(theirs))


def main() -> None:
    """Run the races and write the result."""
    from sklearn.ensemble import BaggingRegressor
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    warnings.simplefilter("ignore", ConvergenceWarning)  # one epoch is what is asked for
    X, y = table()
    x = X[:1]
    races = {}

    trees = BaggingEnsemble("tree", members=MEMBERS).fit(X, y).compiled_
    reference = BaggingRegressor(n_estimators=MEMBERS, random_state=0).fit(X, y)
    races["one row, five trees"] = race(lambda: trees.predict(x), lambda: reference.predict(x), (2000, 100), 9)
    races["20 000 rows, five trees"] = race(lambda: trees.predict(X), lambda: reference.predict(X), (1, 1), 5)

    for batch in (200, 2048):
        races[f"one epoch, batch {batch}, wall"] = _epoch_race(X, y, batch)
    losses = [_validation_losses(seed) for seed in range(SEEDS)]
    one_epoch = NetworkLearner(max_epochs=1)
    scaled = (X - X.mean(0)) / X.std(0), (y - y.mean(0)) / y.std(0)
    mlp = MLPRegressor(hidden_layer_sizes=(500,), batch_size=200, max_iter=1, alpha=0.0, random_state=0)
    bag = BaggingRegressor(mlp, n_estimators=MEMBERS, random_state=0)
    networks = BaggingEnsemble(one_epoch, members=MEMBERS)
    # One epoch of all five members, bootstrap and set-up included on both sides; compiling is not (the first call).
    races["one epoch, five networks"] = race(
        lambda: networks.fit(X, y, X[:3000], y[:3000]), lambda: bag.fit(*scaled), (1, 1), 3
    )
    stacked = networks.compiled_
    races["one row, five networks"] = race(lambda: stacked.predict(x), lambda: bag.predict(x), (2000, 100), 9)

    result = {
        "rows": ROWS,
        "features": X.shape[1],
        "members": MEMBERS,
        "learners": package_versions("numba", "scikit-learn", "jax"),
        "races": races,
        "validation_loss_after_20_epochs": {
            "what": "mean squared error on 3000 rows in scaled units, mean of the members; batch 200, equal epochs",
            "armload": [round(ours, 5) for ours, _ in losses],
            "scikit_learn": [round(theirs, 5) for _, theirs in losses],
            "ratio_median": round(statistics.median(ours / theirs for ours, theirs in losses), 4),
        },
    }
    write("learner_speed", result)
    print(f"{'processor time, or wall':28} {'armload':>12} {'scikit-learn':>14} {'ratio':>7}")
    for name, r in races.items():
        ours, theirs = (r[who].get("cpu_s", r[who]["wall_s"]) for who in ("armload", "scikit_learn"))
        print(f"{name:28} {ours * 1e6:10.1f} µs {theirs * 1e6:12.1f} µs {r['ratio']:7.1f}")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
