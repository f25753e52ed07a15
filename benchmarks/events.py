"""How well changes of payload are noticed on a live stream, and what is known shortly after one.

    python benchmarks/events.py [--quick] [--parts steps,quiet,hybrid,pushes,hybrid_pushes,cycles,real] [--jobs 1]

Every scene is another real-like Panda (`World.real_like`, the sensors as measured: `Sensors.panda`, 8 % of the samples
lost) that goes on moving, every other one along the published excitation, the rest along random motions. What the arm
holds changes by 0.2 kg and more every 5 to 20 s: boxes, shapes, the container with weights, or nothing; a quarter of
the changes takes back what was held before the last one. One scene in five has a tare.

steps      `map-gp` at 200 Hz (its detector is the hybrid's, and one row in 5 ms is all either uses)
quiet      the same with nothing changing for five minutes: half of the arms empty, half loaded
hybrid     the hybrid at 1 kHz: also whether its intervals hold shortly after a change
pushes     a person pushes the arm: 10–60 N in a random direction at the flange or at the forearm, 0.3–3 s, rising and
           falling smoothly. The torque J(q)ᵀ·F is added to what the joints' sensors see; the arm stays on its way, as
           under stiff control. Nothing is taken up or put down.
cycles     the hybrid at 200 Hz: one payload taken up and put down every half period of the published excitation,
           always in the same two poses, for three minutes
real       logs of real arms without any change; and the real unloaded Panda with payloads' torque added in steps

A change counts as noticed with its first event within 1 s. Every other event is a false alarm, but for one: the first
event 1 to 3 s after a change not noticed before is a late one. The time in which a false alarm can happen is all but
the first second after each change; 95 % bounds are Poisson's, one-sided above.

Scenes are cells in out/events: what was measured once is not measured again while `online/watch.py`,
`online/modes.py` and `online/thresholds.py` stay as they are. Written to benchmarks/results/events.json, where a part
that was not asked for keeps what was measured of it before. In full about 50 minutes of CPU time. Printed only:
--quick, two short scenes of each part; --seed, added to all seeds, to set constants on others; --scenes, at most so
many of each part.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from real_logs import data
from scipy.signal import savgol_filter
from scipy.stats import chi2
from script import RESULTS, ROOT, options, say, write
from threadpoolctl import threadpool_limits

import armload.online
from armload import Recording, arm, read_recording
from armload.arms import payload_regressor
from armload.devices import Simulator
from armload.inertia import Z95
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key
from armload.motion import random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.payloads import draw_payload
from armload.simulation import Sensors, World, simulate

CELLS = ROOT / "out" / "events"
FIRST_SEED = 50_000  # constants were set on seeds below 10 000
FAMILIES = ("boxes", "shapes", "container")
STEP, EVERY = 0.2, (5.0, 20.0)  # [kg] at least, [s] between
LOOKED = (0.5, 1.0, 2.0)  # [s] after a change
NOTICED, LATE = 1.0, 3.0  # [s]
_TARE = 10.0  # [s] of the real log
SLACK = 0.1  # [kg] an estimate that far off is not called wrong


@dataclass(frozen=True)
class Scene:
    """One stream: which part, its seed, how long [s], samples per second, method."""

    part: str
    seed: int
    seconds: float
    rate: float
    method: str


def scenes(quick: bool, most: int) -> list[Scene]:
    """All scenes of the simulated parts, at most so many of each."""
    kinds = (
        ("steps", 48, 300.0, 200.0, "map-gp"),
        ("quiet", 18, 300.0, 200.0, "map-gp"),
        ("hybrid", 24, 120.0, 1000.0, "hybrid"),
        ("pushes", 20, 120.0, 200.0, "map-gp"),
        ("hybrid_pushes", 6, 120.0, 1000.0, "hybrid"),
        ("cycles", 10, 180.0, 200.0, "hybrid"),
    )
    out = []
    for place, (part, count, seconds, rate, method) in enumerate(kinds):
        count, seconds = (2, 40.0) if quick else (min(count, most), seconds)
        out += [Scene(part, FIRST_SEED + 1000 * place + k, seconds, rate, method) for k in range(count)]
    return out


# ---------------------------------------------------------------------- what happens in a scene


def schedule(scene: Scene, rng: np.random.Generator) -> list[tuple[float, Any]]:
    """(time, payload or None) of a scene."""
    first = _payload(rng) if rng.random() < 0.25 else None
    if scene.part == "quiet":
        return [(-1.0, _payload(rng) if scene.seed % 2 else None)]
    if "pushes" in scene.part:
        return [(-1.0, None), *([(3.0, _payload(rng))] if scene.seed % 4 > 1 else [])]
    if scene.part == "cycles":
        payload, times = _payload(rng), np.arange(4.0, scene.seconds - LOOKED[-1], 0.5 * taie2024().duration)
        return [(-1.0, None), *((float(t), None if k % 2 else payload) for k, t in enumerate(times))]
    out, t = [(-1.0, first)], rng.uniform(*EVERY)
    while t < scene.seconds - LOOKED[-1]:
        now, before = out[-1][1], out[-2][1] if len(out) > 1 else None
        while True:
            chance = rng.random()
            new = before if chance < 0.25 else None if chance < 0.5 else _payload(rng)
            if abs(_mass(new) - _mass(now)) >= STEP:
                break
        out.append((float(t), new))
        t += rng.uniform(*EVERY)
    return out


def _payload(rng: np.random.Generator) -> Any:
    rated = float(np.exp(rng.uniform(np.log(0.4), np.log(3.0))))
    while True:
        payload = draw_payload(FAMILIES[rng.integers(len(FAMILIES))], int(rng.integers(1 << 30)), rated)
        if payload.parameters.mass >= STEP:
            return payload


def _mass(payload: Any) -> float:
    return 0.0 if payload is None else payload.parameters.mass


@dataclass(frozen=True)
class Push:
    """A force F (3,) [N] on a link, in the base's axes, from start to end [s]."""

    start: float
    end: float
    link: str
    force: NDArray[np.float64]

    def torque(self, t: NDArray, q: NDArray) -> NDArray[np.float64]:
        """What it adds to the joints' sensors (N, n): −J(q)ᵀ·F, rising and falling over a third of it each."""
        robot = arm("panda", frame=self.link)
        edge = (self.end - self.start) / 3.0
        rise = np.clip(np.minimum(t - self.start, self.end - t) / edge, 0.0, 1.0)
        size = 0.5 - 0.5 * np.cos(np.pi * rise)
        moved = q[:, : robot.n]  # joints beyond the link feel nothing of it
        J = robot.frame_motion(moved).jacobian[:, 3:]  # (N, 3, n) linear, in the link's axes
        rotation = robot.frame_pose(moved)[0]  # (N, 3, 3) link to base
        along = np.einsum("nji,j->ni", rotation, self.force)
        out = np.zeros_like(q)
        out[:, : robot.n] = -size[:, None] * np.einsum("nij,ni->nj", J, along)
        return out


