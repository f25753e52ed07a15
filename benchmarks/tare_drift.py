"""Is an arm as it was at its tare? How often sound logs are doubted, how often changed arms are, and what is answered.

    python benchmarks/tare_drift.py [--episodes 24] [--seed 5] [--cases "sound;old"]

Every case draws episodes of a population of the benchmark (`armload.lab.episodes`), with a tare, and changes the arm
between tare and run:

sound        nothing, in five populations
a day        offsets and friction by what is expected of a day, 1 sigma (`Correction.daily_std`)
a third, old offsets by ±0.1 (wrist 0.03) N·m and friction by 10 %; by ±0.3 (wrist 0.1) N·m and 30 %,
             or one of the two alone
other arm    the tare is of another arm of the same kind
FR3          its joints rub 2.5 times as much as a Panda's, of what they are rated for

Each log is answered by the hybrid (or `map-gp`, where none is shipped) with and without the tests of
`armload.posterior.drift` and `armload.posterior.another_arm`; arms that measure motor current are not asked. doubted:
share that are told to have changed. another: share that are told to be of another arm, or of a repaired one. said or
inside: share whose mass lies in its interval, or that are doubted. Cases that are named replace their own among the
results. Printed, and written to benchmarks/results/tare_drift.json and a table of docs/hybrid_measured.md; six minutes
of one core.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from script import ROOT, cases_of, markdown_table, options, say, write, write_table

from armload import Arm, arm
from armload.arms import rated_effort
from armload.identification.choice import choose
from armload.inertia import Z95
from armload.lab.episodes import Episode, draw_episodes, simulate_episodes
from armload.regression import Correction
from armload.simulation import World

CASES = {  # name → arm, population, what has changed
    "sound": ("panda", "reference", None),
    "sound, tare elsewhere": ("panda", "elsewhere", None),
    "sound, everyday motions": ("panda", "everyday", None),
    "sound, along the same motion": ("panda", "same-motion", None),
    "sound, arms beyond the measured": ("panda", "beyond", None),
    "a day": ("panda", "reference", "day"),
    "a third": ("panda", "reference", 0.33),
    "old": ("panda", "reference", 1.0),
    "old, offsets alone": ("panda", "reference", "offsets"),
    "old, friction alone": ("panda", "reference", "friction"),
    "old, along the same motion": ("panda", "same-motion", 1.0),
    "other arm": ("panda", "reference", "other"),
    "sound, FR3": ("fr3", "reference", None),
    "old, FR3": ("fr3", "reference", 1.0),
}
OLD_OFFSET = np.array([0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])  # [N·m] of a Panda and an FR3
OLD_SHARE = 0.3 / 87.0  # of the rated torque: the offset of another arm, as of a Panda's large joints
OLD_FRICTION = 0.3


def another_day(world: World, known: Arm, rng: np.random.Generator) -> World:
    """The arm on another day: offsets and Coulomb friction differ by what is expected, 1 sigma."""
    daily = Correction(known, rated_effort(known)).daily_std[: 2 * known.n].reshape(2, -1)
    drift = rng.normal(size=(2, known.n)) * daily
    level = np.maximum(world.friction.level + drift[1], 0.3 * world.friction.level)
    return replace(world, offset=world.offset + drift[0], friction=replace(world.friction, level=level))


def before(episode: Episode, change: Any, k: int) -> Episode:
    """The episode with a tare of the arm before it changed."""
    world, rng = episode.world, np.random.default_rng([k, 99])
    if change is None:
        return episode
    if change == "other":
        return replace(episode, tare_world=World.real_like(episode.arm, 7000 + k))
    if change == "day":
        then = another_day(world, episode.arm, rng)
    else:
        slips, shifts = {"offsets": (0.0, 1.0), "friction": (1.0, 0.0)}.get(change, (change, change))
        level = world.friction.level * (1.0 + slips * OLD_FRICTION)
        franka = episode.arm.known_as in ("panda", "fr3")
        size = OLD_OFFSET if franka else OLD_SHARE * rated_effort(episode.arm)
        offset = world.offset + shifts * rng.choice([-1.0, 1.0], episode.arm.n) * size
        then = replace(world, offset=offset, friction=replace(world.friction, level=level))
    return replace(episode, tare_world=then)


def answered(known: Arm, episodes: list[Episode]) -> dict[str, Any]:
    """What is said of the episodes' logs with the test and without."""
    errors, inside, doubted, statistics, others = {True: [], False: []}, {True: [], False: []}, [], [], []
    half: dict[bool, list[float]] = {True: [], False: []}
    for logs in simulate_episodes(episodes):
        for tested in (True, False):
            identifier = choose(known, logs.tare).identifier
            identifier.test_tare = tested
            estimate = identifier.run(logs.run)
            error = np.abs(estimate.phi - logs.truth.phi)
            errors[tested].append(error)
            inside[tested].append(error <= Z95 * estimate.std)
            half[tested].append(float(Z95 * estimate.std[0]))
            if tested:
                drift, another = identifier.stream.drift, identifier.stream.another
                if drift is None or another is None:  # not asked where torque seems to be motor current
                    doubted.append(False)
                    statistics.append(0.0)
                    others.append((False, 0.0, -100.0))
                else:
                    doubted.append(drift.changed or another.found)
                    statistics.append(drift.statistic)
                    others.append((another.found, another.surprise, another.log_odds))
    out: dict[str, Any] = {"episodes": len(doubted), "doubted": round(float(np.mean(doubted)), 3)}
    out["statistic, quantiles 0.5 0.9 1"] = np.quantile(statistics, [0.5, 0.9, 1.0]).round(1).tolist()
    found, surprise, odds = np.array(others, dtype=float).T
    out["another"] = round(float(found.mean()), 3)
    out["surprise, quantiles 0.5 0.9 1"] = np.quantile(surprise, [0.5, 0.9, 1.0]).round(1).tolist()
    out["log odds, quantiles 0.5 0.9 1"] = np.quantile(odds, [0.5, 0.9, 1.0]).round(1).tolist()
    for tested, name in ((True, "with the test"), (False, "without")):
        error, held = np.array(errors[tested]), np.array(inside[tested])
        said = held[:, 0] | np.array(doubted) if tested else held[:, 0]
        out[name] = {
            "mass error [g]": round(1e3 * float(error[:, 0].mean()), 1),
            "half-width [g]": round(1e3 * float(np.mean(half[tested])), 1),
            "first moments [g·m]": round(1e3 * float(error[:, 1:4].mean()), 2),
            "inside": [round(float(held[:, part].mean()), 3) for part in (slice(0, 1), slice(1, 4), slice(4, 10))],
            "said or inside": round(float(said.mean()), 3),
        }
    return out


