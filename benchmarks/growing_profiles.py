"""Does a profile that grows day by day still know its arm, and do its intervals hold?

    python benchmarks/growing_profiles.py [--arms 8] [--seed 11] [--work out/growing-profiles]

Each Panda has empty logs of fifteen days, 20 s each (drift as in `life.py`), on motions about where it works or
anywhere. A profile is learned from the first four, and the others are offered to it one after another, as
`armload profile --update` does: what does not fit is not learned from.

refused     own logs that are said not to fit, of eleven for each arm
others      logs of another Panda that are said not to fit; three for each arm, after the fifteen days
noise       by how much noise counts for more in the end, median
errors      of the mass of a loaded run after 6 s with the profile of the end, half-widths, and intervals inside

*first four*: the noise stays as the first four logs chose it; *at once*: all fifteen logs learned together (none is
offered to it). Finished arms are kept in --work. Printed, and written to benchmarks/results/growing_profiles.json and
a table of docs/profiles.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from alarms import wilson
from life import DAYS, empty_logs, motions_about, on_a_day
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Arm, Recording, arm
from armload.errors import IdentificationError
from armload.inertia import Z95, InertialParameters
from armload.lab.cells import key_of
from armload.lab.episodes import Episode, draw_episodes
from armload.lab.experiment import Task, run_tasks, source_key
from armload.posterior import HybridIdentifier, Profile, learn_profile, profile_session
from armload.posterior.profile_session import check_fits
from armload.simulation import Run, World, simulate_many
from armload.simulation.resolution import COARSE

BEGUN, OTHERS, RATE = 4, 3, 100.0
PLACES = {"here": "where it works", "anywhere": "anywhere"}
WAYS = ("as it is", "first four", "at once")


def grown(robot: Arm, logs: list[Recording], way: str) -> tuple[Profile, int]:
    """A profile of these logs, and how many of them it refused."""
    if way == "at once":
        return learn_profile(robot, logs), 0
    profile, refused = learn_profile(robot, logs[:BEGUN]), 0
    for log in logs[BEGUN:]:
        if not fits(profile, robot, log):
            refused += 1
            continue
        profile = learn_profile(robot, [log], known=profile)
    return profile, refused


def fits(profile: Profile, robot: Arm, log: Recording) -> bool:
    try:
        check_fits(profile, robot, log)
    except IdentificationError:
        return False
    return True


def of_arm(e: Episode, place: str, k: int, seed: int) -> dict[str, Any]:
    """One arm: its fifteen days, logs of other arms, and a loaded run."""
    rng = np.random.default_rng([seed, k, len(place)])
    motions = motions_about(e, place, 100 + k)
    logs = empty_logs(e, [on_a_day(e.world, 1.0, rng) for _ in range(DAYS)], motions, 20.0, e.seed)
    worlds = [World.real_like(e.arm, 7000 + OTHERS * k + i) for i in range(OTHERS)]
    others = empty_logs(e, worlds, motions[:OTHERS], 20.0, e.seed + 500)
    load = InertialParameters(e.payload.parameters.phi)
    loaded = Run(e.motion, load, on_a_day(e.world, 1.0, rng), e.sensors, e.seed, e.gains, 60.0)
    run = simulate_many(e.arm, [loaded], rate=RATE, duration=6.0, workers=1, resolution=COARSE)[0]
    found = {}
    for way in WAYS:
        as_chosen = patch.object(profile_session, "counting_repeats", lambda known, *_: known)
        if way == "first four":
            with as_chosen:
                profile, refused = grown(e.arm, logs, way)
        else:
            profile, refused = grown(e.arm, logs, way)
        estimate = HybridIdentifier(e.arm, profile=profile).run(run)
        found[way] = {
            "refused": refused,
            "others": sum(not fits(profile, e.arm, log) for log in others),
            "noise": profile.repeated,
            "error": (estimate.phi - e.truth.phi).tolist(),
            "half": (Z95 * estimate.std).tolist(),
        }
    return {"place": place, "arm": k, "found": found}


def row_of(place: str, way: str, cells: list[dict[str, Any]]) -> list[str]:
    """Of the table."""
    ours = [cell["found"][way] for cell in cells if cell["place"] == place]
    error, half = (np.array([one[what] for one in ours]) for what in ("error", "half"))
    inside = np.abs(error) <= half
    offered, others = len(ours) * (DAYS - BEGUN), len(ours) * OTHERS

    def share(hits: int, of: int) -> str:
        low, high = wilson(hits, of)
        return f"{100 * hits / of:.0f} % ({100 * low:.0f}–{100 * high:.0f}) of {of}"

    return [
        PLACES[place],
        way,
        "" if way == "at once" else share(sum(one["refused"] for one in ours), offered),
        share(sum(one["others"] for one in ours), others),
        f"{np.median([one['noise'] for one in ours]):g}",
        f"{1e3 * np.abs(error[:, 0]).mean():.1f} ± {1e3 * half[:, 0].mean():.1f}",
        " · ".join(f"{100 * inside[:, part].mean():.0f}" for part in (slice(0, 1), slice(1, 4), slice(4, 10))) + " %",
    ]


def main() -> None:
    asked = options(__doc__, arms=8, seed=11, work="out/growing-profiles")
    episodes = draw_episodes(arm("panda"), "reference", asked.arms, asked.seed, motions=asked.arms)
    code = key_of(source_key(), source_key(__file__, Path(__file__).with_name("life.py")), asked.arms, asked.seed)
    tasks = [
        Task.of_one(f"{place}-{k}", key_of(code, place, k), of_arm, e, place, k, asked.seed)
        for k, e in enumerate(episodes)
        for place in PLACES
    ]
    cells = list(run_tasks(tasks, asked.work, say=say).values())
    heads = ["motions", "noise", "own logs refused", "other arms refused", "counts", "mass [g]", "inside"]
    text = markdown_table(heads, "llrrrrr", [row_of(place, way, cells) for place in PLACES for way in WAYS])
    say(text)
    if asked.arms > 2:
        write("growing_profiles", {"arms": asked.arms, "seed": asked.seed, "cells": cells})
        write_table(ROOT / "docs" / "profiles.md", "growing", text)


if __name__ == "__main__":
    main()