def pushes(scene: Scene, rng: np.random.Generator) -> list[Push]:
    """Those of a scene, far enough apart for what follows to be seen."""
    if "pushes" not in scene.part:
        return []
    out, t = [], 8.0
    while t + 3.0 < scene.seconds - 5.0:
        length, force = rng.uniform(0.3, 3.0), rng.normal(size=3)
        force *= rng.uniform(10.0, 60.0) / np.linalg.norm(force)
        out.append(Push(t, t + length, ("panda_link8", "panda_link4")[rng.integers(2)], force))
        t += length + rng.uniform(5.0, 8.0)
    return out


# ---------------------------------------------------------------------- a stream through the identifier


@dataclass(frozen=True)
class Watched:
    """What the identifier said: events when noticed, and over time (T, 4): t, mass, half-width, whether settling."""

    events: list[dict[str, Any]]
    said: NDArray[np.float64]
    cpu: float

    def at(self, t: float) -> NDArray[np.float64]:
        """The last thing said by t."""
        return self.said[np.searchsorted(self.said[:, 0], t, side="right") - 1]


def watched(identifier: OnlineIdentifier, log: Recording) -> Watched:
    """Feed it a stream."""
    events: dict[float, dict[str, Any]] = {}
    said, last, looked, start = [], None, -np.inf, time.process_time()
    for sample in log:
        estimate = identifier.update(*sample)
        if estimate.event is not last:
            last = estimate.event
            if last is not None:
                events[last.t] = {"t": round(last.t, 4), "kind": last.kind}
        if sample.t - looked >= 0.0095:
            looked = sample.t
            said.append((sample.t, estimate.phi[0], Z95 * estimate.std[0], estimate.settling))
    identifier.close()
    return Watched(list(events.values()), np.array(said, dtype=float), time.process_time() - start)


