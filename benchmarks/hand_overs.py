"""What a live stream says while a payload is handed over slowly, is light, or the arm stands, drifts or is pushed.

    python benchmarks/hand_overs.py [--quick] [--parts steps,ramps,...] [--scenes 3] [--jobs 1]

The default method on real-like Pandas (`World.real_like`, the sensors as measured, 8 % of the samples lost) at 200 Hz,
40 s each, every other one along the published excitation, the rest along random motions. The arm is empty, what is
taken up at about 10 s is put down again at about 22 s: its load torque W(q, dq, ddq)·phi times a ramp is added to the
sensors'.

steps        at once, 0.2 kg and more
ramps_0.5, ramps_2, ramps_5    within so many seconds
light        at once, 50 to 150 g
slow_rate    at once, the stream at 30 samples a second with times that jitter by a fifth
standing     the arm stands from 8 to 14 s and from 20 to 26 s
pushes       10–60 N in a random direction at the flange, 0.3–3 s; every other arm holds a payload since 5 s
drift        ±0.5 N·m on each joint within 40 s, nothing changes
quiet        nothing changes
real         the one real log of an unloaded Panda (21 s at 200 Hz), steps at about 5 and 12 s

A change counts as noticed with its first event from its beginning until a second after its end; all other events are
false, but those during a push and a second after it, which are counted there. *inside* is the share of masses within
their 95 % interval some time after the end. Of all moments, in tenths of a second, `reliability` says how often a
probability was right: p_change that what is held is not what the run at work began with, p_contact that somebody
pushes (but for the first and last fifth of a push).

Scenes are cells in out/hand_overs. Written to benchmarks/results/hand_overs.json, where a part that was not asked for
keeps what was measured of it before, and from there to docs/online.md. Seeds from 90000; constants were set on seeds
below 10.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from events import Push, _payload
from numpy.typing import NDArray
from real_logs import data
from scipy.signal import savgol_filter
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table
from threadpoolctl import threadpool_limits

import armload.online
from armload import Recording, arm, read_recording
from armload.arms import payload_regressor
from armload.devices import Simulator
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key
from armload.motion import Motion, random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.simulation import Sensors, World

SEED = 90_000
PARTS = {
    "steps": 0.0, "ramps_0.5": 0.5, "ramps_2": 2.0, "ramps_5": 5.0, "light": 0.0, "slow_rate": 0.0, "standing": 0.0,
    "pushes": 0.0, "drift": 0.0, "quiet": 0.0, "real": 0.0,
}  # fmt: skip
LOOKED = (0.5, 1.0, 2.0, 5.0)  # [s] after the end of a change
NAMES = {
    "steps": "at once, 0.2 kg and more",
    "ramps_0.5": "within 0.5 s",
    "ramps_2": "within 2 s",
    "ramps_5": "within 5 s",
    "light": "at once, 50 to 150 g",
    "slow_rate": "at once, 30 Hz with jitter",
    "standing": "at once, the arm stands",
    "real": "at once, the real Panda",
}  # rows of the page
PAGE = ROOT / "docs" / "online.md"
BINS = np.array([0.0, 0.02, 0.1, 0.3, 0.7, 0.9, 0.98, 1.0])


@dataclass(frozen=True)
class Scene:
    """One stream: its part, and its seed."""

    part: str
    seed: int


class Resting(Motion):
    """A motion q(s(t)) that comes to rest at each of `stops` [s] within a second, and goes on six seconds later."""

    name = "resting"

    def __init__(self, motion: Motion, stops: tuple[float, ...]) -> None:
        self.motion, self.stops = motion, stops

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.motion.n

    @property
    def duration(self) -> float:
        """Long enough [s]."""
        return 60.0

    def _clock(self, t: NDArray, order: int) -> NDArray:
        """s(t) and its derivatives: the pace falls from 1 to 0 and rises again along 1 − 3x² + 2x³."""
        out = t.copy() if order == 0 else np.full_like(t, float(order == 1))
        for stop in self.stops:
            for start, sign in ((stop, 1.0), (stop + 6.0, -1.0)):
                x = np.clip(t - start, 0.0, 1.0)
                within = (x > 0.0) & (x < 1.0)
                lost = (
                    np.where(t > start + 1.0, t - start - 0.5, x**3 - 0.5 * x**4),
                    3.0 * x**2 - 2.0 * x**3,
                    np.where(within, 6.0 * x - 6.0 * x * x, 0.0),
                    np.where(within, 6.0 - 12.0 * x, 0.0),
                )[order]
                out = out - sign * lost
        return out

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        q = [self.motion.derivative(self._clock(t, 0), k) for k in range(order + 1)]
        s = [self._clock(t, k)[:, None] for k in range(4)]
        if order < 2:
            return q[0] if order == 0 else q[1] * s[1]
        if order == 2:
            return q[2] * s[1] ** 2 + q[1] * s[2]
        return q[3] * s[1] ** 3 + 3.0 * q[2] * s[1] * s[2] + q[1] * s[3]


@dataclass(frozen=True)
class Stream:
    """A log, the mass that is held (N,), changes (start, seconds, kg), pushes."""

    log: Recording
    mass: NDArray[np.float64]
    changes: list[tuple[float, float, float]]
    pushes: list[Push]


def streamed(scene: Scene) -> Stream:
    """The samples of a scene, and what is true of them."""
    panda, rng, took = arm("panda"), np.random.default_rng([scene.seed, 7]), PARTS[scene.part]
    if scene.part == "real":
        full = read_recording(data() / "panda_unloaded_1khz.csv", panda)
        ddq = np.asarray(savgol_filter(full.dq, 101, 3, deriv=1, delta=1 / full.rate, axis=0))[::5]
        log = Recording(full.t[::5] - full.t[0], full.q[::5], full.dq[::5], full.tau[::5])
        times = [5.0 + rng.uniform(0.0, 2.0), 12.0 + rng.uniform(0.0, 2.0)]
    else:
        motion = taie2024() if scene.seed % 2 else random_motion(panda, scene.seed)
        if scene.part == "standing":
            motion = Resting(random_motion(panda, scene.seed), (8.0, 20.0))
        world, sensors = World.real_like(panda, scene.seed), Sensors.panda(panda)
        source = Simulator(
            panda, motion, [], world=world, sensors=sensors, rate=200.0, speed=None, duration=40.0, seed=scene.seed
        )
        log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
        even = np.arange(log.t[0], log.t[-1], 0.005)
        dq = np.array([np.interp(even, log.t, column) for column in log.dq.T])
        ddq = np.asarray(savgol_filter(dq, 21, 3, deriv=1, delta=0.005, axis=1))
        ddq = np.array([np.interp(log.t, even, row) for row in ddq]).T
        times = [10.0 + rng.uniform(0.0, 2.0), 22.0 + rng.uniform(0.0, 2.0)]
    t, tau, share, pushed = log.t, log.tau.copy(), np.zeros(len(log.t)), []
    phi = _payload(rng).parameters.phi
    changes: list[tuple[float, float, float]] = []
    if scene.part == "light":
        phi = phi * rng.uniform(0.05, 0.15) / phi[0]
    if scene.part == "pushes":
        x = 11.0
        while x < t[-1] - 6.0:
            length, force = rng.uniform(0.3, 3.0), rng.normal(size=3)
            pushed.append(Push(x, x + length, "panda_link8", force * rng.uniform(10.0, 60.0) / np.linalg.norm(force)))
            x += length + rng.uniform(4.0, 7.0)
        for push in pushed:
            part = (t >= push.start) & (t <= push.end)
            tau[part] += push.torque(t[part], log.q[part])
        if scene.seed % 2:
            share, changes = (t >= 5.0) * 1.0, [(5.0, 0.0, phi[0])]
    elif scene.part == "drift":
        tau += np.sin(2.0 * np.pi * t / 80.0)[:, None] * rng.choice([-0.5, 0.5], panda.n)
    elif scene.part != "quiet":
        up, down = (np.clip((t - at) / max(took, 1e-9), 0.0, 1.0) for at in times)
        share, changes = up - down, [(times[0], took, phi[0]), (times[1], took, -phi[0])]
    W = payload_regressor(panda.frame_motion(log.q), log.dq, ddq)
    log, mass = Recording(t, log.q, log.dq, tau + share[:, None] * (W @ phi)), share * phi[0]
    if scene.part == "slow_rate":
        step = 200.0 / 30.0
        at = np.arange(0.0, len(t) - 2.0, step)
        kept = np.unique(np.round(at + step * rng.uniform(-0.2, 0.2, len(at))).clip(0).astype(int))
        log, mass = Recording(t[kept], log.q[kept], log.dq[kept], log.tau[kept]), mass[kept]
    return Stream(log, mass, changes, pushed)


def measured(scene: Scene) -> dict[str, Any]:
    """One scene as a cell's numbers."""
    stream = streamed(scene)
    identifier, said, events = OnlineIdentifier(arm("panda")), [], {}
    for sample, mass in zip(stream.log, stream.mass, strict=True):
        one = identifier.update(*sample)
        if one.event is not None:
            events[one.event.t] = one.event.to_dict()
        inside = one.low[0] <= mass <= one.high[0]
        calibrated = one.interval == "calibrated"
        width = 0.5 * (one.high[0] - one.low[0])
        said.append((one.t, mass, one.phi[0], width, inside, calibrated, one.p_change, one.p_contact))
    identifier.close()
    table, found = np.array(said, dtype=float), list(events.values())
    t, seen = table[:, 0], table[0, 0] + 2.5
    left, changes = list(found), []
    for start, took, by in stream.changes:
        own = [e for e in left if start <= e["t"] < start + took + 1.0]
        left = [e for e in left if e not in own]
        after = [table[min(np.searchsorted(t, start + took + x), len(t) - 1)] for x in LOOKED]
        during = table[(t >= start) & (t <= start + took)]
        changes.append(
            {
                "by": by,
                "delay": own[0]["t"] - start if own else None,
                "events": [(e["kind"], e["mass"]) for e in own],
                "inside": [bool(x[4]) for x in after],
                "error": [float(abs(x[2] - x[1])) for x in after],
                "half_width": [float(x[3]) for x in after],
                "inside_during": float(during[:, 4].mean()) if len(during) else None,
            }
        )
    pushes = []
    for push in stream.pushes:
        own = [e for e in left if push.start <= e["t"] < push.end + 1.0]
        left = [e for e in left if e not in own]
        during = table[(t >= push.start) & (t <= push.end)]
        pushes.append(
            {
                "called": [e["kind"] for e in own],
                "calibrated": float(during[:, 5].mean()),
                "wrong": float((during[:, 4] == 0.0).mean()),
                "wrong_and_calibrated": float(((during[:, 4] == 0.0) & (during[:, 5] == 1.0)).mean()),
                "most_kg": float(np.abs(during[:, 2] - during[:, 1]).max()),
            }
        )
    every = table[np.searchsorted(t, np.arange(seen, t[-1], 0.1))]
    pushed, edge = np.zeros(len(every), dtype=bool), np.zeros(len(every), dtype=bool)
    for push in stream.pushes:  # as it begins and ends it is hardly felt
        rise = 0.2 * (push.end - push.start)
        pushed |= (every[:, 0] > push.start) & (every[:, 0] < push.end)
        edge |= (np.abs(every[:, 0] - push.start) < rise) | (np.abs(every[:, 0] - push.end) < rise + 0.2)
    changing = np.zeros(len(every), dtype=bool)
    for start, took, _ in stream.changes:  # until a run of the new payload has begun
        noticed = np.flatnonzero((every[:, 0] > start) & (every[:, 6] > 0.5))
        first = len(every) if not len(noticed) else noticed[0]
        over = np.flatnonzero((every[first:, 0] > start + took) & (every[first:, 6] < 0.5))
        changing[np.searchsorted(every[:, 0], start) : first + over[0] if len(over) else len(every)] = True
    return {
        "seconds": float(t[-1] - t[0]),
        "changes": changes,
        "pushes": pushes,
        "false": left,
        "inside": float(every[:, 4].mean()),
        "calibrated": float(every[:, 5].mean()),
        "reliability": {
            "p_change": _counted(every[:, 6], changing),
            "p_contact": _counted(every[~edge, 7], pushed[~edge]),
        },
    }


