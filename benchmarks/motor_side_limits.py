"""What keeps an arm that measures motor current from a torque sensor's accuracy: mismatches removed one at a time.

    nice -n 15 python benchmarks/motor_side_limits.py [--worlds 20] [--arm ur10e] [--minutes 30]

The same designed pair (2 s, after 5 s of it empty) with the same payloads and seeds on simulated arms that differ from
their model as real ones do (`World.real_like`), with one part of that difference taken away; and the smallest 95 %
half-width that any estimator can reach in the mean of such arms, from the variances of that population (`scales_of`),
which knows neither gains nor that gears lose a share of the payload's torque, too. Then ways that a user has on the arm
as it is: a longer empty run, a longer loaded run, poses that are crossed slowly from both sides, so that friction
cancels, a profile of three logs, and a weight that is known (5 kg to 1 g) hung on once, which calibrates the torque
(`armload profile --mass`). Errors are mean magnitudes of mass, moments and inertias as in `designed_motions.py`, whose
motions these are. What is measured is kept in out/. Writes benchmarks/results/motor_side_limits.json and the tables in
docs/motion.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from designed_motions import OUT as DESIGNS
from designed_motions import POSES, RATED, allowed, followed_for, kept
from designed_worlds import in_three
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, two_digits, write, write_table

from armload.arms import Arm, arm
from armload.excitation import Criterion, design_motion
from armload.identification import choose
from armload.inertia import Z95, InertialParameters
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key
from armload.motion import EndlessMotion, Motion, random_motion
from armload.motion.point_to_point import PointToPoint
from armload.payloads import draw_payload
from armload.posterior import bound, learn_profile, with_known_weight
from armload.posterior.bound_worlds import scales_of
from armload.recording import Recording
from armload.simulation import Friction, Run, Sensors, World, simulate_many
from armload.simulation.resolution import COARSE

_RATE = 500.0  # [Hz] of the logs
_SEED = 320_000  # of payloads and sensors, apart from those of the other benchmarks
_WEIGHT, _WEIGHT_STD = 5.0, 1e-3  # [kg] that is hung on once
_PARTS = ("load", "friction", "residual", "links")  # that the bound knows
_DAYS, _DAY = 3, 20.0  # empty logs of a profile, [s] of each
_POPULATION = 40  # worlds whose variances the bound takes
_STEP, _SLOW = 0.12, 0.15  # [rad] each side of a pose, [rad/s] across it: beyond most widths of the friction


def _without_friction(world: World) -> World:
    old = world.friction
    bare = Friction(0.0 * old.level, old.width, load=old.load)
    return replace(world, friction=bare, stiction=None)


Change = Callable[[World, Sensors, Arm], tuple[World, Sensors]]
REMOVED: dict[str, Change] = {
    "nothing": lambda w, s, _: (w, s),
    "gain": lambda w, s, _: (replace(w, gain=None), s),
    "load": lambda w, s, _: (replace(w, friction=replace(w.friction, load=None)), s),
    "stiction": lambda w, s, _: (replace(w, stiction=None), s),
    "friction": lambda w, s, _: (_without_friction(w), s),
    "residual": lambda w, s, _: (replace(w, residual=None), s),
    "links": lambda w, s, r: (replace(w, links=World.nominal(r).links), s),
    "sensors": lambda w, _s, _r: (w, Sensors.ideal()),
    "gain, load": lambda w, s, _: (replace(w, gain=None, friction=replace(w.friction, load=None)), s),
    "gain, friction": lambda w, s, _: (replace(_without_friction(w), gain=None), s),
    "gain, load, friction": lambda w, s, r: (replace(w, gain=None, friction=Friction.none(r.n), stiction=None), s),
}
WORDS = {
    "nothing": "nothing: the arm as it is",
    "gain": "error of the torque's gain (up to 3 % a joint)",
    "load": "what gears lose of the load (2–12 %)",
    "stiction": "stiction at rest",
    "friction": "stiction, and friction beside that of the load",
    "residual": "smooth residual of pose",
    "links": "error of the links' model",
    "sensors": "noise of current, velocity, position",
    "gain, load": "gain and loss of the load",
    "gain, friction": "gain, and friction beside that of the load",
    "gain, load, friction": "gain, and all friction",
}
WAYS = {
    "as designed": "2 s, after 5 s of it empty",
    "longer empty": "the same after 20 s of it empty",
    "longer loaded": "6 s of it, after 20 s of it empty",
    "both sides": "six poses crossed slowly from both sides, empty and loaded",
    "weight": "2 s, after 5 s of it empty, gains from a known weight",
    "weight, longer": "6 s of it, after 20 s of it empty, gains from a known weight",
    "profile": "2 s, after 5 s of it empty, with a profile of three empty logs of 20 s",
    "profile, weight": "the same, and gains from a known weight",
    "weight, both sides": "six poses crossed from both sides, gains from a known weight",
}


def both_sides(robot: Arm) -> Motion:
    """Six poses about the arm's own, each crossed slowly there and back."""
    pose, n = np.array(POSES[robot.name]), robot.n
    rng = np.random.default_rng(11)
    stops, times, now = [pose], [(0.0, 0.0)], 0.0
    for sign in rng.choice([-1.0, 1.0], size=(6, n)):
        at = pose + np.where(np.arange(n) < n - 3, 0.15, 0.8) * rng.uniform(-1.0, 1.0, n)
        at[0] = pose[0]
        for side in (-1.0, 1.0, -1.0):
            goal = at + side * _STEP * sign
            lasts = max(
                0.6, 1.6 * float(np.abs(goal - stops[-1]).max()) / (1.0 if side < 0 and len(stops) % 3 == 1 else _SLOW)
            )
            times.append((now, now + lasts))
            stops.append(goal)
            now += lasts
    stops.append(pose)
    times.append((now, now + 1.5))
    starts, ends = np.array(times[1:]).T
    return PointToPoint(np.array(stops), starts, ends, name="both sides")


