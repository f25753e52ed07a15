"""What a sample costs on a live stream: processor time, wall time, age of the answer, memory.

    python benchmarks/online_speed.py [--quick] [--soak 60]

A simulated real-like Panda at 1 kHz goes round for a minute that joins itself: empty, 1.2 kg from the 20th second to
the 50th, empty again. The minute is replayed with times that go on, as fast as possible, and every sample goes through
`OnlineIdentifier.update` on one core. Processor time is the calling thread's own (`time.thread_time_ns`): what a loop
that waits for the answer pays. The scales are found by a second thread, whose time is in `second_thread_share`.

Updates with work that comes now and then are counted apart, told by the state of the run before and after:
    change    a payload has just changed: noticed, settling, a run begun or taken up again
    early     the first 0.1 s of a run, when all rows so far are taken again
    adopted   a new solution for the scales is adopted
All others are ordinary. Wall time, lateness and age are those of a second, shorter pass in real time: each sample is
waited for, as from a robot. The ensembles have the paper's sizes (five trees on 20 000 rows; five networks of 500
hidden units) on made-up data, which the cost does not depend on; `sklearn_row` is scikit-learn's own
`BaggingRegressor.predict` on one row in the same run.

--quick: 20 s of each and a soak of a minute, printed only. --soak: its minutes; 0 keeps what was measured before.

The soak feeds the hybrid an hour at 1 kHz: 3.6 million samples, 120 changes of payload.

Written to benchmarks/results/online_speed.json. About 25 minutes on a quiet core.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from learner_speed import table
from script import RESULTS, options, say, write
from sklearn.ensemble import BaggingRegressor
from threadpoolctl import threadpool_limits

from armload import Recording, arm
from armload.arms import Arm
from armload.devices import Replay, Simulator
from armload.ensembles import BaggingEnsemble, LearnedIdentifier, NetworkLearner, save_model
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.posterior import PosteriorLeastSquares
from armload.recording import Sample
from armload.simulation import Sensors, World, simulate

SAMPLE = 1e-3  # [s]
KINDS = ("ordinary", "adopted", "early", "change")
SEED = 60_001


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


def minute(robot: Arm, seconds: float = 60.0) -> Recording:
    """The stream, to be replayed again and again."""
    payload = InertialParameters.from_com(1.2, (0.01, -0.02, 0.07), 1e-3 * np.diag([3.0, 2.5, 1.5]))
    source = Simulator(
        robot,
        random_motion(robot, SEED),  # 6 s: ends where it began
        [(seconds / 3.0, payload), (seconds * 5.0 / 6.0, None)],
        world=World.real_like(robot, SEED),
        sensors=Sensors.panda(robot).evenly(),
        speed=None,
        duration=seconds,
        seed=SEED,
    )
    return Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]


def samples(log: Recording, count: int) -> Iterator[Sample]:
    """So many samples of it, going on from the start after the end."""
    return islice(iter(Replay(log, speed=None, loop=True)), count)


def rss() -> float:
    """Resident memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


class Kinds:
    """Says of each update, before and after, what kind it was."""

    def __init__(self, identifier: Any) -> None:
        self._identifier = identifier
        self._last = self._look()

    def _look(self) -> tuple:
        run = getattr(self._identifier, "engine", None)
        stream = run.stream if isinstance(run, PosteriorLeastSquares) else None
        if stream is None:
            return run, None, 0, None
        return run, stream.state is None, stream.solutions, self._identifier.event

    def of(self, settling: bool) -> int:
        """Index into KINDS of the update just made."""
        before, now = self._last, self._look()
        self._last = now
        if now[1] is None:
            return 0
        if now[0] is not before[0] or settling or (now[3] is not before[3] and now[3].kind == "change"):
            return 3
        if before[1] or now[1]:
            return 2
        return 1 if now[2] != before[2] else 0


def quantiles(ns: np.ndarray) -> dict[str, float]:
    """Of times in ns, in µs."""
    names = ("p50", "p99", "p99.9", "max")
    return {"count": len(ns)} | {
        name: round(float(np.percentile(ns, q)) / 1e3, 1) for name, q in zip(names, (50, 99, 99.9, 100), strict=True)
    }


def measure(identifier: Any, update: Callable[[Sample], Any], stream: Iterator[Sample], count: int) -> dict[str, Any]:
    """Processor time of every update as fast as possible, by kind [µs]."""
    ns, kinds = np.full(count, 0, dtype=np.int64), np.full(count, 0, dtype=np.int8)
    clock, watch = time.thread_time_ns, Kinds(identifier)
    whole, own = time.process_time(), time.thread_time()
    for k, sample in enumerate(stream):
        start = clock()
        estimate = update(sample)
        ns[k] = clock() - start
        kinds[k] = watch.of(getattr(estimate, "settling", False))
    whole, own = time.process_time() - whole, time.thread_time() - own
    out: dict[str, Any] = {name: quantiles(ns[kinds == i]) for i, name in enumerate(KINDS) if np.any(kinds == i)}
    out["mean_us"] = round(float(ns.mean()) / 1e3, 1)
    out["second_thread_share"] = round((whole - own) / (count * SAMPLE), 4)
    return out