def streamed(scene: Scene) -> tuple[Recording, list[tuple[float, Any]], list[Push], Recording | None]:
    """The samples of a scene, what was held from when, the pushes, and a tare if there is one."""
    robot, rng = arm("panda"), np.random.default_rng([scene.seed, 5])
    world, sensors = World.real_like(robot, scene.seed), Sensors.panda(robot)
    held, pushed = schedule(scene, rng), pushes(scene, rng)
    published = scene.seed % 2 or scene.part == "cycles"
    motion = taie2024() if published else random_motion(robot, scene.seed)
    source = Simulator(
        robot,
        motion,
        held,
        world=world,
        sensors=sensors,
        rate=scene.rate,
        speed=None,
        duration=scene.seconds,
        seed=scene.seed,
    )
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    tau = log.tau.copy()
    for push in pushed:
        part = (log.t >= push.start) & (log.t <= push.end)
        tau[part] += push.torque(log.t[part], log.q[part])
    tare = None
    if scene.seed % 5 == 4:
        other = random_motion(robot, scene.seed + 1, duration=20.0, harmonics=10)
        tare = simulate(robot, other, world=world, sensors=sensors, rate=scene.rate, seed=scene.seed)
    return Recording(log.t, log.q, log.dq, tau), held, pushed, tare


def measured(scene: Scene) -> dict[str, Any]:
    """One scene as a cell's numbers."""
    start = time.process_time()
    log, held, pushed, tare = streamed(scene)
    simulated = time.process_time() - start
    found = watched(OnlineIdentifier(arm("panda"), tare, scene.method), log)
    steps = [_step(k, held, found) for k in range(1, len(held))]
    return {
        "seconds": scene.seconds,
        "tare": tare is not None,
        "motion": "taie2024" if scene.seed % 2 or scene.part == "cycles" else "random",
        "steps": steps,
        "pushes": [_pushed(push, k, pushed, held, found, scene.seconds) for k, push in enumerate(pushed)],
        "events": found.events,
        "cpu_s": {"simulation": round(simulated, 2), "identification": round(found.cpu, 2)},
    }


def _step(k: int, held: list[tuple[float, Any]], found: Watched) -> dict[str, Any]:
    """A change: what it was, and what was said at times after it."""
    t, now = held[k]
    before = held[k - 1][1]
    back = k > 1 and held[k - 2][1] is now
    at = np.array([found.at(t + after) for after in LOOKED])
    return {
        "t": t,
        "by": round(_mass(now) - _mass(before), 4),
        "kind": "grasp" if before is None else "release" if now is None else "swap",
        "back": back,
        "mass": round(_mass(now), 5),
        "error": (at[:, 1] - _mass(now)).round(5).tolist(),
        "half_width": at[:, 2].round(5).tolist(),
        "settling": at[:, 3].astype(bool).tolist(),
    }


def _pushed(
    push: Push, k: int, all_of_them: list[Push], held: list[tuple[float, Any]], found: Watched, end: float
) -> dict[str, Any]:
    """A push: what it was called, and how long the estimate was wrong after it, against what it was before."""
    until = all_of_them[k + 1].start if k + 1 < len(all_of_them) else end
    mass = _mass(held[int(np.searchsorted([t for t, _ in held], push.start, side="right")) - 1][1])
    part = found.said[(found.said[:, 0] >= push.end) & (found.said[:, 0] < until)]
    error, half = np.abs(part[:, 1] - mass), part[:, 2]
    wrong = (error > np.maximum(half, SLACK)) | (part[:, 3] > 0)
    uncertain = half > SLACK + 2.0 * found.at(push.start)[2]
    bad = np.flatnonzero(wrong | uncertain)
    later = found.at(min(push.end + 2.0, until))
    return {
        "t": push.start,
        "seconds": round(push.end - push.start, 3),
        "newtons": round(float(np.linalg.norm(push.force)), 2),
        "link": push.link,
        "events": [e for e in found.events if push.start <= e["t"] < until],
        "wrong_s": round(float(part[bad[-1], 0] - push.end), 3) if len(bad) else 0.0,
        "error_before": round(float(found.at(push.start)[1] - mass), 5),
        "error_2s": round(float(later[1] - mass), 5),
        "half_width_2s": round(float(later[2]), 5),
    }


