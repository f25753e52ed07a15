"""What half and twice each tuned constant would do to streams with changes of payload, and to sound and wrong logs.

    python benchmarks/sensitivity.py [--only SURE,HOLDS] [--parts streams,logs,tares] [--far] [--page]

The constants are those of `online/thresholds.py` that decide about changes, of `identification/thresholds.py`, four of
the posterior, and those of a tare's age. Each is set to half and to double, all others as they are; of a probability,
that of the
contrary. What changes nothing either way is set to a thousandth and to a thousand times, too: a constant that changes
nothing even then decides nothing in these scenes.

streams    10 scenes of 7–12 s at 250 and 500 Hz with the hybrid: payloads grasped, released, swapped, taken up again,
           two of 0.2 kg, pushes at the flange, an arm that nothing happens to, a UR10e with motor torque. Real-like
           arms (`World.real_like`). What is called a change, late or false says watching.py.
logs       16 sound logs of 4 s, and 8 that something is wrong with: a base tilted by 30°, the torque sign of a joint
           turned, a tool taken off since the tare, motor torque of an arm that nobody knows. All go through `identify`.
tares      12 logs of 4 s with a tare of the same arm 0 to 30 days before, the age said or not, or of another arm.
           Offsets and friction walk by `Correction.daily_std` a day.

"nothing" means that all answers are the same bit for bit, notes included. Written to docs/constants.md and
benchmarks/results/sensitivity.json, where a part that was not asked for keeps what was measured of it before; --far
measures the thousandth and the thousand times alone, of what the committed result has as changing nothing; --page
writes the page alone, from the committed result. `cpu_s` says what a run of which parts took.
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from bodies import body_of
from event_scenes import Push
from threadpoolctl import threadpool_limits
from watching import matched, step, watched

import armload
from armload import Recording, __version__, arm
from armload.arms import rated_effort
from armload.devices import Simulator
from armload.errors import ArmloadError
from armload.identification import identify
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.regression import Correction
from armload.simulation import Sensors, World, simulate

HERE = Path(__file__).resolve().parent
RESULT, PAGE = HERE / "results" / "sensitivity.json", HERE.parent / "docs" / "constants.md"
MARKS = "<!-- table: benchmarks/sensitivity.py -->", "<!-- end -->"
SEED = 70_000
GROUPS = {  # home → constants, None: all; what they are tried on
    "online.thresholds": (r"(?s)# -+ the hypotheses.*(?=# -+ notes)", ("streams",)),
    "identification.thresholds": (r"(?s).*", ("logs",)),
    "posterior.problem": (r"(?m)(^#.*\n)*^(_MOTOR_SIDE|GAIN_STD) = .*\n", ("streams", "logs")),
    "posterior.joint_gains": (r"(?m)(^#.*\n)*^LOAD_LOSS = .*\n", ("streams", "logs")),
    "posterior.calibration": (r"(?m)(^#.*\n)*^KAPPA_UNKNOWN = .*\n", ("logs",)),
    "posterior.hybrid": (r"(?m)(^#.*\n)*^_REMOVED = .*\n", ("streams", "logs")),
    "regression.prior": (r"(?m)(^#.*\n)*^BODY_\w+ = .*\n", ("streams", "logs")),
    "regression.mismatch": (r"(?m)(^#.*\n)*^(DAILY|LINK_LOSS) = .*\n", ("logs", "tares")),
    "recording.steadied": (r"(?m)(^#.*\n)*^AROUND = .*\n", ("logs",)),
    "posterior.drift": (r"(?m)(^#.*\n)*^(TESTED|ALLOWED|CHANGED|SESSION) = .*\n", ("tares",)),
}
PARTS = ("streams", "logs", "tares")
PROBABILITIES = ("SURE", "LIKELY", "STICKS")
NEAR = {"half": 0.5, "double": 2.0}
FAR = {"thousandth": 1e-3, "thousand times": 1e3}
# a word about a change that was noticed; words of advice and of a refusal; a bound on what does
# not exist where it holds
NOT_VARIED = (
    "STEP_STD",
    "NOMINAL",
    "KNOWN",
    "CURRENT_LOW",
    "CURRENT_HIGH",
    "FARTHEST",
    "SWAPPED_MISFIT",
    "SWAPPED_SHARE",
)


# ---------------------------------------------------------------------- the constants, and how to set them


@dataclass(frozen=True)
class Constant:
    """A constant of a module, its unit and its reason as the comment above it says."""

    home: str
    name: str
    unit: str
    reason: str
    on: tuple[str, ...]

    @property
    def value(self) -> Any:
        return getattr(importlib.import_module(f"armload.{self.home}"), self.name)

    def times(self, factor: float) -> Any:
        """Its value times a factor; of a probability, one less a multiple of what is left to one."""
        if self.name in PROBABILITIES:
            return 1.0 - min((1.0 - self.value) / factor, 0.999)
        return _times(self.value, factor)


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, dict):
        return {key: _times(x, factor) for key, x in value.items()}
    if isinstance(value, tuple):
        return tuple(_times(x, factor) for x in value)
    if isinstance(value, int):
        return max(int(value * factor), 1)
    return value * factor


def constants() -> list[Constant]:
    """All of them, in the order of the source; the comment above each is its unit and reason."""
    out = []
    for home, (part, on) in GROUPS.items():
        text = (Path(armload.__path__[0]) / f"{home.replace('.', '/')}.py").read_text(encoding="utf-8")
        for found in re.finditer(part, text):
            for block in re.finditer(r"((?:^#.*\n)+)^(\w+) = ", found[0], re.MULTILINE):
                said = " ".join(line.lstrip("# ") for line in block[1].splitlines())
                unit, reason = re.fullmatch(r"(?:\[(.*?)\] )?(.*)", said).groups()  # type: ignore[union-attr]
                if block[2] not in NOT_VARIED:
                    out.append(Constant(home, block[2], unit or "–", reason, on))
    return out


@contextmanager
def set_to(constant: Constant, value: Any) -> Iterator[None]:
    """Every module that took the constant from its home has another value of it for a while."""
    before = constant.value
    places = [
        module
        for key, module in list(sys.modules.items())
        if key.startswith("armload.") and vars(module).get(constant.name) is before
    ]
    for module in places:
        setattr(module, constant.name, value)
    try:
        yield
    finally:
        for module in places:
            setattr(module, constant.name, before)


# ---------------------------------------------------------------------- streams


@dataclass(frozen=True)
class Stream:
    """The samples of a scene, what was held from when, the pushes, and a tare if there is one."""

    name: str
    robot: str
    log: Recording
    held: list[tuple[float, Any]]
    pushes: list[Push]
    tare: Recording | None


def streams() -> list[Stream]:
    """All scenes; each is another arm."""
    light, box, other = (body_of(m, k) for k, m in enumerate((0.2, 1.2, 0.7)))
    flange = [Push(4.5, 5.5, "panda_link8", np.array([25.0, -20.0, 15.0]))]
    long = [Push(4.0, 7.0, "panda_link8", np.array([-10.0, 30.0, 40.0]))]
    return [
        scene("release", 250, 8, [(-1, box), (4, None)]),
        scene("swap", 250, 9, [(-1, None), (3.5, box), (6.5, other)]),
        scene("grasp, release, the same again", 250, 12, [(-1, None), (3, box), (6, None), (9, box)], tared=True),
        scene("grasp and release in a hurry", 250, 8, [(-1, None), (3.5, other), (5, None), (6, box)]),
        scene("light", 250, 7, [(-1, None), (4, light)], tared=True),
        scene("light, no tare", 500, 8, [(-1, None), (6, light)]),
        scene("nothing happens", 250, 8, [(-1, None)]),
        scene("push, loaded", 250, 8, [(-1, None), (2.5, other)], flange),
        scene("long push, after a tare", 250, 9, [(-1, None)], long, tared=True),
        scene("UR10e", 250, 8, [(-1, None), (4.5, body_of(4.0, 3))], robot="ur10e"),
    ]


def scene(
    name: str,
    rate: float,
    seconds: float,
    held: list[tuple[float, Any]],
    pushes: list[Push] = [],  # noqa: B006 - never changed
    tared: bool = False,
    robot: str = "panda",
) -> Stream:
    """Simulate one."""
    seed = SEED + int(np.frombuffer(name.encode(), np.uint8).sum())
    known = arm(robot)
    how = {"world": World.real_like(known, seed), "sensors": _sensors(known), "rate": float(rate)}
    motion = random_motion(known, seed)
    source = Simulator(known, motion, held, speed=None, duration=float(seconds), seed=seed, **how)
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    tau = log.tau.copy()
    for push in pushes:
        part = (log.t >= push.start) & (log.t <= push.end)
        tau[part] += push.torque(log.t[part], log.q[part])
    tare = simulate(known, random_motion(known, seed + 1, duration=10.0, harmonics=8), None, seed=seed, **how)
    return Stream(name, robot, Recording(log.t, log.q, log.dq, tau), held, pushes, tare if tared else None)


def _sensors(known: Any) -> Sensors:
    """As measured on a Panda, or of any arm."""
    return Sensors.panda(known) if known.n == 7 else Sensors.generic(known)


def on_streams(scenes: list[Stream]) -> tuple[dict[str, Any], list[bytes]]:
    """What is measured over all scenes, and each scene's answers."""
    steps, alarms, called, kept, answers = [], 0, 0, 0, []
    for stream in scenes:
        found = watched(OnlineIdentifier(arm(stream.robot), stream.tare), stream.log)
        own, rest = matched([step(k, stream.held, found) for k in range(1, len(stream.held))], found.events)
        steps += own
        for push in stream.pushes:
            events = [e for e in rest if push.start <= e["t"] <= push.end + 3.0]
            rest = [e for e in rest if e not in events]
            called += bool(events)
            kept += bool(events) and events[-1]["kind"] != "return"
        alarms += len(rest)
        answers.append(json.dumps(found.events).encode() + found.said.tobytes())
    delays = np.array([np.inf if s["delay"] is None else s["delay"] for s in steps])
    error, half = (np.array([s[key][1] for s in steps]) for key in ("error", "half_width"))
    back = [s["said"] == s["kind"] or (s["back"] and s["said"] == "return") for s in steps]
    return {
        "missed": int(np.sum(delays > 1.0)),
        "false": alarms,
        "delay": round(float(np.median(delays)), 3),
        "wrong kind": int(len(steps) - np.sum(back)),
        "error": round(1e3 * float(np.mean(np.abs(error))), 1),
        "half-width": round(1e3 * float(np.mean(half)), 1),
        "outside": int(np.sum(np.abs(error) > half)),
        "pushes called": called,
        "pushes kept": kept,
    }, answers