def _counted(p: NDArray, true: NDArray) -> list[tuple[int, float, int]]:
    """Of each bin of probabilities: how many moments, their sum, and how often it was so."""
    which = np.clip(np.searchsorted(BINS, p, side="right") - 1, 0, len(BINS) - 2)
    return [(int((x := which == k).sum()), float(p[x].sum()), int(true[x].sum())) for k in range(len(BINS) - 1)]


def of_part(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """The changes, pushes and false events of a part."""
    changes, pushes = ([x for cell in cells for x in cell[name]] for name in ("changes", "pushes"))
    false = [e for cell in cells for e in cell["false"]]
    out: dict[str, Any] = {
        "scenes": len(cells),
        "minutes": round(sum(cell["seconds"] for cell in cells) / 60.0, 2),
        "false": len(false),
        "inside": round(float(np.mean([cell["inside"] for cell in cells])), 3),
        "calibrated": round(float(np.mean([cell["calibrated"] for cell in cells])), 3),
    }
    if changes:
        delays = [x["delay"] for x in changes if x["delay"] is not None]
        out |= {
            "changes": len(changes),
            "missed": sum(x["delay"] is None for x in changes),
            "missed_kg": sorted(round(abs(x["by"]), 2) for x in changes if x["delay"] is None),
            "median_delay_s": round(float(np.median(delays)), 3) if delays else None,
            "inside_after": {f"{s:g} s": sum(x["inside"][k] for x in changes) for k, s in enumerate(LOOKED)},
            "median_error_g": {
                f"{s:g} s": round(1e3 * float(np.median([x["error"][k] for x in changes])), 1)
                for k, s in enumerate(LOOKED)
            },
            "median_half_width_g": {
                f"{s:g} s": round(1e3 * float(np.median([x["half_width"][k] for x in changes])), 1)
                for k, s in enumerate(LOOKED)
            },
            "events": [x["events"] for x in changes],
        }
    if pushes:
        out |= {
            "pushes": len(pushes),
            "called_a_change": sum(bool(x["called"]) for x in pushes),
            "calibrated_during": round(float(np.mean([x["calibrated"] for x in pushes])), 3),
            "wrong_and_calibrated": round(float(np.mean([x["wrong_and_calibrated"] for x in pushes])), 4),
            "most_kg": round(max(x["most_kg"] for x in pushes), 2),
        }
    return out


def reliability(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the moments called so: how often it was, of all parts together."""
    out = {}
    for name in ("p_change", "p_contact"):
        total = np.sum([cell["reliability"][name] for cell in cells], axis=0)
        out[name] = [
            {"called": round(p / n, 4), "was": round(so / n, 4), "moments": int(n)} for n, p, so in total.tolist() if n
        ]
    return out


def show(result: dict[str, Any], page: Path = PAGE) -> None:
    """Put a result between its marks on a page: the table of hand-overs, and what was seen beside them."""
    parts = result["parts"]
    rows = []
    for name, said in NAMES.items():
        part = parts[name]
        delay, error, width = part["median_delay_s"], part["median_error_g"], part["median_half_width_g"]
        rows.append(
            (
                said,
                str(part["changes"]),
                str(part["missed"]),
                str(part["false"]),
                "–" if delay is None else f"{delay:.2f} s",
                " · ".join(str(n) for n in part["inside_after"].values()) + f" of {part['changes']}",
                " · ".join(f"{error[t]:.0f} ± {width[t]:.0f}" for t in ("0.5 s", "2 s")),
            )
        )
    columns = (
        "hand-over",
        "changes",
        "missed",
        "other events",
        "delay: median",
        "mass inside its 95 % after " + " · ".join(f"{s:g}" for s in LOOKED) + " s",
        "median error ± half-width [g] after 0.5 · 2 s",
    )
    missed = [f"{kg:.2f}" for kg in sorted({kg for name in NAMES for kg in parts[name]["missed_kg"]})]
    lines = [markdown_table(columns, "lrrrrrr", rows), ""]
    if missed:
        lines.append(f"Masses of the missed changes: {', '.join(missed)} kg.")
    push, drift, quiet = parts["pushes"], parts["drift"], parts["quiet"]
    lines += [
        f"{push['pushes']} pushes at the flange: {push['called_a_change']} called a change, "
        f"{100 * push['calibrated_during']:.0f} % of the time called calibrated, "
        f"{100 * push['wrong_and_calibrated']:.1f} % wrong and called calibrated.",
        f"A drift of ±0.5 N·m within 40 s: {drift['false']} events in {drift['minutes']:.0f} minutes, "
        f"{100 * drift['inside']:.0f} % of the intervals hold, "
        f"{100 * drift['calibrated']:.0f} % are called calibrated.",
        f"Where nothing happens: {quiet['false']} events in {quiet['minutes']:.0f} minutes, "
        f"{100 * quiet['calibrated']:.0f} % called calibrated.",
        "",
        "How often a probability was right, over all these moments:",
        "",
        markdown_table(
            ("probability", "moments", "called, on average", "was so"),
            "lrrr",
            [
                (f"`{name}`", str(x["moments"]), f"{100 * x['called']:.1f} %", f"{100 * x['was']:.1f} %")
                for name, found in result["reliability"].items()
                for x in found
            ],
        ),
    ]
    write_table(page, "hand-overs", "\n".join(lines))


def main() -> None:
    asked = options(__doc__, quick=False, parts=",".join(PARTS), scenes=3, jobs=1, cells=ROOT / "out" / "hand_overs")
    code = source_key(*sorted(Path(armload.online.__path__[0]).glob("*.py")))
    path, every = RESULTS / "hand_overs.json", []
    result: dict[str, Any] = json.loads(path.read_text()) if path.is_file() and not asked.quick else {"parts": {}}
    with threadpool_limits(1):
        for part in asked.parts.split(","):
            drawn = [Scene(part, SEED + k) for k in range(1 if asked.quick else asked.scenes)]
            tasks = {f"{s.part}-{s.seed}": s for s in drawn}
            wanted = [Task.of_one(name, key_of(asdict(s), code), measured, s) for name, s in tasks.items()]
            cells = list(run_tasks(wanted, asked.cells, jobs=asked.jobs, say=say).values())
            result["parts"][part] = of_part(cells)
            every += cells
            say(f"{part}: {json.dumps(result['parts'][part])}")
    if set(asked.parts.split(",")) == set(PARTS):
        result["reliability"] = reliability(every)
    if asked.quick:
        print(json.dumps(result, indent=1))
    else:
        write("hand_overs", result)
        show(result)


if __name__ == "__main__":
    main()
