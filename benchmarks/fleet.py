"""A fleet of Pandas over some weeks, known to the last gram: what `armload survey` finds of it, and what it costs.

    python benchmarks/fleet.py [--arms 20] [--days 30] [--logs 2000] [--seed 5] [--jobs 2] [--out out/fleet]
                               [--parts make,survey,judge,speed] [--some 100]

make    logs by inverse dynamics (`simulate_inverse`) of arms that differ from their model as real ones do, with offsets
        and friction that differ from day to day by half of what `life.py` assumes. Each arm works four motions of its
        own, 12 s at 100 Hz, and takes up and puts down boxes of up to 2.5 kg, all at once; the first log of a day
        is empty, 24 s. From the middle day on, one arm is another one (exchanged), one holds things loosely, so that
        they slide by 5 mm either way along an axis across its flange (loose), and the offset of one arm's second joint
        walks by 0.3 N·m a day. 3 % of the logs are broken, in eight ways. Of each arm there is a tare of 24 s of the
        day before the first.
survey  `armload survey` with these tares; it goes on where it was stopped.
judge   against the truth: changes of payload (found within 0.5 s), masses and their intervals, arms, broken files.
speed   1 and 2 processes and 2 Dask workers, one after the other, on the same logs (--some of them), start-up included.
        Only an idle machine says how much faster two are.

`--parts survey,judge` goes on with logs that are made. Printed, and written to benchmarks/results/fleet.json (speed to
fleet_speed.json) and tables of docs/survey.md, with the numbers of arms, days and logs that were asked for.
"""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from alarms import wilson
from life import FRICTION, OFFSET
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import Play

from armload import Recording, arm
from armload.lab.episodes.motion_kinds import MotionSource
from armload.payloads import draw_payload
from armload.recording import write_recording
from armload.simulation import Sensors, World, simulate_inverse
from armload.survey import read_rows
from armload.survey.findings import arm_findings

RATE, EMPTY, WORK = 100.0, 24.0, 12.0  # [Hz], [s], [s]
DRIFT = 0.5  # of a day, in what `life.py` assumes
WALK = 0.3  # [N·m] a day
GAP = 0.005  # [m] that a loose gripper lets things slide, either way
BEGAN, DAY = 1_790_000_000.0, 86400.0  # [s since 1970], [s]
BROKEN = 0.03
NEAR = 0.5  # [s] between a change and where it is found
LIGHTEST = 0.5  # [kg] of the changes that are counted apart
SHARE = 0.8  # of a part's time that one payload was held, at least, for its mass to be judged
KINDS = ("cut", "empty", "text", "degrees", "no torque", "not a number", "frozen", "six joints")


def role(k: int) -> str:
    """What is wrong with an arm from the middle day on."""
    return {1: "exchanged", 2: "loose", 3: "walking"}.get(k, "sound")