# ---------------------------------------------------------------------- logs


@dataclass(frozen=True)
class Log:
    """A log for `identify`, what it is told, and the truth; wrong: what an answer should not be sure of."""

    robot: Any
    log: Recording
    told: dict[str, Any]
    truth: np.ndarray
    wrong: bool


def logs(folder: Path) -> list[Log]:
    """All logs; each is another arm."""
    stranger = arm(_strange("panda", folder), "panda_link8"), arm(_strange("ur5e", folder), "tool0")
    out = [logged("panda", k, mass) for k, mass in enumerate((0.0, 0.2, 0.7, 1.5, 6.0))]
    out += [logged("panda", 5 + k, mass, tared=True) for k, mass in enumerate((0.0, 0.2, 0.7, 2.5))]
    out += [logged("ur10e", 9 + k, mass, tared=k > 1) for k, mass in enumerate((0.0, 4.0, 3.0))]
    out += [logged(stranger[0], 12 + k, mass) for k, mass in enumerate((0.5, 2.0))]
    out += [logged("panda", 14 + k, 0.7, tared=True, tool=0.5, mounted=bool(k)) for k in range(2)]
    for k, robot in enumerate(("panda", "ur10e")):
        tilted = (0.0, 9.81 * np.sin(np.pi / 6.0), -9.81 * np.cos(np.pi / 6.0))
        one = logged(robot, 16 + k, 1.0)
        out.append(replace(one, robot=arm(robot, gravity=tilted), wrong=True))
    for k, joint in enumerate((1, 4)):
        one = logged("panda", 18 + k, 1.0)
        sign = np.where(np.arange(one.log.n) == joint, -1.0, 1.0)
        turned = Recording(one.log.t, one.log.q, one.log.dq, one.log.tau * sign)
        out.append(replace(one, log=turned, wrong=True))
    for k, mass in enumerate((0.3, 0.8)):
        one = logged("panda", 20 + k, 0.0, tared=True, left=mass)
        out.append(replace(one, wrong=True))
    for k, mass in enumerate((1.0, 3.0)):
        out.append(replace(logged(stranger[1], 22 + k, mass, motor=True), wrong=True))
    return out


