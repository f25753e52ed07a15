"""What a stream and a log say of an arm that goes from pose to pose for minutes, each another, with one payload.

    python benchmarks/ever_new_poses.py [--arms 12] [--seconds 600] [--pushed 24] [--jobs 1]

Real-like Pandas (`World.real_like`, the sensors as measured) at 100 Hz that go from one pose to the next and stop there
(`MotionSource.stops`); a tare of 20 s on another motion. Every other one holds a payload of the events' families of
0.2 kg and more from the beginning.

- *Nothing happens* for so many seconds on so many arms: each event is false. Looked at in the first 100 s and after
  them. The restlessness and the doubts of the run by time, and what `identify` says of the log's first minute, two
  minutes, five and all of it: how often it is not called calibrated, and by which note.
- *Pushed*: other arms, 40 s each; a person pushes at the flange with 5 to 40 N for 0.3 to 3 s, in any direction. A push
  counts as called a change if an event falls into it or the second after it; by its last name it stays one or is a
  `return`.

Printed, and written to benchmarks/results/ever_new_poses.json and a table of docs/online_measured.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from alarms import wilson
from event_scenes import Push, body
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm, identify
from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.episodes.motion_kinds import MotionSource
from armload.lab.experiment import Task, run_tasks, source_key
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.payloads import Payload
from armload.simulation import Sensors, World, simulate

PAGE = ROOT / "docs" / "online_measured.md"
RATE = 100.0  # [Hz]
NEW = 100.0  # [s] in which there are fewer poses than the arm's smooth mismatch has features
LOGS = (60.0, 120.0, 300.0)  # [s] of a log from the beginning, and all of it
LOOKED = (60.0, 100.0, 200.0, 300.0, 600.0)  # [s] at which restlessness is looked at
SEED = 70_000


def made(seed: int, seconds: float) -> tuple[Recording, Recording, float]:
    """The tare, the log, and what is held [kg]."""
    panda, rng = arm("panda"), np.random.default_rng([seed, 3])
    world, how = World.real_like(panda, seed), {"sensors": Sensors.panda(panda), "rate": RATE}
    held = InertialParameters(body(rng)) if seed % 2 else None
    motion = MotionSource(panda).stops(rng, seconds, travel=(0.6, 1.8))
    tare = simulate(panda, random_motion(panda, seed, duration=20.0), world=world, seed=seed + 1, **how)
    payload = None if held is None else Payload("held", held)
    log = simulate(panda, motion, payload, world=world, duration=seconds, seed=seed, **how)
    return tare, log, 0.0 if held is None else held.mass


def quiet(seed: int, seconds: float) -> dict[str, Any]:
    """What is said of an arm to which nothing happens."""
    tare, log, mass = made(seed, seconds)
    identifier, events, restless, doubted, wrong = OnlineIdentifier("panda", tare), {}, {}, 0.0, 0
    looks = [at for at in LOOKED if at <= seconds]
    for k, sample in enumerate(log):
        one = identifier.update(*sample)
        if one.event is not None:
            events[one.event.t] = {"t": one.event.t, "kind": one.event.kind, "mass": one.event.mass}
        while looks and (one.t >= looks[0] or k == len(log) - 1):
            restless[f"{looks.pop(0):g}"] = float(identifier.engine.stream.restlessness)  # type: ignore[attr-defined]
        doubted += bool(identifier.doubts) / RATE
        wrong += one.interval == "calibrated" and not one.low[0] <= mass <= one.high[0]
    identifier.close()
    said = {}
    for part in (*(at for at in LOGS if at < seconds), seconds):
        answer = identify(log.between(0.0, part), "panda", tare=tare)
        low, high = answer.phi_low[0], answer.phi_high[0]
        said[f"{part:g}"] = {
            "calibrated": answer.interval == "calibrated",
            "inside": bool(low <= mass <= high),
            "error": float(answer.mass - mass),
            "notes": [note[:60] for note in answer.notes],
        }
    return {
        "mass": mass,
        "events": list(events.values()),
        "restlessness": restless,
        "doubted [s]": round(doubted, 1),
        "calibrated and wrong [s]": round(wrong / RATE, 1),
        "logs": said,
    }


def pushed(seed: int, seconds: float = 40.0) -> dict[str, Any]:
    """What is said of an arm that somebody pushes."""
    tare, log, _ = made(seed, seconds)
    rng, pushes, t = np.random.default_rng([seed, 4]), [], 9.0
    while t < seconds - 5.0:
        length, way = rng.uniform(0.3, 3.0), rng.normal(size=3)
        force = np.exp(rng.uniform(np.log(5.0), np.log(40.0))) * way / np.linalg.norm(way)
        pushes.append(Push(t, t + length, "panda_link8", force))
        t += length + rng.uniform(3.0, 5.0)
    tau = log.tau + sum(push.torque(log.t, log.q) for push in pushes)
    identifier, events = OnlineIdentifier("panda", tare), {}
    for sample in Recording(log.t, log.q, log.dq, tau):
        event = identifier.update(*sample).event
        if event is not None:
            events[event.t] = event.kind
    identifier.close()
    of = [[kind for at, kind in events.items() if push.start <= at < push.end + 1.0] for push in pushes]
    return {"pushes": len(of), "called": sum(map(bool, of)), "kept": sum(bool(x) and x[-1] != "return" for x in of)}


def table(found: dict[str, Any]) -> str:
    """Events, doubts and logs by time."""
    arms, rows = found["quiet"], []
    for name, first, last in (("the first 100 s", 0.0, NEW), ("after them", NEW, found["seconds"])):
        false = [e for one in arms for e in one["events"] if first <= e["t"] < last]
        hours = len(arms) * (last - first) / 3600.0
        most = max((abs(e["mass"] or 0.0) for e in false), default=0.0)
        rows.append([name, f"{hours:.2f}", str(len(false)), f"{1e3 * most:.0f} g" if false else ""])
    events = markdown_table(["", "hours", "false events", "largest"], "rrr", rows)
    rows = []
    for part in arms[0]["logs"]:
        logs = [one["logs"][part] for one in arms]
        doubted, inside = (sum(not x[k] for x in logs) for k in ("calibrated", "inside"))
        error = 1e3 * np.mean([abs(x["error"]) for x in logs])
        rows.append([f"{part} s", str(len(logs)), str(doubted), str(inside), f"{error:.1f} g"])
    heads = ["log of", "logs", "not called calibrated", "mass outside", "mass error"]
    return events + "\n\n" + markdown_table(heads, "rrrr", rows)


def main() -> None:
    asked = options(__doc__, arms=12, seconds=600.0, pushed=24, jobs=1)
    rooms = (ROOT / "src" / "armload" / room for room in ("online", "posterior", "regression", "identification"))
    code, tasks = source_key(*rooms, Path(__file__)), []
    for kind, count, task, arguments in (
        ("quiet", asked.arms, quiet, (asked.seconds,)),
        ("pushed", asked.pushed, pushed, ()),
    ):
        for k in range(count):
            seed = SEED + k + 1000 * (kind == "pushed")
            name = f"{kind} {seed}"
            tasks.append(Task.of_one(name, key_of(code, name, *arguments), task, seed, *arguments))
    cells = run_tasks(tasks, ROOT / "out" / "ever_new_poses", jobs=asked.jobs, say=say)
    found: dict[str, Any] = {"seconds": asked.seconds}
    found |= {kind: [cell for name, cell in cells.items() if name.startswith(kind)] for kind in ("quiet", "pushed")}
    n, called, kept = (sum(one[key] for one in found["pushed"]) for key in ("pushes", "called", "kept"))
    found["of pushes"] = {"pushes": n, "called": called, "kept": kept, "called, 95 %": wilson(called, n)}
    write("ever_new_poses", found)
    write_table(PAGE, "ever new poses", table(found))
    say(table(found) + f"\n{found['of pushes']}")


if __name__ == "__main__":
    main()