def motions(robot: Arm) -> dict[str, Any]:
    """The designed pair's motion, for ever, and the poses."""
    keep = allowed(robot)
    (same,) = kept(robot, "designed same", lambda: [design_motion(keep, Criterion(robot, "same"), 2.0).motion])
    return {"designed": EndlessMotion(same), "both sides": both_sides(robot)}


def runs_of(way: str, chosen: dict[str, Motion]) -> tuple[Motion, float, float]:
    """The motion of a way, how long it is run empty and with the payload [s]."""
    if "both sides" in way:
        motion = chosen["both sides"]
        return motion, motion.duration, motion.duration
    loaded = 6.0 if way in ("longer loaded", "weight, longer") else 2.0
    return chosen["designed"], 20.0 if "longer" in way else 5.0, loaded


def measure(names: Sequence[str], robot: Arm, chosen: dict[str, Motion], seed: int) -> Iterator[dict[str, Any]]:
    """Of the cells named, SEED:REMOVED:WAY each: the error and the half-width given (10,), and the payload (10,)."""
    held = draw_payload("boxes", _SEED + seed, RATED[robot.name]).parameters
    truth = InertialParameters(held.phi, robot.frame)
    hung = InertialParameters.from_com(_WEIGHT, (0.0, 0.0, 0.08), 0.002 * _WEIGHT * np.eye(3), robot.frame)
    for cell in names:
        _, removed, way = cell.split(":")
        world, sensors = REMOVED[removed](World.real_like(robot, seed), Sensors.of(robot), robot)
        motion, before, lasting = runs_of(way, chosen)

        def logged(
            payload: InertialParameters | None, seconds: float, noise: int, as_it_is: Any = (world, sensors, motion)
        ) -> Recording:
            w, s, m = as_it_is
            run = Run(m, payload, w, s, _SEED + 3 * seed + noise)
            return simulate_many(robot, [run], rate=_RATE, duration=seconds, workers=1, resolution=COARSE)[0]

        tare, profile = logged(None, before, 0), None
        if way.startswith("profile"):
            days = [(world, sensors, random_motion(robot, 40 + k, duration=_DAY, harmonics=10)) for k in range(_DAYS)]
            profile = learn_profile(robot, [logged(None, _DAY, 10 + k, day) for k, day in enumerate(days)])
        if "weight" in way:
            profile = learn_profile(robot, [tare]) if profile is None else profile
            profile = with_known_weight(profile, robot, logged(hung, before, 2), _WEIGHT, _WEIGHT_STD)
        found = choose(robot, tare, profile=profile).identifier.run(logged(truth, lasting, 1))
        yield {
            "removed": removed,
            "way": way,
            "seed": seed,
            "truth": truth.phi.tolist(),
            "error": np.round(found.phi - truth.phi, 7).tolist(),
            "half_width": np.round(Z95 * found.std, 7).tolist(),
        }