def _strange(name: str, folder: Path) -> Path:
    """The file of an arm that nobody knows: another's, all links 1 % heavier."""
    text = re.sub(r'mass value="([\d.e+-]+)"', lambda m: f'mass value="{1.01 * float(m[1])}"', arm(name).urdf)
    path = folder / f"like_{name}.urdf"
    path.write_text(text)
    return path


def logged(
    robot: Any,
    k: int,
    mass: float,
    tared: bool = False,
    tool: float = 0.0,
    mounted: bool = False,
    left: float = 0.0,
    motor: bool = False,
) -> Log:
    """Simulate one; tool: known, in the tare too if `mounted`; left: mass [kg] of what only the tare holds."""
    known, seed = arm(robot) if isinstance(robot, str) else robot, SEED + 500 + k
    world = World.real_like(replace(known, motor_torque=True) if motor else known, seed)
    how = {"world": world, "sensors": _sensors(known), "rate": 250.0}
    carried, held = np.zeros(10) if mass == 0.0 else body_of(mass, k).parameters.phi, InertialParameters(np.zeros(10))
    told: dict[str, Any] = {}
    if tool:
        told["tool"] = body_of(tool, 7).parameters
    with_tool = carried + (told["tool"].phi if tool else 0.0)
    before = body_of(left, k).parameters if left else told["tool"] if mounted else held
    if tared:
        other = random_motion(known, seed + 100, duration=6.0, harmonics=6)
        told["tare"] = simulate(known, other, before if before.mass else None, seed=seed + 100, **how)
    now = InertialParameters(with_tool) if np.any(with_tool) else None
    log = simulate(known, random_motion(known, seed, duration=4.0), now, seed=seed, **how)
    return Log(known, log, told, carried - (before.phi if left else 0.0), False)