# ---------------------------------------------------------------------- real logs


def real(method: str) -> dict[str, Any]:
    """Real logs without a change; and the unloaded Panda with what it holds changing every 4 s, tared or not."""
    folder, panda = data(), arm("panda")
    logs = {"panda_unloaded_1khz": (read_recording(folder / "panda_unloaded_1khz.csv", panda), panda)}
    ur = arm(folder / "ur10e.urdf", "tool0")
    for name in ("ur10e_unloaded", "ur10e_loaded_2805g"):
        logs[name] = (read_recording(folder / f"{name}.csv", ur), ur)
    quiet = {}
    for name, (log, robot) in logs.items():
        found = watched(OnlineIdentifier(robot, None, method), log)
        quiet[name] = {"seconds": round(log.duration, 2), "events": found.events}
    log = logs["panda_unloaded_1khz"][0]
    cut = log.t[0] + _TARE
    tared = stepped(log.between(cut, log.t[-1]), method, (3.0, 7.0), log.between(log.t[0], cut))
    return {"quiet": quiet, "semi_real": stepped(log, method, (4.0, 8.0, 12.0, 16.0)), "semi_real_tared": tared}


def stepped(log: Recording, method: str, times: tuple[float, ...], tare: Recording | None = None) -> dict[str, Any]:
    """The unloaded Panda with what is held changing at about these times [s], twelve times over."""
    panda = arm("panda")
    ddq = np.asarray(savgol_filter(log.dq, 101, 3, deriv=1, delta=1 / log.rate, axis=0))
    W = payload_regressor(panda.frame_motion(log.q), log.dq, ddq)
    steps, alarms, seconds = [], [], 0.0
    for turn in range(12):
        rng, shift = np.random.default_rng([FIRST_SEED, turn]), 0.3 * turn
        held: list[tuple[float, Any]] = [(-1.0, None)]
        for t in times:
            new = None
            while abs(_mass(new) - _mass(held[-1][1])) < STEP:
                new = _payload(rng) if rng.random() < 0.7 else None
            held.append((log.t[0] + t + shift - 0.3 * 6, new))
        phi = np.array([np.zeros(10) if p is None else p.parameters.phi for _, p in held])
        which = np.searchsorted([t for t, _ in held], log.t, side="right") - 1
        loaded = Recording(log.t, log.q, log.dq, log.tau + np.einsum("nij,nj->ni", W, phi[which]))
        found = watched(OnlineIdentifier(panda, tare, method), loaded)
        turned = [_step(k, held, found) for k in range(1, len(held))]
        alarms += matched(turned, found.events)[1]
        steps += turned
        seconds += log.duration
    return {"seconds": round(seconds, 1), "steps": steps, "false": alarms}


# ---------------------------------------------------------------------- what the cells say


def matched(steps: list[dict], events: list[dict]) -> tuple[list[dict], list[dict]]:
    """Give each change its event (`delay`, `said`; late ones too), and return the changes and all other events."""
    rest = []
    for k, step in enumerate(steps):
        until = steps[k + 1]["t"] if k + 1 < len(steps) else np.inf
        own = [e for e in events if step["t"] <= e["t"] < until]
        step["delay"] = step["said"] = None
        if own and own[0]["t"] - step["t"] <= LATE:
            step["delay"], step["said"] = round(own[0]["t"] - step["t"], 4), own[0]["kind"]
            own = own[1:]
        rest += [e | {"after": round(e["t"] - step["t"], 3)} for e in own]
    first = steps[0]["t"] if steps else np.inf
    return steps, rest + [e | {"after": None} for e in events if e["t"] < first]


def poisson(count: int, hours: float) -> dict[str, Any]:
    """Events per hour and the 95 % bound above."""
    return {
        "count": count,
        "hours": round(hours, 4),
        "per_hour": round(count / hours, 3),
        "bound_95_per_hour": round(float(chi2.ppf(0.95, 2 * count + 2)) / 2.0 / hours, 3),
    }


def _share(values: Any) -> float | None:
    values = list(values)
    return round(float(np.mean(values)), 4) if values else None


