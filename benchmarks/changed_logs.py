"""A payload that changes within a log: how surely `identification.segments` finds it, and how often it is wrong.

    python benchmarks/changed_logs.py [--logs 24] [--seed 0]

sound     logs of the benchmark's populations, of which nothing changes: share in which a change is found
changes   a payload of 0.2, 0.5 and 1.5 kg taken up or put down somewhere in the middle of 6 s, at once: share found,
          and how far off the time is [s, median]; two changes: taken up after 2 s and put down after 4 s

Pandas that differ from their model as real ones do, and UR10e where it is said. Written to
benchmarks/results/changed_logs.json and a table of docs/hybrid.md.
"""

from __future__ import annotations

import numpy as np
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm
from armload.devices import Simulator
from armload.identification.segments import changes_of_payload
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import random_motion, taie2024
from armload.payloads import draw_payload
from armload.simulation import Sensors, World

SOUND = (("panda", "reference"), ("panda", "everyday"), ("panda", "beyond"), ("ur10e", "reference"))
MASSES = (0.2, 0.5, 1.5)  # [kg]


def log_with_changes(mass: float, seed: int, twice: bool = False) -> tuple[Recording, list[float]]:
    """A log of 6 s, and when its payload changes."""
    panda, rng = arm("panda"), np.random.default_rng([seed, 3])
    motion = taie2024() if seed % 2 else random_motion(panda, seed + 40, duration=6.0)
    payload, when = draw_payload("boxes", seed, mass), float(rng.uniform(1.5, 4.5))
    held = [(0.0, payload), (when, None)] if rng.random() < 0.5 else [(0.0, None), (when, payload)]
    if twice:
        held = [(0.0, None), (2.0, payload), (4.0, None)]
    how = {"world": World.real_like(panda, 500 + seed), "sensors": Sensors.panda(panda), "rate": 200.0}
    source = Simulator(panda, motion, held, speed=None, duration=6.0, seed=seed, **how)
    return Recording(*map(np.array, zip(*source, strict=True))), [t for t, _ in held[1:]]  # type: ignore[arg-type]


def table(found: dict[str, dict[str, float]]) -> str:
    """The cases as rows."""
    rows = [
        [name, f"{100 * case.get('called changed', np.nan):.0f} %", "", ""]
        if "called changed" in case
        else [name, "", f"{100 * case['found']:.0f} %", f"{case['off [s]']:.2f}"]
        for name, case in found.items()
    ]
    return markdown_table(["log", "called changed", "changes found", "off [s]"], "lrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=24, seed=0)
    found: dict[str, dict[str, float]] = {}
    for robot, population in SOUND:
        known = arm(robot)
        drawn = draw_episodes(known, population, asked.logs, 61 + asked.seed, motions=max(5, asked.logs // 4))
        wrong = [bool(changes_of_payload(logs.run, known)) for logs in simulate_episodes(drawn)]
        found[f"sound, {robot} {population}"] = {"called changed": float(np.mean(wrong))}
        say(f"{robot} {population}: {np.mean(wrong):.3f}")
    panda = arm("panda")
    for mass, twice in (*((mass, False) for mass in MASSES), (MASSES[-1], True)):
        right, off = [], []
        for k in range(asked.logs):
            log, truth = log_with_changes(mass, 1000 * asked.seed + k, twice)
            times = changes_of_payload(log, panda)
            right.append(len(times) == len(truth))
            if right[-1]:
                off += [abs(a - b) for a, b in zip(times, truth, strict=True)]
        name = f"{mass} kg{', up and down' if twice else ''}"
        found[name] = {"found": float(np.mean(right)), "off [s]": float(np.median(off)) if off else float("nan")}
        say(f"{name}: {found[name]}")
    write("changed_logs", {"logs": asked.logs, "seed": asked.seed, "cases": found})
    write_table(ROOT / "docs" / "hybrid.md", "changed logs", table(found))


if __name__ == "__main__":
    main()