def in_real_time(identifier: OnlineIdentifier, log: Recording, count: int) -> dict[str, Any]:
    """Wall time of an update, how late it ends, and how old its answer is, each sample waited for."""
    wall, late, age = np.zeros(count), np.zeros(count), np.zeros(count)
    kinds, settling = np.zeros(count, dtype=np.int8), np.zeros(count, dtype=bool)
    watch, began = Kinds(identifier), time.perf_counter() + 0.01
    for k, sample in enumerate(samples(log, count)):
        due = began + sample.t - log.t[0]
        while (now := time.perf_counter()) < due:
            if due - now > 3e-4:
                time.sleep(1e-4)
        estimate = identifier.update(*sample)
        end = time.perf_counter()
        wall[k], late[k], age[k], settling[k] = end - now, end - due, estimate.age, estimate.settling
        kinds[k] = watch.of(estimate.settling)
    return {
        "wall": {name: quantiles(1e9 * wall[kinds == i]) for i, name in enumerate(KINDS) if np.any(kinds == i)},
        "done_after_due": quantiles(1e9 * late),
        "done_within_its_millisecond": round(float(np.mean(late < SAMPLE)), 5),
        "oldest_answer_ms": round(1e3 * float(age[~settling].max()), 3),
        "oldest_answer_while_a_change_settles_ms": round(1e3 * float(age[settling].max(initial=0.0)), 3),
    }


def soak(log: Recording, minutes: float) -> dict[str, Any]:
    """The hybrid fed for so long: memory at some times, events, processor time."""
    robot, count = arm("panda"), round(60.0 * minutes / SAMPLE)
    marks = {round(m * 60.0 / SAMPLE): m for m in (minutes / 60.0, minutes / 6.0, minutes / 2.0, minutes)}
    identifier = OnlineIdentifier(robot)
    memory, events, last, start = {}, 0, None, time.process_time()
    for k, sample in enumerate(samples(log, count), start=1):
        estimate = identifier.update(*sample)
        if estimate.event is not last and estimate.event is not None and estimate.event.kind == "change":
            events += 1
        last = estimate.event
        if k in marks:
            memory[f"{marks[k]:g} min"] = round(rss(), 1)
            say(f"soak: {marks[k]:g} min, {memory}")
    identifier.close()
    sizes = list(memory.values())
    return {
        "samples": count,
        "rss_mb": memory,
        "growth_mb": round(sizes[-1] - sizes[0], 1),
        "changes": int(2 * (count * SAMPLE) // log.duration) if log.duration else 0,
        "events": events,
        "samples_used": identifier.health.used,
        "cpu_s": round(time.process_time() - start, 1),
    }


def ensembles(robot: Arm, folder: Path) -> dict[str, Path]:
    """Files of small models of the paper's sizes."""
    X, y = table()
    out = {}
    for name, learner in (("trees", "tree"), ("networks", NetworkLearner(max_epochs=1))):
        ensemble = BaggingEnsemble(learner, members=5)
        ensemble.fit(X, y, X[:1000], y[:1000]) if name == "networks" else ensemble.fit(X, y)
        out[name] = folder / f"{name}.safetensors"
        save_model(out[name], ensemble, arm=robot, motion=None, dataset_hash="made up")
    return out


def main() -> None:
    asked = options(__doc__, quick=False, soak=60.0)
    robot = arm("panda")
    timed, paced, minutes = (20.0, 5.0, 1.0) if asked.quick else (300.0, 60.0, asked.soak)
    log = minute(robot)
    tare = simulate(
        robot,
        random_motion(robot, SEED + 1, duration=20.0, harmonics=10),
        world=World.real_like(robot, SEED),
        sensors=Sensors.panda(robot),
        seed=SEED,
    )
    count = round(timed / SAMPLE)
    methods: dict[str, Any] = {}
    real_time: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        row = sklearn_row()
        files = ensembles(robot, Path(folder))
        makers: dict[str, Callable[[], OnlineIdentifier]] = {
            "hybrid": lambda: OnlineIdentifier(robot),
            "hybrid, with a tare": lambda: OnlineIdentifier(robot, tare),
            "map-gp": lambda: OnlineIdentifier(robot, method="map-gp"),
            "rls-filter": lambda: OnlineIdentifier(robot, method="rls-filter"),
            "trees": lambda: OnlineIdentifier(robot, method=files["trees"]),
            "networks": lambda: OnlineIdentifier(robot, method=files["networks"]),
        }
        for name, make in makers.items():
            identifier = make()
            for sample in samples(log, 3000):
                identifier.update(*sample)  # compiled now
            identifier.reset()
            methods[name] = measure(identifier, lambda s, i=identifier: i.update(*s), samples(log, count), count)
            engine = identifier.engine
            if isinstance(engine, LearnedIdentifier):
                engine.reset()
                methods[f"{name}, the ensemble alone"] = measure(engine, engine.update, samples(log, count), count)
            identifier.close()
            say(f"{name} {json.dumps(methods[name])}")
        for name in ("hybrid", "hybrid, with a tare", "trees"):
            identifier = makers[name]()
            real_time[name] = in_real_time(identifier, log, round(paced / SAMPLE))
            identifier.close()
            say(f"{name} {json.dumps(real_time[name])}")
        after = sklearn_row()
        soaked = soak(log, minutes) if minutes > 0 else json.loads((RESULTS / "online_speed.json").read_text())["soak"]
    result = {
        "targets": {"hybrid_p50_us": 100, "hybrid_p99.9_us": 500, "ensembles_p50_us": 20, "oldest_answer_ms": 10},
        "samples": count,
        "sklearn_row_us": [round(1e6 * row, 1), round(1e6 * after, 1)],
        "thread_cpu_us": methods,
        "ordinary_p50_to_1_ms": {name: round(m["ordinary"]["p50"] / 1e3, 4) for name, m in methods.items()},
        "ordinary_p50_to_sklearn_row": {
            name: round(m["ordinary"]["p50"] / (1e6 * row), 4) for name, m in methods.items()
        },
        "in_real_time": real_time,
        "soak": soaked,
    }
    if asked.quick:
        print(json.dumps(result, indent=1))
    else:
        write("online_speed", result)


if __name__ == "__main__":
    main()
