"""What a stream and a log say of an arm that goes from pose to pose for minutes, each another, with one payload.

    python benchmarks/ever_new_poses.py [--arms 6] [--seconds 600] [--logs 48] [--pushed 12] [--jobs 1] [--page]

Real-like Pandas (`World.real_like`, the sensors as measured) at 100 Hz that go from one pose to the next and stop
there, each pose another: *in one place*, 0.6 to 1.8 rad about a pose at most (`MotionSource.stops`), or *everywhere*,
in the middle seven tenths of each joint's range, clear of the floor and of themselves. The tare is 20 s of another
motion. Every other arm holds a payload of the events' families of 0.2 kg and more from the beginning. So many arms of
each:

- *Nothing happens* for so many seconds: each event is false. Looked at in the first 100 s and after them. The
  restlessness and the doubts of the run by time.
- *Logs* of other arms, `--logs` of each kind, to which nothing happens either: what `identify` says of the first 20 s,
  the first minute and three minutes: how often it is not called calibrated, and by which note.
- *Pushed*: other arms, 40 s each, `--pushed` of each; a person pushes at the flange with 5 to 40 N for 0.3 to 3 s, in
  any direction. A push counts as called a change if an event falls into it or the second after it; by its last name it
  stays one or is a `return`.

Printed, and written to benchmarks/results/ever_new_poses.json and a table of docs/online_measured.md; --page: the table
only, of what was measured.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from alarms import wilson
from event_scenes import Push, body
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm, identify
from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.episodes.motion_kinds import MotionSource
from armload.lab.experiment import Task, run_tasks, source_key
from armload.motion import Motion, random_motion
from armload.motion.collision import POSE_FLOOR, POSE_SELF, capsule_arm
from armload.motion.point_to_point import PointToPoint
from armload.motion.random_fourier import clear_poses, filled_limits
from armload.online import OnlineIdentifier
from armload.payloads import Payload
from armload.simulation import Sensors, World, simulate

PAGE = ROOT / "docs" / "online_measured.md"
RATE = 100.0  # [Hz]
NEW = 100.0  # [s] in which there are fewer poses than the arm's smooth mismatch has features
LOGS = (20.0, 60.0, 180.0)  # [s] of a log from its beginning
LOOKED = (60.0, 100.0, 200.0, 300.0, 600.0)  # [s] at which restlessness is looked at
SEED = 70_000
WHERE = ("in one place", "everywhere")
KINDS = ("quiet", "pushed", "logs")  # of what is asked, each of arms of its own


def everywhere(rng: np.random.Generator, seconds: float) -> Motion:
    """From clear pose to clear pose, along straight lines in joint space that are clear, too, with stops."""
    panda, model = arm("panda"), capsule_arm(arm("panda"))
    limits, poses = filled_limits(panda.limits), clear_poses(panda, model, rng, 0.0, 4000, POSE_FLOOR, POSE_SELF)
    way, starts, ends, t = [poses[0]], [], [], 0.2
    for pose in poses[1:]:
        line = way[-1] + np.linspace(0.0, 1.0, 30)[:, None] * (pose - way[-1])
        clear = model.clearance(line, 0.0)
        if clear.floor.min() < POSE_FLOOR or clear.self.min() < POSE_SELF:
            continue
        far, share = np.abs(pose - way[-1]), rng.uniform(0.3, 0.7)  # with a ramp of one half
        lasting = (2.0 * far / (share * limits.velocity), np.sqrt(6.0 * far / (share * limits.acceleration)))
        way, starts = [*way, pose], [*starts, t]
        ends.append(t + max(0.3, *(x.max() for x in lasting), np.cbrt(48.0 * far / (share * limits.jerk)).max()))
        t = ends[-1] + rng.uniform(0.0, 0.5)
        if t > seconds:
            return PointToPoint(np.array(way), np.array(starts), np.array(ends), 0.5, "everywhere")
    raise RuntimeError(f"only {t:.0f} s of {seconds:.0f}: draw more poses")


def made(seed: int, where: str, seconds: float) -> tuple[Recording, Recording, float]:
    """The tare, the log, and what is held [kg]."""
    panda, rng = arm("panda"), np.random.default_rng([seed, 3])
    world, how = World.real_like(panda, seed), {"sensors": Sensors.panda(panda), "rate": RATE}
    held = InertialParameters(body(rng)) if seed % 2 else None
    source = MotionSource(panda)
    motion = everywhere(rng, seconds) if where == WHERE[1] else source.stops(rng, seconds, travel=(0.6, 1.8))
    tare = simulate(panda, random_motion(panda, seed, duration=20.0), world=world, seed=seed + 1, **how)
    payload = None if held is None else Payload("held", held)
    log = simulate(panda, motion, payload, world=world, duration=seconds, seed=seed, **how)
    return tare, log, 0.0 if held is None else held.mass


def quiet(seed: int, where: str, seconds: float) -> dict[str, Any]:
    """What is said of an arm to which nothing happens."""
    tare, log, mass = made(seed, where, seconds)
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
    return {
        "mass": mass,
        "events": list(events.values()),
        "restlessness": restless,
        "doubted [s]": round(doubted, 1),
        "calibrated and wrong [s]": round(wrong / RATE, 1),
    }


def asked_of_logs(seed: int, where: str) -> dict[str, Any]:
    """What `identify` says of an arm to which nothing happens."""
    tare, log, mass = made(seed, where, LOGS[-1])
    said = {}
    for part in LOGS:
        answer = identify(log.between(0.0, part), "panda", tare=tare)
        low, high = answer.phi_low[0], answer.phi_high[0]
        said[f"{part:g}"] = {
            "calibrated": answer.interval == "calibrated",
            "inside": bool(low <= mass <= high),
            "error": float(answer.mass - mass),
            "half-width": float(high - low) / 2.0,
            "notes": [note[:60] for note in answer.notes],
        }
    return {"mass": mass, "logs": said}


def pushed(seed: int, where: str, seconds: float = 40.0) -> dict[str, Any]:
    """What is said of an arm that somebody pushes."""
    tare, log, _ = made(seed, where, seconds)
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
    """Events by time and place, pushes by place; and what is said of logs."""
    rows, logs = [], []
    for where in WHERE:
        arms, pushes = found[where]["quiet"], found[where]["of pushes"]
        said = []
        for first, last in ((0.0, NEW), (NEW, found["seconds"])):
            false = [e for one in arms for e in one["events"] if first <= e["t"] < last]
            most = max((abs(e["mass"] or 0.0) for e in false), default=0.0)
            size = f", at most {1e3 * most:.0f} g" if false else ""
            said.append(f"{len(false)} in {len(arms) * (last - first) / 3600.0:.2f} h{size}")
        restless = [max(one["restlessness"].values()) for one in arms]
        doubted = sum(one["doubted [s]"] > 0.0 for one in arms)
        share = f"{pushes['called']}, {pushes['kept']} of {pushes['pushes']}"
        rows.append([where, *said, f"{min(restless):.2f} … {max(restless):.2f}", f"{doubted} of {len(arms)}", share])
        for part in found[where]["logs"][0]["logs"]:
            of = [one["logs"][part] for one in found[where]["logs"]]
            doubted, outside, wrong = (
                sum(not x["calibrated"] for x in of),
                sum(not x["inside"] for x in of),
                sum(x["calibrated"] and not x["inside"] for x in of),
            )
            error, half = (1e3 * np.mean([abs(x[key]) for x in of]) for key in ("error", "half-width"))
            said = [f"{where}, {part} s", str(len(of)), str(doubted), f"{outside}, {wrong}"]
            logs.append([*said, f"{error:.1f} ± {half:.1f} g"])
    heads = ["poses", "false in the first 100 s", "false after them", "restlessness", "doubted", "pushes: called, kept"]
    streams = markdown_table(heads, "lrrrrr", rows)
    heads = ["log", "number", "not called calibrated", "mass outside, and called calibrated", "mass error ± half-width"]
    return f"{streams}\n\n" + markdown_table(heads, "lrrrr", logs)


def main() -> None:
    asked = options(__doc__, arms=6, seconds=600.0, logs=48, pushed=12, jobs=1, page=False)
    if asked.page:
        found = json.loads((RESULTS / "ever_new_poses.json").read_text(encoding="utf-8"))
        write_table(PAGE, "ever new poses", table(found))
        return
    rooms = (ROOT / "src" / "armload" / room for room in ("online", "posterior", "regression", "identification"))
    code, tasks = source_key(*rooms, Path(__file__)), []
    for number, where in enumerate(WHERE):
        for kind, count, task, more in (
            ("quiet", asked.arms, quiet, (asked.seconds,)),
            ("logs", asked.logs, asked_of_logs, ()),
            ("pushed", asked.pushed, pushed, ()),
        ):
            for k in range(count):
                seed = SEED + k + 100 * number + 1000 * KINDS.index(kind)
                name = f"{where} {kind} {seed}"
                tasks.append(Task.of_one(name, key_of(code, name, *more), task, seed, where, *more))
    cells = run_tasks(tasks, ROOT / "out" / "ever_new_poses", jobs=asked.jobs, say=say)
    found = {"seconds": asked.seconds}
    for where in WHERE:
        of = {k: [c for name, c in cells.items() if name.startswith(f"{where} {k}")] for k in KINDS}
        n, called, kept = (sum(one[key] for one in of["pushed"]) for key in ("pushes", "called", "kept"))
        pushes = {"pushes": n, "called": called, "kept": kept, "called, 95 %": wilson(called, n)}
        found[where] = of | {"of pushes": pushes}
    write("ever_new_poses", found)
    write_table(PAGE, "ever new poses", table(found))


if __name__ == "__main__":
    main()
