"""How often an arm that holds things loosely is told from a sound one, by the logs of some days.

    python benchmarks/loose_grippers.py [--arms 8] [--logs 30] [--seed 31] [--gap 0.005]

The arms, days, motions and boxes of `fleet.py`, two logs a day, and each log twice: with what is held fixed, and
sliding by `gap` either way between two stops along an axis across the flange that belongs to the arm. Where the payload
changes is known here. Asked is `armload.survey.looseness` of all logs of an arm. Printed, and written to
benchmarks/results/loose_grippers.json and a table of docs/survey.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from alarms import wilson
from fleet import BEGAN, DAY, EMPTY, RATE, WORK, drawn_payloads, held_of, with_play, world_of
from script import ROOT, markdown_table, options, say, write, write_table

from armload import arm
from armload.identification.play import play_within
from armload.lab.episodes.motion_kinds import MotionSource
from armload.recording import Recording
from armload.simulation import Sensors, simulate_inverse
from armload.survey.looseness import Looseness, looseness
from armload.survey.rows import of_play

KINDS = ("long", "pick-and-place", "fast", "point-to-point")


def rows_of(panda: Any, log: Recording, tare: Recording, parts: list[tuple[float, float, float]]) -> list[dict]:
    """As a survey has them, with the true masses."""
    plays = play_within(log, panda, [(a, b) for a, b, _ in parts], tare)
    return [{"mass": mass} | of_play(play) for (_, _, mass), play in zip(parts, plays, strict=True)]


def asked_of(panda: Any, k: int, logs: int, seed: int, gap: float) -> list[Looseness | None]:
    """What is found of an arm that holds things firmly, and of the same that does not."""
    rng, sensors, source = np.random.default_rng([seed, k, 22]), Sensors.panda(panda).evenly(), MotionSource(panda, 0.0)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    axis = np.array([np.cos(turn), np.sin(turn), 0.0])
    empty = source.draw("long", rng, EMPTY, f"empty-{k}")
    work = [source.draw(kind, rng, WORK, f"{kind}-{k}", source.centre(empty), 0.5) for kind in KINDS]
    how: dict[str, Any] = {"sensors": sensors, "rate": RATE}
    rows: list[list[dict]] = [[], []]
    tare = simulate_inverse(panda, empty, world=world_of(panda, 10 + k, -1, logs, seed), seed=seed, **how)
    for i in range(logs):
        number, held = int(rng.integers(1 << 30)), drawn_payloads(rng)
        motion, world = work[number % len(work)], world_of(panda, 10 + k, i // 2, logs, seed)
        firm = simulate_inverse(panda, motion, held, world=world, duration=WORK, seed=number, **how)
        masses = [[t, 0.0 if p is None else p.parameters.mass] for t, p in held]
        parts = held_of({"held": masses, "seconds": WORK})
        for into, log in zip(rows, (firm, with_play(panda, motion, firm, held, axis, gap)), strict=True):
            into += rows_of(panda, log, tare, parts)
    return [looseness(of) for of in rows]


def main() -> None:
    asked = options(__doc__, arms=8, logs=30, seed=31, gap=0.005)
    panda, found = arm("panda"), []
    for k in range(asked.arms):
        of = asked_of(panda, k, asked.logs, asked.seed, asked.gap)
        found.append([None if one is None else vars(one) | {"found": one.found} for one in of])
        said = [None if one is None else f"{one['statistic']:.1f} of {one['threshold']:.1f}" for one in found[-1]]
        say(f"arm {k}: {said}")
    rows, counts = [], {}
    for name, column in zip(("firmly", "loosely"), zip(*found, strict=True), strict=True):
        hits = [one is not None and one["found"] for one in column]
        low, high = wilson(sum(hits), len(hits))
        told = [one["statistic"] for one in column if one is not None]
        counts[name] = {"arms": len(hits), "called loose": sum(hits), "interval": [low, high]}
        rate = f"{sum(hits)} of {len(hits)} ({100 * low:.0f}–{100 * high:.0f} %)"
        rows.append([name, rate, f"{min(told):.1f} … {max(told):.1f}" if told else ""])
    write_table(ROOT / "docs" / "survey.md", "loose", markdown_table(["holds", "called loose", "T"], "lrr", rows))
    about = {"days of fleet.py": [BEGAN, DAY], "gap [m]": asked.gap, "logs of each": asked.logs}
    write("loose_grippers", about | {"counts": counts, "arms": found})


if __name__ == "__main__":
    main()