def on_logs(all_logs: list[Log]) -> tuple[dict[str, Any], list[bytes]]:
    """What is measured over all logs, and each log's answer."""
    answers, found = [], []
    for one in all_logs:
        try:
            answer: Any = identify(one.log, one.robot, **one.told)
            answers.append(json.dumps(answer.to_dict() | {"date": ""}).encode())
        except ArmloadError as error:
            answer = None
            answers.append(str(error).encode())
        found.append((one, answer))
    sound = [(one, a) for one, a in found if not one.wrong and a is not None]
    wrong = [(one, a) for one, a in found if one.wrong]
    doubts = ("no body fits", "as far off", "taken off", "mass is negative")
    told = {id(a): any(word in note for note in a.notes for word in doubts) for _, a in found if a is not None}
    inside = [(a.phi_low <= one.truth) & (one.truth <= a.phi_high) for one, a in sound]
    return {
        "refused": sum(not one.wrong and a is None for one, a in found),
        "doubted": sum(told[id(a)] for _, a in sound),
        "error": round(1e3 * float(np.median([abs(a.mass - one.truth[0]) for one, a in sound])), 1),
        "half-width": round(1e3 * float(np.median([(a.phi_high[0] - a.phi_low[0]) / 2.0 for _, a in sound])), 1),
        "inside": round(100.0 * float(np.mean(inside)), 1),
        "calibrated": sum(a.interval == "calibrated" for _, a in sound),
        "leaning": sum(any("rest on" in note for note in a.notes) for _, a in sound),
        "wrong ones told": sum(a is None or told[id(a)] for _, a in wrong),
        "wrong ones inside": sum(
            bool(a is not None and a.phi_low[0] <= one.truth[0] <= a.phi_high[0]) for one, a in wrong
        ),
    }, answers


# ---------------------------------------------------------------------- tares


@dataclass(frozen=True)
class Aged:
    """A log for `identify` with its tare, the true mass, and whether the arm is another one than at the tare."""

    log: Log
    changed: bool


def tares() -> list[Aged]:
    """All of them; each is another arm. Days between tare and log, and the age that is said [s]."""
    day, minute = 86400.0, 60.0
    cases = [(0.0, None), (0.0, None), (0.0, 45.0 * minute), (0.0, 90.0 * minute), (1.0, None), (1.0, day)]
    cases += [(5.0, None), (5.0, 5.0 * day), (30.0, None), (30.0, 30.0 * day), (30.0, 90.0 * minute)]
    out = [aged(k, days, said) for k, (days, said) in enumerate(cases)]
    return [*out, aged(len(cases), 0.0, None, other=True)]