def population_bound(robot: Arm, removed: str, chosen: dict[str, Motion]) -> NDArray[np.float64]:
    """Half-widths (10,) of the bound of such arms after the designed pair."""
    pairs = [REMOVED[removed](World.real_like(robot, 500 + k), Sensors.of(robot), robot) for k in range(_POPULATION)]
    scales = scales_of(robot, [w for w, _ in pairs], pairs[0][1], _RATE)
    loaded, empty = (followed_for(robot, chosen["designed"].motion, seconds) for seconds in (2.0, 5.0))
    return bound(robot, loaded, tare=empty, scales=scales, times=[2.0]).half_width[-1]


def in_words(three: Any) -> str:
    """Mass [g], moments [g·m], inertias [10⁻³ kg·m²]."""
    return " · ".join(two_digits(1e3 * x) for x in three)


def summary(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """Mean errors and median half-widths of some cells, and the mass's error over the mass."""
    errors = np.array([c["error"] for c in cells])
    mass = np.array([c["truth"][0] for c in cells])
    return {
        "worlds": len(cells),
        "error": in_three(errors).mean(axis=0).tolist(),
        "half_width": np.median(in_three(np.array([c["half_width"] for c in cells])), axis=0).tolist(),
        "of_mass": float((np.abs(errors[:, 0]) / mass).mean()),
        "inside": float((np.abs(errors) <= np.array([c["half_width"] for c in cells])).mean()),
    }


def tables(removed: dict[str, dict[str, Any]], ways: dict[str, dict[str, Any]]) -> dict[str, str]:
    """By their marks on the page."""
    columns = ["", "error", "of the mass", "half-width given (median)", "truth inside"]
    out = {}
    for mark, first, words, rows in (
        ("motor side removed", "taken away", WORDS, removed),
        ("motor side ways", "way", WAYS, ways),
    ):
        cells = [
            [
                words[name],
                in_words(row["error"]),
                f"{100 * row['of_mass']:.1f} %",
                in_words(row["half_width"]),
                f"{100 * row['inside']:.0f} %",
            ]
            for name, row in rows.items()
        ]
        out[mark] = markdown_table([first, *columns[1:]], "lrrrr", cells)
    return out


def main() -> None:
    """Simulate, table."""
    asked = options(__doc__, worlds=20, arm="ur10e", minutes=30.0)
    robot = arm(asked.arm)
    chosen = motions(robot)
    code = source_key(*(ROOT / "src" / "armload" / room for room in ("simulation", "regression", "posterior")))
    pairs = [(removed, "as designed") for removed in REMOVED] + [("nothing", way) for way in list(WAYS)[1:]]
    tasks = []
    for seed in range(asked.worlds):
        keys = {
            f"{seed}:{removed}:{way}": key_of(code, robot.name, removed, way, seed, _path(*runs_of(way, chosen)))
            for removed, way in pairs
        }
        tasks.append(Task(f"{robot.name} {seed}", keys, measure, (robot, chosen, seed), "cell"))
    folder = DESIGNS.parent / "motor_side_limits"
    cells = list(run_tasks(tasks, folder, jobs=1, until=60 * asked.minutes, say=say).values())
    done = set.intersection(*({c["seed"] for c in cells if (c["removed"], c["way"]) == pair} for pair in pairs))
    cells = [c for c in cells if c["seed"] in done]
    removed = {r: summary([c for c in cells if (c["removed"], c["way"]) == (r, "as designed")]) for r in REMOVED}
    best = {r: in_three(population_bound(robot, r, chosen)).tolist() for r in ("nothing", *_PARTS)}
    ways = {way: summary([c for c in cells if (c["removed"], c["way"]) == ("nothing", way)]) for way in WAYS}
    for mark, text in tables(removed, ways).items():
        print(text)
        write_table(ROOT / "docs" / "motion.md", mark, text)
    result = {"arm": robot.name, "worlds": len(done), "removed": removed, "ways": ways, "bound": best}
    write("motor_side_limits", result, None)


def _path(motion: Motion, before: float, lasting: float) -> list[Any]:
    t = np.arange(0.0, max(before, lasting), 0.02)
    return [before, lasting, np.round(motion(t)[0], 6).tolist()]


if __name__ == "__main__":
    main()