def noticing(steps: list[dict]) -> dict[str, Any]:
    """Delays, shares missed, kinds, and the mass some time after, over changes that were `matched`."""
    delays = np.array([s["delay"] if s["delay"] is not None else np.inf for s in steps])
    seen = delays[delays <= NOTICED]
    size = np.abs([s["by"] for s in steps])
    kinds: dict[str, dict[str, int]] = {}
    right = []
    for s in (s for s in steps if s["delay"] is not None and s["delay"] <= NOTICED):
        true = s["kind"] + (", back" if s["back"] else "")
        kinds.setdefault(true, {})
        kinds[true][s["said"]] = kinds[true].get(s["said"], 0) + 1
        right.append(s["said"] == s["kind"] or (s["back"] and s["said"] == "return"))
    out: dict[str, Any] = {
        "changes": len(steps),
        "delay_s": {f"{q:g} %": round(float(np.percentile(seen, q)), 4) for q in (50, 90, 99)} if len(seen) else None,
        "missed": round(float(np.mean(delays > NOTICED)), 4),
        "missed_count": int(np.sum(delays > NOTICED)),
        "late": int(np.sum(np.isfinite(delays) & (delays > NOTICED))),
        "not_within_0.3_s": round(float(np.mean(delays > 0.3)), 4),
        "missed_by_size": {
            f"{low:g} to {high:g} kg": f"{int(np.sum(delays[part] > NOTICED))} of {int(part.sum())}"
            for low, high in ((0.2, 0.4), (0.4, 0.8), (0.8, 3.0))
            if (part := (size >= low) & (size < high)).any()
        },
        "right_kind": _share(right),
        "kinds": dict(sorted(kinds.items())),
    }
    for k, after in enumerate(LOOKED):
        error, half = np.abs([s["error"][k] for s in steps]), np.array([s["half_width"][k] for s in steps])
        inside = error <= half
        out[f"mass_after_{after:g}_s"] = {
            "inside_95": _share(inside),
            "standard_error": round(float(np.sqrt(inside.mean() * (1 - inside.mean()) / len(inside))), 4),
            "inside_95_of_noticed": _share(inside[delays <= min(after, NOTICED)]),
            "median_error_kg": round(float(np.median(error)), 4),
            "error_90_kg": round(float(np.percentile(error, 90)), 4),
            "median_half_width_kg": round(float(np.median(half)), 4),
        }
    return out


def of_part(cells: list[dict]) -> dict[str, Any]:
    """The changes of a part, all and with a tare, and the false alarms."""
    steps, alarms, risk = [], [], 0.0
    groups: dict[str, list[dict]] = {"with a tare": [], "without": [], "taie2024": [], "random": []}
    for cell in cells:
        own, false = matched(cell["steps"], cell["events"])
        steps += own
        groups["with a tare" if cell["tare"] else "without"] += own
        groups[cell["motion"]] += own
        alarms += [e | {"scene": cell["name"]} for e in false]
        risk += cell["seconds"] - NOTICED * len(own)
    out: dict[str, Any] = {"scenes": len(cells), "hours": round(sum(c["seconds"] for c in cells) / 3600, 3)}
    if steps:
        out |= noticing(steps)
        brief = ("changes", "missed", "right_kind", "mass_after_1_s")
        if cells[0]["name"].startswith("cycles"):
            groups |= {f"minute {k + 1}": [s for s in steps if 60 * k <= s["t"] < 60 * (k + 1)] for k in range(3)}
        out["groups"] = {name: {k: noticing(g)[k] for k in brief} for name, g in groups.items() if g}
    return out | {"false_alarms": poisson(len(alarms), risk / 3600) | {"which": alarms}}


