"""What one version of armload makes of logs and streams that are given to both: run by before_after.py, in a process.

    PYTHONPATH=VERSION/src python benchmarks/before_after_worker.py answers|follow|time FOLDER ANSWERS.json

Names are taken from the top of the package alone: the versions lay out their rooms differently.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import armload
from armload import METHODS, ArmloadError, OnlineIdentifier, Recording, arm, read_recording

EVERY = 10  # samples of a stream
DOUBT = "samples that do not fit are left out"


def logs(folder: Path, name: str, robot: Any) -> tuple[Recording, Recording | None]:
    """A run and its tare, if it has one."""
    tare = folder / f"{name}-tare.npz"
    return read_recording(folder / f"{name}.npz", robot), read_recording(tare, robot) if tare.exists() else None


def answers(folder: Path, written: Path) -> dict[str, Any]:
    """phi and std (T, 10) of every task of every log, or why there are none; each log's are kept as they come."""
    plan, robot = json.loads((folder / "plan.json").read_text()), arm("panda")
    found: dict[str, Any] = {}
    for number, (name, tasks) in enumerate(plan.items(), start=1):
        cell = written.with_suffix("") / f"{name}.json"
        if cell.is_file():
            found[name] = json.loads(cell.read_text())
            continue
        run, tare = logs(folder, name, robot)
        found[name] = {}
        for key, method, tared, times in tasks:
            began = time.process_time()
            try:
                estimates = METHODS[method].make(robot, tare if tared else None).at(run, times)
                said: dict[str, Any] = {"phi": [e.phi.tolist() for e in estimates]}
                said["std"] = [e.std.tolist() for e in estimates]
            except ArmloadError as error:
                said = {"refused": str(error)}
            found[name][key] = {**said, "cpu_s": round(time.process_time() - began, 2)}
        cell.parent.mkdir(exist_ok=True)
        cell.with_suffix(".part").write_text(json.dumps(found[name]))
        cell.with_suffix(".part").rename(cell)
        print(f"{number} of {len(plan)}: {name}", file=sys.stderr, flush=True)
    return found


def stream(folder: Path, name: str, which: str) -> tuple[OnlineIdentifier, Recording]:
    """An identifier for a stream, and the stream."""
    robot = arm(which)
    run, tare = logs(folder, name, robot)
    return OnlineIdentifier(robot, tare), run


def follow(folder: Path, _: Path) -> dict[str, Any]:
    """t (N/EVERY,) and phi (N/EVERY, 10) along every stream, the changes noticed, when samples were first left out."""
    found: dict[str, Any] = {}
    for name, which in json.loads((folder / "streams.json").read_text()).items():
        identifier, run = stream(folder, name, which)
        t, phi, events, doubted = [], [], [], None
        for k, sample in enumerate(run, start=1):
            estimate = identifier.update(*sample)
            if k % EVERY == 0:
                phi.append(estimate.phi.tolist())
                t.append(float(sample.t))
            if doubted is None and any(DOUBT in note for note in estimate.notes):
                doubted = float(sample.t)
            if estimate.event is not None and (told := estimate.event.to_dict()) not in events[-1:]:
                events.append(told)
        identifier.close()
        found[name] = {"t": t, "phi": phi, "events": events, "doubted_from_s": doubted}
    return found


def timed(folder: Path, _: Path) -> dict[str, Any]:
    """Time of every update [ns] on one core, the thread's own and the wall's; the process' own of the stream [s]."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    thread, wall, found = time.thread_time_ns, time.perf_counter_ns, {}
    for name, which in json.loads((folder / "streams.json").read_text()).items():
        identifier, run = stream(folder, name, which)
        for sample in run:
            identifier.update(*sample)  # compiled, loaded and cached now
        identifier.reset()
        own, past = np.zeros(len(run), dtype=np.int64), np.zeros(len(run), dtype=np.int64)
        began = time.process_time()
        for k, sample in enumerate(list(run)):
            w, c = wall(), thread()
            identifier.update(*sample)
            own[k], past[k] = thread() - c, wall() - w
        found[name] = {"thread": own.tolist(), "wall": past.tolist(), "process_s": time.process_time() - began}
        identifier.close()
    return found


if __name__ == "__main__":
    task, given, written = {"answers": answers, "follow": follow, "time": timed}[sys.argv[1]], *map(Path, sys.argv[2:])
    if not Path(armload.__file__).is_relative_to(os.environ["PYTHONPATH"]):
        raise SystemExit(f"found armload at {armload.__file__}: expected it below {os.environ['PYTHONPATH']}")
    written.write_text(json.dumps(task(given, written)))