def table(found: dict[str, Any]) -> str:
    """The cases as rows."""
    rows = []
    for name, case in found.items():
        tested, silent = case["with the test"], case["without"]
        rows.append(
            [
                name,
                f"{100 * case['doubted']:.0f} %",
                f"{100 * case['another']:.0f} %" if "another" in case else "",
                *(f"{x['mass error [g]']:.1f} ± {x['half-width [g]']:.0f}" for x in (tested, silent)),
                *(f"{x['first moments [g·m]']:.2f}" for x in (tested, silent)),
                *(f"{100 * x['inside'][0]:.0f} %" for x in (tested, silent)),
                f"{100 * tested['said or inside']:.0f} %",
            ]
        )
    columns = [
        "tare",
        "doubted",
        "another",
        "mass [g]",
        "without",
        "first moments [g·m]",
        "without",
        "inside",
        "without",
    ]
    return markdown_table([*columns, "said or inside"], "lrrrrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, episodes=24, seed=5, cases="")
    chosen, found = cases_of("tare_drift", CASES, asked.cases)
    for name in chosen:
        robot, population, change = CASES[name]
        known = arm(robot)
        drawn = draw_episodes(known, population, asked.episodes, asked.seed, motions=max(6, asked.episodes // 4))
        found[name] = answered(known, [before(episode, change, k) for k, episode in enumerate(drawn)])
        say(f"{name}: {found[name]}")
        found = {name: found[name] for name in CASES if name in found}
        write("tare_drift", {"seed": asked.seed, "cases": found})
        write_table(ROOT / "docs" / "hybrid_measured.md", "tare drift", table(found))


if __name__ == "__main__":
    main()
