"""A payload that changes within a log: how surely `identify` finds it, and how often it is wrong.

    python benchmarks/changed_logs.py [--logs 24] [--seed 0] [--cases "0.1 kg;0.2 kg"]

sound     logs of the benchmark's populations, with their tares, of which nothing changes: share in which a change is
          found, and share called approximate as one may be there
changes   a payload of 0.1, 0.2, 0.5 and 1.5 kg taken up or put down somewhere in the middle of 6 s, at once: share
          found, share that is found or doubted, and how far off the time is [s, median]; two changes: taken up after
          2 s and put down after 4 s. With a tare of 20 s near the log's poses, and without

Pandas that differ from their model as real ones do; and UR5e and UR10e, a tenth and a third of what each is rated for.
Cases that are named replace their own among the results. Written to benchmarks/results/changed_logs.json and a table of
docs/hybrid_measured.md, after every case; half an hour of one core.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from bodies import body_of
from event_scenes import Resting
from script import ROOT, cases_of, markdown_table, options, say, write, write_table

from armload import Arm, Recording, arm, identify
from armload.devices import Simulator
from armload.identification.notes import MAY_CHANGE
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.lab.episodes.motion_kinds import MotionSource
from armload.motion import Motion, random_motion, taie2024
from armload.simulation import Sensors, World, simulate

SOUND = (
    *(("panda", population) for population in ("reference", "everyday", "beyond")),
    *((robot, population) for robot in ("ur5e", "ur10e") for population in ("reference", "beyond")),
)
MASSES = (0.1, 0.2, 0.5, 1.5)  # [kg]
WHEN = {"": (1.5, 4.5), "at rest": (3.5, 5.3), "late": (4.8, 5.3)}  # [s]
RESTS = 2.0  # [s] from then on within a second
MOTOR_SIDE = {"ur5e": (0.5, 1.6), "ur10e": (1.2, 4.0)}  # [kg]


def log_with_changes(
    mass: float, seed: int, how: str = "", robot: str = "panda"
) -> tuple[Recording, Recording, list[float]]:
    """A log of 6 s, a tare, and when the payload changes; how: one of `WHEN`, or "up and down"."""
    known, rng = arm(robot), np.random.default_rng([seed, 3])
    motion: Motion = taie2024() if robot == "panda" and seed % 2 else random_motion(known, seed + 40, duration=6.0)
    payload, when = body_of(mass, seed), float(rng.uniform(*WHEN.get(how, WHEN[""])))
    held = [(0.0, payload), (when, None)] if rng.random() < 0.5 else [(0.0, None), (when, payload)]
    if how == "up and down":
        held = [(0.0, None), (2.0, payload), (4.0, None)]
    moves = Resting(motion, (RESTS,)) if how == "at rest" else motion
    of_arm = {"world": World.real_like(known, 500 + seed), "sensors": Sensors.of(known), "rate": 200.0}
    source = Simulator(known, moves, held, speed=None, duration=6.0, seed=seed, **of_arm)
    places = MotionSource(known, 0.0)
    about = places.draw("long", rng, 20.0, "tare", places.centre(motion), 0.3)
    tare = simulate(known, about, seed=seed + 9000, **of_arm)
    return Recording(*map(np.array, zip(*source, strict=True))), tare, [t for t, _ in held[1:]]  # type: ignore[arg-type]


def looked_at(log: Recording, known: Arm, tare: Recording | None) -> tuple[list[float], bool]:
    """The changes that `identify` finds, and whether it finds none and doubts."""
    answer = identify(log, known, tare=tare)
    return [part.start + float(log.t[0]) for part in answer.segments[1:]], MAY_CHANGE in answer.notes


def table(found: dict[str, dict[str, float]]) -> str:
    """The cases as rows."""
    rows = [
        [name, *(f"{100 * case[what]:.0f} %" for what in ("found", "found or doubted")), off(case)]
        for name, case in found.items()
    ]
    return markdown_table(["log", "found", "found or doubted", "off [s]"], "lrrr", rows)


def off(case: dict[str, float]) -> str:
    """How far off the time is, where there is one."""
    return f"{case['off [s]']:.2f}" if case.get("off [s]") is not None else ""


def sound(robot: str, population: str, logs: int, seed: int) -> dict[str, float]:
    """Nothing changes."""
    known = arm(robot)
    drawn = draw_episodes(known, population, logs, 61 + seed, motions=max(5, logs // 4))
    seen = [looked_at(log.run, known, log.tare) for log in simulate_episodes(drawn)]
    changed, doubted = np.mean([bool(times) for times, _ in seen]), np.mean([doubt for _, doubt in seen])
    return {"logs": logs, "found": float(changed), "found or doubted": float(changed + doubted)}


def changes(mass: float, how: str, tared: bool, robot: str, logs: int, seed: int) -> dict[str, float]:
    """A payload is taken up or put down."""
    right, told, apart = [], [], []
    for k in range(logs):
        log, tare, truth = log_with_changes(mass, 1000 * seed + k, how, robot)
        times, doubted = looked_at(log, arm(robot), tare if tared else None)
        right.append(len(times) == len(truth))
        told.append(bool(times) or doubted)
        if right[-1]:
            apart += [abs(a - b) for a, b in zip(times, truth, strict=True)]
    off = {"off [s]": float(np.median(apart))} if apart else {}
    return {"logs": logs, "found": float(np.mean(right)), "found or doubted": float(np.mean(told))} | off


def named(robot: str, mass: float, how: str, tared: bool) -> str:
    """What a case is called."""
    whose = "" if robot == "panda" else f"{robot}, "
    return f"{whose}{mass} kg{how and ', '}{how}{'' if tared else ', no tare'}"


CASES: dict[str, Callable[[int, int], dict[str, float]]] = {
    f"sound, {robot} {population}": partial(sound, robot, population) for robot, population in SOUND
} | {
    named(robot, mass, how, tared): partial(changes, mass, how, tared, robot)
    for tared in (True, False)
    for robot, mass, how in (
        *(("panda", mass, "") for mass in MASSES),
        ("panda", MASSES[-1], "up and down"),
        *(("panda", mass, how) for how in ("at rest", "late") for mass in MASSES[1:]),
        *((robot, mass, "") for robot, masses in MOTOR_SIDE.items() for mass in masses),
        *((robot, masses[-1], how) for robot, masses in MOTOR_SIDE.items() for how in ("at rest", "late")),
    )
}


def main() -> None:
    asked = options(__doc__, logs=24, seed=0, cases="")
    chosen, found = cases_of("changed_logs", CASES, asked.cases)
    for name in chosen:
        found[name] = CASES[name](asked.logs, asked.seed)
        say(f"{name}: {found[name]}")
        found = {name: found[name] for name in CASES if name in found}
        write("changed_logs", {"seed": asked.seed, "cases": found})
        write_table(ROOT / "docs" / "hybrid_measured.md", "changed logs", table(found))


if __name__ == "__main__":
    main()