def aged(k: int, days: float, said: float | None, other: bool = False) -> Aged:
    """Simulate one: offsets and friction at the tare were what they are less a random walk of so many days."""
    known, seed = arm(("panda", "iiwa14")[k % 2]), SEED + 900 + k
    world, rng, n = World.real_like(known, seed), np.random.default_rng(seed), known.n
    walk = np.sqrt(days) * rng.normal(size=2 * n) * Correction(known, rated_effort(known)).daily_std[: 2 * n]
    level = np.maximum(world.friction.level + walk[n:], 0.3 * world.friction.level)
    then = replace(world, offset=world.offset + walk[:n], friction=replace(world.friction, level=level))
    if other:
        then = World.real_like(known, seed + 50)
    how, held = {"sensors": _sensors(known), "rate": 250.0}, body_of(1.0, k).parameters
    path = random_motion(known, seed + 100, duration=6.0, harmonics=6)
    tare = simulate(known, path, None, seed=seed + 100, world=then, **how)
    log = simulate(known, random_motion(known, seed, duration=4.0), held, seed=seed, world=world, **how)
    told = {"tare": tare} | ({} if said is None else {"tare_age": said})
    return Aged(Log(known, log, told, held.phi, False), other or days > 0.0)


def on_tares(all_tares: list[Aged]) -> tuple[dict[str, Any], list[bytes]]:
    """What is measured over all tares, and each log's answer."""
    found = [(one, identify(one.log.log, one.log.robot, **one.log.told)) for one in all_tares]
    doubted = {id(a): any("not as it was at its tare" in note for note in a.notes) for _, a in found}
    inside = [(a.phi_low <= one.log.truth) & (one.log.truth <= a.phi_high) for one, a in found]
    return {
        "changed ones doubted": sum(doubted[id(a)] for one, a in found if one.changed),
        "same ones doubted": sum(doubted[id(a)] for one, a in found if not one.changed),
        "error": round(1e3 * float(np.mean([abs(a.mass - one.log.truth[0]) for one, a in found])), 1),
        "half-width": round(1e3 * float(np.mean([(a.phi_high[0] - a.phi_low[0]) / 2.0 for _, a in found])), 1),
        "inside": round(100.0 * float(np.mean(inside)), 1),
    }, [json.dumps(a.to_dict() | {"date": ""}).encode() for _, a in found]


# ---------------------------------------------------------------------- the page