def world_of(panda: Any, k: int, day: int, days: int, seed: int) -> World:
    """An arm on one day."""
    late = day >= days // 2
    made = World.real_like(panda, 1000 * seed + k + (500 if late and role(k) == "exchanged" else 0))
    rng = np.random.default_rng([seed, k, day + 1, 21])
    level = made.friction.level * np.maximum(1.0 + DRIFT * FRICTION * rng.normal(size=7), 0.2)
    offset = made.offset + DRIFT * OFFSET * rng.normal(size=7)
    if role(k) == "walking" and late:
        offset[1] += WALK * (day - days // 2 + 1)
    return replace(made, offset=offset, friction=replace(made.friction, level=level))


def make(folder: Path, arms: int, days: int, logs: int, seed: int) -> None:
    """Write the fleet's logs and its truth."""
    began, worked, panda = time.perf_counter(), time.process_time(), arm("panda")
    sensors, source = Sensors.panda(panda).evenly(), MotionSource(panda, 0.0)
    shutil.rmtree(folder, ignore_errors=True)
    truth: list[dict[str, Any]] = []
    per_day = np.diff(np.linspace(0, logs, arms * days + 1).round().astype(int)).reshape(days, arms)
    for k in range(arms):
        rng = np.random.default_rng([seed, k, 22])
        empty = source.draw("long", rng, EMPTY, f"empty-{k}")
        centre = source.centre(empty)
        kinds = ("long", "pick-and-place", "fast", "point-to-point")
        work = [source.draw(kind, rng, WORK, f"{kind}-{k}", centre, 0.5) for kind in kinds]
        turn = np.random.default_rng([seed, k, 23]).uniform(0.0, 2.0 * np.pi)
        axis = np.array([np.cos(turn), np.sin(turn), 0.0])  # of a loose gripper's jaws
        name = f"arm-{k:02d}"
        (folder / "logs" / name).mkdir(parents=True)
        (folder / "tares").mkdir(exist_ok=True)
        how: dict[str, Any] = {"sensors": sensors, "rate": RATE}
        tare = simulate_inverse(panda, empty, world=world_of(panda, k, -1, days, seed), seed=seed, **how)
        write_recording(folder / "tares" / f"{name}.parquet", replace(tare, t=tare.t + BEGAN - DAY))
        for day in range(days):
            world = world_of(panda, k, day, days, seed)
            for i in range(per_day[day, k]):
                number = int(rng.integers(1 << 30))
                date = BEGAN + DAY * day + 1800.0 * i
                held: list[tuple[float, Any]] = [(0.0, None)]
                motion = empty if i == 0 else work[number % len(work)]
                seconds = EMPTY if i == 0 else WORK
                if i > 0:
                    held = drawn_payloads(rng)
                log = simulate_inverse(panda, motion, held, world=world, duration=seconds, seed=number, **how)
                loose = role(k) == "loose" and day >= days // 2
                if loose:
                    log = with_play(panda, motion, log, held, axis)
                broken = str(rng.choice(KINDS)) if i > 0 and rng.random() < BROKEN else None
                suffix = str(rng.choice([".parquet", ".csv", ".npz"], p=[0.7, 0.2, 0.1]))
                path = folder / "logs" / name / f"day-{day:02d}-{i:02d}{suffix}"
                path = write_log(path, replace(log, t=log.t + date), broken)
                masses = [[t, 0.0 if p is None else p.parameters.mass] for t, p in held]
                about = {"log": str(path), "arm": name, "day": day, "held": masses, "seconds": seconds}
                truth.append(about | {"broken": broken, "role": role(k), "late": day >= days // 2})
        say(f"{name}: {sum(x['arm'] == name for x in truth)} logs, {time.perf_counter() - began:.0f} s")
    about = {"arms": arms, "days": days, "logs": len(truth), "seed": seed}
    about |= {"made in [s]": time.perf_counter() - began, "cpu [s]": time.process_time() - worked}
    (folder / "truth.json").write_text(json.dumps({"about": about, "logs": truth}), encoding="utf-8")


def drawn_payloads(rng: np.random.Generator) -> list[tuple[float, Any]]:
    """Held throughout, taken up, put down, or both; a sixth of the logs hold nothing."""
    kind = rng.integers(6)
    mass = float(np.exp(rng.uniform(np.log(0.3), np.log(2.5))))
    payload, early, late = None, float(rng.uniform(3.0, 5.0)), float(rng.uniform(7.0, 9.0))
    for _ in range(20):
        payload = draw_payload("boxes", int(rng.integers(1 << 30)), mass)
        if payload.parameters.mass > 0.3:
            break
    plans = {
        0: [(0.0, None)],
        1: [(0.0, payload)],
        2: [(0.0, None), (early, payload)],
        3: [(0.0, payload), (late, None)],
    }
    return plans.get(int(kind), [(0.0, None), (early, payload), (late, None)])


def with_play(panda: Any, motion: Any, log: Recording, held: list, axis: np.ndarray, gap: float = GAP) -> Recording:
    """What is held sits loosely: it slides by `gap` [m] either way between two stops along an axis of the flange."""
    tau = log.tau.copy()
    for (since, payload), until in zip(held, [*(t for t, _ in held[1:]), np.inf], strict=True):
        if payload is None:
            continue
        phi = payload.parameters.phi
        rows = (log.t >= since) & (log.t < until)
        tau[rows] += Play(phi[0], gap, axis).beside(panda, motion, phi[1:4] / phi[0], log.t)[rows]
    return replace(log, tau=tau)


def write_log(path: Path, log: Recording, broken: str | None) -> Path:
    """Write a log, or what is left of one."""
    if broken in ("empty", "text"):
        path.write_bytes(b"" if broken == "empty" else b"this is no log\n" * 50)
        return path
    if broken == "cut":
        path = path.with_suffix(".parquet")
        write_recording(path, log)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        return path
    if broken == "frozen":
        log = replace(log, tau=np.broadcast_to(log.tau[0], log.tau.shape))
    if broken == "degrees":
        log = replace(log, q=np.degrees(log.q), dq=np.degrees(log.dq))
    if broken == "six joints":
        log = Recording(log.t, log.q[:, :6], log.dq[:, :6], log.tau[:, :6])
    if broken in ("no torque", "not a number"):
        path = path.with_suffix(".csv")
        write_recording(path, log)
        lines = path.read_text(encoding="utf-8").splitlines()
        if broken == "no torque":
            lines = [",".join(line.split(",")[:15]) for line in lines]
        else:
            cells = lines[200].split(",")
            lines[200] = ",".join([*cells[:-1], "nan"])
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path
    write_recording(path, log)
    return path


def command(folder: Path, out: str, jobs: int, *more: str, logs: str = "logs") -> list[str]:
    """The survey of a fleet."""
    tare = f"{folder}/tares/{{arm}}.parquet"
    words = [sys.executable, "-m", "armload", "survey", f"{folder}/{logs}", "--robot", "panda", "--tare", tare]
    return [*words, "--out", f"{folder}/{out}", "--jobs", str(jobs), *more]


def held_of(one: dict[str, Any]) -> list[tuple[float, float, float]]:
    """(from, to, mass) of a log's truth."""
    times = [*(t for t, _ in one["held"]), one["seconds"]]
    return [(times[i], times[i + 1], mass) for i, (_, mass) in enumerate(one["held"])]


def judge(folder: Path) -> dict[str, Any]:
    """The survey against the truth."""
    made = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    rows, _ = read_rows(folder / "survey.parquet")
    parts: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        parts.setdefault(row["log"], []).append(row)
    tally: dict[str, dict[str, list]] = {}
    refused, missed = [], []
    for one in made["logs"]:
        group = one["role"] if one["late"] or one["role"] == "sound" else "before"
        if one["log"] not in parts:
            continue
        of = parts[one["log"]]
        if of[0]["status"] != "answered" or one["broken"]:
            if one["broken"] and of[0]["status"] == "answered":
                missed.append([name_of(one["log"]), one["broken"]])
            if not one["broken"]:
                refused.append([name_of(one["log"]), of[0]["reason"].replace(one["log"], name_of(one["log"]))])
            continue
        into: dict[str, list] = {key: [] for key in ("true", "found", "error", "inside", "changed", "moves")}
        true = [t for t, _ in one["held"][1:]]
        found = [row["t0"] for row in of[1:]]
        sizes = [abs(b[1] - a[1]) for a, b in zip(one["held"], one["held"][1:], strict=False)]
        into["true"] += [[size, any(abs(t - f) < NEAR for f in found)] for t, size in zip(true, sizes, strict=True)]
        into["found"] += [any(abs(t - f) < NEAR for t in true) for f in found]
        into["changed"].append(any(row["changed"] for row in of))
        into["moves"].append(any(row["moves"] for row in of))
        for row in of:
            for a, b, mass in held_of(one):
                if min(b, row["t1"]) - max(a, row["t0"]) > SHARE * (row["t1"] - row["t0"]):
                    into["error"].append([mass, row["mass"] - mass])
                    into["inside"].append(row["mass_low"] <= mass <= row["mass_high"])
        for name in (group, one["arm"]):
            of_name = tally.setdefault(name, {key: [] for key in into})
            for key, values in into.items():
                of_name[key] += values
    groups = {
        name: summed(tally[name]) for name in ("sound", "before", "walking", "exchanged", "loose") if name in tally
    }
    broken = [one for one in made["logs"] if one["broken"] and one["log"] in parts]
    arms = {one["arm"]: one["role"] for one in made["logs"]}
    findings = [
        {
            "arm": f.arm,
            "role": arms[f.arm],
            "changed": f.changed,
            "moves": f.moves,
            "retare": f.retare,
            "loose": f.loose,
            "shift": None if f.shift is None else f.shift.z,
            "slide": None if f.slide is None else f.slide.z,
            "slides [mm]": None if f.slide is None else [1e3 * f.slide.gap, 1e3 * f.slide.std],
        }
        | {"since day": None if not isinstance(f.since, float) else round((f.since - BEGAN) / DAY, 2), "joint": f.joint}
        for f in arm_findings(rows)
    ]
    return made["about"] | {
        "answered logs": sum(of[0]["status"] == "answered" for of in parts.values()),
        "rows": len(rows),
        "groups": groups,
        "each": {name: summed(tally[name]) | {"role": role} for name, role in sorted(arms.items()) if name in tally},
        "broken files": len(broken),
        "broken files not reported": missed,
        "sound files refused": refused,
        "arms": findings,
    }


def name_of(log: str) -> str:
    """A log as it is called, wherever the fleet lies."""
    return "/".join(Path(log).parts[-2:])


def summed(of: dict[str, list]) -> dict[str, Any]:
    """Rates with Wilson's 95 % intervals, errors in grams."""
    error = 1e3 * np.array([e for _, e in of["error"]])
    heavy = [hit for size, hit in of["true"] if size >= LIGHTEST]
    hits = {"recall": [h for _, h in of["true"]], "recall from 0.5 kg": heavy, "precision": of["found"]}
    hits |= {"inside": of["inside"], "changed": of["changed"], "moves": of["moves"]}
    rates = {key: [len(x), float(np.mean(x)) if x else None, *wilson(sum(x), len(x))] for key, x in hits.items() if x}
    both = [float(np.mean(np.abs(error))), float(np.median(np.abs(error)))] if len(error) else [np.nan, np.nan]
    return rates | {"mass error [g]": both}


def speed(folder: Path, count: int) -> dict[str, Any]:
    """The same logs on 1 and 2 processes and 2 Dask workers, one after the other, and what they cost."""
    some = folder / "some"
    shutil.rmtree(some, ignore_errors=True)
    logs = sorted((folder / "logs").rglob("day-*.parquet"))
    chosen = logs[:: max(len(logs) // count, 1)][:count]
    for path in chosen:
        (some / path.parent.name).mkdir(parents=True, exist_ok=True)
        shutil.copy(path, some / path.parent.name / path.name)
    out: dict[str, Any] = {"logs": len(chosen), "runs": {}}
    first = folder / "speed-1.parquet"
    for name, jobs, more in (
        ("1 process", 1, ()),
        ("2 processes", 2, ()),
        ("2 Dask workers", 2, ("--cluster", "local")),
    ):
        table = first if jobs == 1 else folder / "speed-2.parquet"
        shutil.rmtree(folder / f"{table.name}.cells", ignore_errors=True)
        began, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command(folder, table.name, jobs, *more, logs="some"), capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"{name}: {done.stderr.strip().splitlines()[-1]}")
        seconds, now = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        one = {"seconds": seconds, "cpu seconds": now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime}
        rows, _ = read_rows(table)
        one |= {"logs per s": len(chosen) / seconds, "same bytes": table.read_bytes() == first.read_bytes()}
        one |= {"samples per s": sum(row["samples"] or 0 for row in rows) / seconds}
        one |= {"times as fast as 1": out["runs"].get("1 process", one)["seconds"] / seconds}
        out["runs"][name] = one
        say(f"{name}: {one}")
    both = [out["runs"][name]["seconds"] for name in ("2 processes", "2 Dask workers")]
    return out | {"Dask over processes": both[1] / both[0] - 1.0}


def table_of_speed(found: dict[str, Any]) -> str:
    """For docs/survey.md."""
    heads = ["engine", "logs/s", "samples/s", "CPU [s]", "times as fast", "same bytes"]
    rows = [
        [
            name,
            f"{of['logs per s']:.2f}",
            f"{of['samples per s']:.0f}",
            f"{of['cpu seconds']:.0f}",
            f"{of['times as fast as 1']:.2f}",
            "yes" if of["same bytes"] else "no",
        ]
        for name, of in found["runs"].items()
    ]
    return markdown_table(heads, "lrrrrr", rows)


def tables(found: dict[str, Any]) -> dict[str, str]:
    """For docs/survey.md."""

    def rate(values: list | None) -> str:
        if values is None:
            return ""
        return f"{100 * values[1]:.0f} % ({100 * values[2]:.0f}–{100 * values[3]:.0f}) of {values[0]}"

    names = ("recall", "recall from 0.5 kg", "precision", "inside", "changed", "moves")
    heads = ["logs", "changes found", "of 0.5 kg and more", "of those found, true", "masses inside", "changed", "moves"]
    rows = [
        [
            group,
            *(rate(of.get(name)) for name in names),
            f"{of['mass error [g]'][1]:.0f} · {of['mass error [g]'][0]:.0f}",
        ]
        for group, of in found["groups"].items()
    ]
    payloads = markdown_table([*heads, "mass error [g]"], "lrrrrrrr", rows)
    rows = []
    for role in ("sound", "exchanged", "walking", "loose"):
        of = [f for f in found["arms"] if f["role"] == role]
        if not of:
            continue
        slides = [f["slides [mm]"] for f in of if f["loose"] and f["slides [mm]"] is not None]
        since = sorted({f["since day"] for f in of if f["since day"] is not None})
        called = [sum(f[what] for f in of) for what in ("retare", "loose")]
        rows.append(
            [
                role,
                str(len(of)),
                *(rate([len(of), k / len(of), *wilson(k, len(of))]) for k in called),
                *(span_of([f[what] for f in of if f[what] is not None]) for what in ("shift", "slide")),
                ", ".join(f"{gap:.1f} ± {std:.1f}" for gap, std in slides) if called[1] else "",
                ", ".join(f"{day:g}" for day in since),
            ]
        )
    heads = ["arms", "how many", "to re-tare", "look at the gripper", "shift z", "slide z", "slides [mm]", "since day"]
    out = {"payloads": payloads, "arms": markdown_table(heads, "lrrrrrrr", rows), "files": files(found)}
    each = [
        [
            name,
            of["role"],
            *(rate(of.get(what)) for what in ("recall", "precision", "inside")),
            f"{of['mass error [g]'][1]:.0f} · {of['mass error [g]'][0]:.0f}",
        ]
        for name, of in found["each"].items()
    ]
    heads = ["arm", "truth", "changes found", "of those found, true", "masses inside", "mass error [g]"]
    return out | {"each": markdown_table(heads, "llrrrr", each)}


def span_of(values: list[float]) -> str:
    """From the smallest to the largest."""
    return "" if not values else f"{values[0]:.1f}" if len(values) == 1 else f"{min(values):.1f} … {max(values):.1f}"


def files(found: dict[str, Any]) -> str:
    """Broken files, and sound ones that were refused."""
    broken, missed = found["broken files"], len(found["broken files not reported"])
    sound, refused = found["answered logs"] - missed, len(found["sound files refused"])
    rows = [[str(broken), str(broken - missed), str(sound + refused), str(refused)]]
    return markdown_table(["broken files", "reported", "sound files", "refused"], "rrrr", rows)


def main() -> None:
    asked = options(
        __doc__, arms=20, days=30, logs=2000, seed=5, jobs=2, some=100, out="out/fleet", parts="make,survey,judge,speed"
    )
    folder, parts = Path(asked.out), asked.parts.split(",")
    if "make" in parts:
        make(folder, asked.arms, asked.days, asked.logs, asked.seed)
    seconds = None
    if "survey" in parts:
        began = time.perf_counter()
        subprocess.run(command(folder, "survey.parquet", asked.jobs), check=True)
        seconds = time.perf_counter() - began
    if "judge" in parts:
        found = judge(folder) | {"surveyed in [s]": seconds, "jobs": asked.jobs}
        for name, text in tables(found).items():
            say(f"{text}\n")
            write_table(ROOT / "docs" / "survey.md", name, text)
        write("fleet", found)
    if "speed" in parts:
        found = speed(folder, asked.some)
        write_table(ROOT / "docs" / "survey.md", "speed", table_of_speed(found))
        write("fleet_speed", found)


if __name__ == "__main__":
    main()
