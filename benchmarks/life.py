"""An arm over fifteen days: what a profile is worth, with and without a few empty seconds today.

    python benchmarks/life.py [--arms 8] [--seed 11] [--parts 0.5,1,2,same-day]

Pandas that differ from their model as real ones do. On each of 15 days an empty log of 20 s is recorded, about poses of
the place where the arm works; offsets and friction of a day differ from the arm's own by (1 sigma) 0.08 0.12 0.06 0.10
0.03 0.04 0.01 N·m and 15 %, our assumption, and by half and twice that. Today's run of 6 s with a payload is answered
by the hybrid, after 1 and 6 s:

nothing             without any empty log
yesterday           a tare of 20 s of the last of the 15 days, said to be a day old
refresh             a tare of 5 s of today, near the run's poses
profile             of the 15 logs
profile, refresh    both
profile, no drift   of the same logs, taken for one session (ablation, at drift 1)
profile, 128        with as many features of the pose as a tare (ablation, at drift 1)

same-day: 15 logs of 20 s of one session, about the poses of the place where the arm works or about any, against a tare
of 20 s elsewhere; and a tare of 20 s along the run's own motion, after which hardly anything is left to learn of the
arm. Parts that are named (a size of the drift, same-day) replace their own among the results. Printed, and written to
benchmarks/results/life.json and tables of docs/profiles.md, after every part.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm
from armload.inertia import Z95, InertialParameters
from armload.lab.episodes import Episode, draw_episodes
from armload.lab.episodes.motion_kinds import MotionSource
from armload.posterior import HybridIdentifier, learn_profile, profile_learning
from armload.simulation import Run, World, simulate_many
from armload.simulation.resolution import COARSE

OFFSET = np.array([0.08, 0.12, 0.06, 0.10, 0.03, 0.04, 0.01])  # [N·m], 1 sigma of a day
FRICTION = 0.15
DRIFTS = ("0.5", "1", "2")
DAYS, TIMES = 15, (1.0, 6.0)
RATE = 200.0  # [Hz]
NEAR = 0.5  # [rad] standard deviation of each joint's mean about the run's: where an arm works


def on_a_day(world: World, size: float, rng: np.random.Generator) -> World:
    """The arm as it is on one day."""
    level = world.friction.level * np.maximum(1.0 + size * FRICTION * rng.normal(size=len(OFFSET)), 0.2)
    offset = world.offset + size * OFFSET * rng.normal(size=len(OFFSET))
    return replace(world, offset=offset, friction=replace(world.friction, level=level))


def empty_logs(e: Episode, worlds: list[World], motions: list[Any], seconds: float, seed: int) -> list[Recording]:
    """One log a world, without a payload."""
    runs = [
        Run(motion, None, world, e.sensors, seed + k, e.gains)
        for k, (world, motion) in enumerate(zip(worlds, motions, strict=True))
    ]
    return simulate_many(e.arm, runs, rate=RATE, duration=seconds, workers=1, resolution=COARSE)


def motions_about(e: Episode, place: str, k: int) -> list[Any]:
    """Fifteen motions of 20 s about the place where the arm works ("here"), or about any."""
    source, rng = MotionSource(e.arm, 0.0), np.random.default_rng([k, 41])
    around = source.centre(e.motion) if place == "here" else None
    return [source.draw("long", rng, 20.0, f"day-{day}", around, NEAR) for day in range(DAYS)]


def score(found: dict[str, list], row: str, e: Episode, run: Recording, truth: np.ndarray, **how: Any) -> None:
    """Answers after 1 and 6 s."""
    identifier = HybridIdentifier(e.arm, how.get("tare"), profile=how.get("profile"))
    identifier.allow_for(how.get("age", 0.0))
    for t in TIMES:
        estimate = identifier.run(run.between(run.t[0], run.t[0] + t))
        error = np.abs(estimate.phi - truth)
        changed = identifier.stream.drift is not None and identifier.stream.drift.changed
        found.setdefault(f"{row}|{t:g}", []).append((error, Z95 * estimate.std, changed))


def gathered(found: dict[str, list]) -> dict[str, Any]:
    """Means over the arms."""
    out = {}
    for key, values in found.items():
        error, half = np.array([x[0] for x in values]), np.array([x[1] for x in values])
        inside = error <= half
        out[key] = {
            "mass [g]": 1e3 * float(error[:, 0].mean()),
            "standard error [g]": 1e3 * float(error[:, 0].std() / np.sqrt(len(error))),
            "half-width [g]": 1e3 * float(half[:, 0].mean()),
            "first moments [g·m]": 1e3 * float(error[:, 1:4].mean()),
            "inertia [g·m²]": 1e3 * float(error[:, 4:].mean()),
            "inside": [float(inside[:, part].mean()) for part in (slice(0, 1), slice(1, 4), slice(4, 10))],
            "doubted": float(np.mean([x[2] for x in values])),
        }
    return out


def days(arms: int, seed: int, size: float) -> dict[str, Any]:
    """Fifteen days of one size of drift."""
    panda, found = arm("panda"), {}
    for k, e in enumerate(draw_episodes(panda, "reference", arms, seed, motions=arms)):
        rng = np.random.default_rng([seed, k, int(10 * size)])
        worlds = [on_a_day(e.world, size, rng) for _ in range(DAYS)]
        logs = empty_logs(e, worlds, motions_about(e, "here", k), 20.0, e.seed)
        today = on_a_day(e.world, size, rng)
        refresh = empty_logs(e, [today], [e.tare_motion], 5.0, e.seed + 77)[0]
        load = InertialParameters(e.payload.parameters.phi)
        runs = [Run(e.motion, load, today, e.sensors, e.seed, e.gains, 60.0)]
        run = simulate_many(panda, runs, rate=RATE, duration=6.0, workers=1, resolution=COARSE)[0]
        about = (e, run, e.truth.phi)
        profile = learn_profile(panda, logs)
        score(found, "nothing", *about)
        score(found, "yesterday", *about, tare=logs[-1], age=1.0)
        score(found, "refresh", *about, tare=refresh)
        score(found, "profile", *about, profile=profile)
        score(found, "profile, refresh", *about, profile=profile, tare=refresh)
        if size == 1.0:
            score(found, "profile, no drift", *about, profile=learn_profile(panda, logs, sessions=[0] * DAYS))
            score(found, "profile, 128", *about, profile=narrow(panda, logs))
        say(f"drift {size:g}, arm {k + 1} of {arms}: {profile.features.pose} features, noise {profile.repeated:g}")
    return gathered(found)


def narrow(panda: Any, logs: list[Recording]) -> Any:
    """A profile with as many features as a tare."""
    sizes = profile_learning.CAPACITIES
    profile_learning.CAPACITIES = sizes[:1]
    try:
        return learn_profile(panda, logs)
    finally:
        profile_learning.CAPACITIES = sizes


def same_day(arms: int, seed: int) -> dict[str, Any]:
    """300 s of one session against 20 s elsewhere."""
    panda, found = arm("panda"), {}
    for k, e in enumerate(draw_episodes(panda, "elsewhere", arms, seed + 1, motions=arms)):
        load = InertialParameters(e.payload.parameters.phi)
        run = simulate_many(
            panda,
            [Run(e.motion, load, e.world, e.sensors, e.seed, e.gains, 60.0)],
            rate=RATE,
            duration=6.0,
            workers=1,
            resolution=COARSE,
        )[0]
        about = (e, run, e.truth.phi)
        tare = empty_logs(e, [e.world], [e.tare_motion], 20.0, e.seed + 5)[0]
        score(found, "20 s elsewhere", *about, tare=tare)
        same = empty_logs(e, [e.world], [e.motion], 20.0, e.seed + 7)[0]
        score(found, "20 s along the run's motion", *about, tare=same)
        for place in ("here", "anywhere"):
            logs = empty_logs(e, [e.world] * DAYS, motions_about(e, place, k), 20.0, e.seed + 9)
            profile = learn_profile(panda, logs, sessions=[0] * DAYS)
            score(found, f"300 s {place}", *about, profile=profile)
        say(f"same day, arm {k + 1} of {arms}")
    return gathered(found)


def table(found: dict[str, Any]) -> str:
    """Rows by what there was, after 1 and 6 s."""
    names = list(dict.fromkeys(key.split("|")[0] for key in found))
    rows = []
    for name in names:
        cells = [found[f"{name}|{t:g}"] for t in TIMES]
        rows.append(
            [
                name,
                *(f"{c['mass [g]']:.1f} ± {c['half-width [g]']:.0f}" for c in cells),
                *(f"{c['first moments [g·m]']:.2f}" for c in cells),
                *(f"{c['inertia [g·m²]']:.2f}" for c in cells),
                *(" · ".join(f"{100 * x:.0f}" for x in c["inside"]) for c in cells),
            ]
        )
    heads = ["mass [g] 1 s", "6 s", "moments [g·m] 1 s", "6 s", "inertia [g·m²] 1 s", "6 s", "inside [%] 1 s", "6 s"]
    return markdown_table(["known of the arm", *heads], "l" + 8 * "r", rows)


def main() -> None:
    asked = options(__doc__, arms=8, seed=11, parts=",".join((*DRIFTS, "same-day")))
    file, page = RESULTS / "life.json", ROOT / "docs" / "profiles.md"
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    kept = {part: kept.get(part, {}) for part in ("arms", "days", "same day")}
    for part in asked.parts.split(","):
        if part == "same-day":
            kept["same day"] = made = same_day(asked.arms, asked.seed)
        else:
            kept["days"][part] = made = days(asked.arms, asked.seed, float(part))
        kept["arms"][part] = asked.arms
        say(table(made))
        if asked.arms > 3:
            write("life", {"seed": asked.seed, **kept})
            write_table(page, "same day" if part == "same-day" else f"drift {part}", table(made))


if __name__ == "__main__":
    main()