def table(result: dict[str, Any]) -> str:
    """The table, and what it is a difference to."""
    base = result["as they are"]
    far = any("thousandth" in tried for tried in result["constants"].values())
    took = ", ".join(f"{what} {seconds:.0f} s" for what, seconds in result["cpu_s"].items())
    lines = [
        "As they are (a constant that was measured alone stands beside the measures of its own run): "
        + "; ".join(f"{on}: " + ", ".join(f"{k} {v:g}" for k, v in base[on].items()) for on in PARTS)
        + f". Processor time of the runs: {took}.",
        "",
        *(["Where a row goes on after nothing, the constant was set to 1/1000 and to 1000 times as well.", ""] * far),
        "| constant | value | unit | reason | half | double |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for constant in constants():
        tried = result["constants"][constant.name]
        own = base | tried.get("as they are", {})  # a row may be of a later run than the rest
        cells = [_cell(tried[factor], own) for factor in NEAR]
        if "thousandth" in tried:
            cells = [
                f"nothing; {word}: {_cell(tried[far], own)}" for word, far in zip(("1/1000", "1000"), FAR, strict=True)
            ]
        value = json.dumps(tried["value"], ensure_ascii=False).strip("{}[]").replace('"', "")
        name = f"`{constant.home}` `{constant.name}`"
        lines.append(f"| {' | '.join([name, value, constant.unit, constant.reason, *cells])} |")
    return "\n".join(lines)


def _cell(tried: dict[str, Any], base: dict[str, Any]) -> str:
    """What one setting changes: the measures that are others, or how many answers are."""
    out = []
    for on, found in tried.items():
        if found["changed"]:
            other = [f"{k} {base[on][k]:g} → {v:g}" for k, v in found["measures"].items() if v != base[on][k]]
            out.append(", ".join(other) or f"{found['changed']} {on} differ, no measure does")
    return "; ".join(out) or "nothing"


def write_page(result: dict[str, Any]) -> None:
    """docs/constants.md, between its marks."""
    text = PAGE.read_text(encoding="utf-8")
    before, after = text.split(MARKS[0])[0], text.split(MARKS[1])[1]
    PAGE.write_text(f"{before}{MARKS[0]}\n\n{table(result)}\n\n{MARKS[1]}{after}", encoding="utf-8")


# ---------------------------------------------------------------------- the run


def plain(value: Any) -> Any:
    """A constant's value as JSON."""
    if isinstance(value, dict):
        return {key: plain(x) for key, x in value.items()}
    if isinstance(value, tuple | np.ndarray):
        return [plain(x) for x in value]
    return value if isinstance(value, int) else round(float(value), 6)


def measured(
    only: list[str], parts: list[str], factors: dict[str, float], known: dict[str, Any] | None = None
) -> dict[str, Any]:
    """These settings of the constants, and the far ones of what neither half nor double changes.

    known: the measures as they are that the result is to stand beside; it ends where they are others now.
    """
    started = time.process_time()
    material: dict[str, Any] = {}
    if "streams" in parts:
        material["streams"] = on_streams, streams()
    if "logs" in parts:
        with tempfile.TemporaryDirectory() as folder:
            material["logs"] = on_logs, logs(Path(folder))
    if "tares" in parts:
        material["tares"] = on_tares, tares()
    base = {on: of(what) for on, (of, what) in material.items()}
    as_they_are = {on: found[0] for on, found in base.items()}
    print(as_they_are, round(time.process_time() - started, 1), flush=True)
    if known is not None and any(known[on] != found for on, found in as_they_are.items()):
        raise SystemExit("the committed result is of other code: measure these parts without --far")

    def tried(constant: Constant, factor: float) -> dict[str, Any]:
        out = {}
        with set_to(constant, constant.times(factor)):
            for on in (on for on in constant.on if on in parts):
                of, what = material[on]
                measures, answers = of(what)
                changed = sum(a != b for a, b in zip(answers, base[on][1], strict=True))
                out[on] = {"changed": changed, "measures": measures}
        return out

    out: dict[str, Any] = {}
    for constant in constants():
        if (only and constant.name not in only) or not set(constant.on) & set(parts):
            continue
        own = {on: found for on, found in as_they_are.items() if on in constant.on}
        row = out[constant.name] = {"home": constant.home, "value": plain(constant.value), "as they are": own}
        left = list(factors.items())
        while left:
            word, factor = left.pop(0)
            row[word] = tried(constant, factor)
            shown = _cell(row[word], as_they_are)
            print(constant.name, word, shown, round(time.process_time() - started, 1), flush=True)
            if word == "double" and idle(row):
                left += FAR.items()
    what = " and ".join(parts) + (", far" if factors is FAR else "")
    return {
        "command": "python benchmarks/sensitivity.py",
        "version": __version__,
        "seeds_from": SEED,
        "cpu_s": {what: round(time.process_time() - started, 1)},
        "as they are": as_they_are,
        "constants": out,
    }


def idle(row: dict[str, Any]) -> bool:
    """Whether neither half nor double of a constant changes an answer."""
    return not any(found["changed"] for word in NEAR for found in row[word].values())


def with_what_was_measured_before(result: dict[str, Any], before: dict[str, Any], alone: bool) -> dict[str, Any]:
    """Parts and constants that were not asked for, as they were, each beside what was measured as all stood then.

    alone: some constants were asked for, not whole parts.
    """
    merged = {}
    for constant in constants():
        now, then = (one["constants"].get(constant.name, {}) for one in (result, before))
        row = merged[constant.name] = {"home": constant.home, "value": plain(constant.value)}
        base = {"as they are": before["as they are"]} | then
        row["as they are"] = {
            on: (now if on in now.get("as they are", {}) else base)["as they are"][on] for on in constant.on
        }
        for word in (*NEAR, *FAR):
            both = then.get(word, {}) | now.get(word, {})
            if word in NEAR or (idle(row) and both.keys() >= set(constant.on)):
                row[word] = {on: both[on] for on in constant.on}
    new, old = result["as they are"], before["as they are"]
    kept = {"cpu_s": before["cpu_s"] | result["cpu_s"], "as they are": new | old if alone else old | new}
    return result | kept | {"constants": merged}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="some constants; the others keep what was measured of them")
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--far", action="store_true", help="a thousandth and a thousand times alone")
    parser.add_argument("--page", action="store_true", help="write the page from the committed result")
    asked = parser.parse_args()
    before = json.loads(RESULT.read_text()) if RESULT.exists() else None
    if not asked.page:
        only = [name for name in asked.only.split(",") if name]
        if asked.far and not only:
            only = [name for name, row in before["constants"].items() if idle(row)]
        with threadpool_limits(1):
            known = before["as they are"] if asked.far else None
            result = measured(only, asked.parts.split(","), FAR if asked.far else NEAR, known)
        if asked.only or asked.far or asked.parts != parser.get_default("parts"):
            result = with_what_was_measured_before(result, before, bool(only))
        RESULT.write_text(json.dumps(result, indent=1) + "\n")
    write_page(json.loads(RESULT.read_text()))


if __name__ == "__main__":
    main()