def of_pushes(cells: list[dict]) -> dict[str, Any]:
    """What pushes were called, and what they did to the estimate."""
    every = [push for cell in cells for push in cell["pushes"]]
    called = [push for push in every if push["events"]]
    out: dict[str, Any] = {
        "pushes": len(every),
        "called_a_change": len(called),
        "share_called": _share(bool(p["events"]) for p in every),
        "of_those_followed_by_return": _share(p["events"][-1]["kind"] == "return" for p in called),
        "called_by_newtons": {
            f"{low} to {low + 10} N": f"{sum(bool(p['events']) for p in part)} of {len(part)}"
            for low in range(10, 60, 10)
            if (part := [p for p in every if low <= p["newtons"] < low + 10])
        },
        "called_by_link": {
            link: f"{sum(bool(p['events']) for p in part)} of {len(part)}"
            for link in ("panda_link8", "panda_link4")
            if (part := [p for p in every if p["link"] == link])
        },
    }
    for name, part in (("called", called), ("not_called", [p for p in every if not p["events"]])):
        if part:
            wrong = [p["wrong_s"] for p in part]
            error = np.abs([p["error_2s"] for p in part])
            out[name] = {
                "wrong_after_s": {f"{q:g} %": round(float(np.percentile(wrong, q)), 3) for q in (50, 90, 100)},
                "error_2s_after_kg": {f"{q:g} %": round(float(np.percentile(error, q)), 4) for q in (50, 90, 100)},
                "inside_95_2s_after": _share(error <= [p["half_width_2s"] for p in part]),
            }
    return out


def of_real(cell: dict) -> dict[str, Any]:
    """False alarms on real logs, and steps on a real log, without a tare and with its first ten seconds."""
    quiet = cell["quiet"]
    out: dict[str, Any] = {}
    for robot in ("panda", "ur10e"):
        logs = [log for name, log in quiet.items() if name.startswith(robot)]
        if logs:
            seconds = sum(log["seconds"] for log in logs)
            out[robot] = {"minutes": round(seconds / 60, 2)} | poisson(
                sum(len(log["events"]) for log in logs), seconds / 3600
            )
    for name, semi in (("panda_steps_added", cell["semi_real"]), ("panda_steps_added, tare", cell["semi_real_tared"])):
        risk = semi["seconds"] - NOTICED * len(semi["steps"])
        false = poisson(len(semi["false"]), risk / 3600)
        out[name] = noticing(semi["steps"]) | {"false_alarms": false | {"which": semi["false"]}}
    return out


# ---------------------------------------------------------------------- the run


def summary(cells: dict[str, list[dict]]) -> dict[str, Any]:
    """All parts that have cells."""
    out: dict[str, Any] = {}
    for part, found in cells.items():
        if part == "real":
            out[part] = {cell["name"].removeprefix("real-"): of_real(cell) for cell in found}
        elif found:
            out[part] = of_pushes(found) if "pushes" in part else of_part(found)
    return out


def in_all(parts: dict[str, Any]) -> dict[str, Any]:
    """False alarms of all parts in which nobody pushes."""
    quiet = [parts[part]["false_alarms"] for part in ("steps", "quiet", "hybrid") if part in parts]
    return poisson(sum(x["count"] for x in quiet), sum(x["hours"] for x in quiet)) if quiet else {}


def tasks(part: str, quick: bool, seed: int, most: int) -> list[Task]:
    """The cells of a part."""
    decides = ("modes.py", "watch.py", "thresholds.py")
    code = source_key(*(Path(armload.online.__path__[0]) / name for name in decides))
    if part == "real":
        return [Task.of_one(f"real-{method}", key_of(method, code), real, method) for method in ("map-gp", "hybrid")]
    drawn = [replace(scene, seed=scene.seed + seed) for scene in scenes(quick, most) if scene.part == part]
    named = {f"{part}-{scene.seed}-{scene.seconds:g}s": scene for scene in drawn}
    return [Task.of_one(name, key_of(asdict(scene), code), measured, scene) for name, scene in named.items()]


def main() -> None:
    asked = options(
        __doc__,
        quick=False,
        parts="steps,quiet,hybrid,pushes,hybrid_pushes,cycles,real",
        cells=CELLS,
        seed=0,
        scenes=1000,
        jobs=1,
    )
    cells = {}
    with threadpool_limits(1):
        for part in asked.parts.split(","):
            wanted = tasks(part, asked.quick, asked.seed, asked.scenes)
            cells[part] = list(run_tasks(wanted, asked.cells, jobs=asked.jobs, say=say).values())
    full = not asked.quick and not asked.seed and asked.scenes >= 1000
    path = RESULTS / "events.json"
    before = json.loads(path.read_text())["parts"] if full and path.is_file() else {}
    found = before | summary(cells)
    result = {
        "seeds_from": FIRST_SEED + asked.seed,
        "targets": {"median_delay_s": 0.3, "missed": 0.01, "false_alarms_per_hour": 1.0},
        "parts": found | {"false_alarms_in_all": in_all(found)},
    }
    if full:
        write("events", result)
    else:
        print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
