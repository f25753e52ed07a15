"""Is a payload in some of a profile's logs told when the profile is learned? And are sound logs left alone?

    python benchmarks/profile_agreement.py [--arms panda,gen3,iiwa14,ur10e] [--profiles 8]

Every profile is of another arm (`World.real_like`), whose offsets and friction differ from day to day by
`Correction.daily_std`: logs of 20 s at 100 Hz of 2, 4, 6 or 8 days in turn, about another pose each. *sound*: nothing
is mounted; *one of them*: the second log holds a tenth of the rated payload, or half of it; *every other*: a quarter in
the first, third, … *refused*: no profile is made of them; *named*: of those with one such log, that it is the one which
is named. Written to benchmarks/results/profile_agreement.json and a table of docs/profiles.md; ten minutes of one core.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from bodies import body_of
from script import ROOT, markdown_table, options, say, write, write_table
from tare_drift import another_day

from armload import Arm, Recording, arm
from armload.arms import rated_mass
from armload.errors import IdentificationError
from armload.lab.episodes.motion_kinds import MotionSource
from armload.posterior import learn_profile
from armload.simulation import Run, Sensors, World, simulate_many
from armload.simulation.resolution import COARSE

DAYS = (4, 6, 8, 2)
SECONDS = 20.0
CASES = {  # which of K logs hold how much of what the arm is rated for
    "sound": (slice(0), 0.0),
    "one of them, a tenth": (slice(1, 2), 0.1),
    "one of them, half": (slice(1, 2), 0.5),
    "every other, a quarter": (slice(0, None, 2), 0.25),
}


def logs_of(known: Arm, number: int, case: str) -> list[Recording]:
    """The logs of one arm's days."""
    which, share = CASES[case]
    world, rng = World.real_like(known, 4000 + number), np.random.default_rng([number, 31])
    source, days = MotionSource(known, 0.0), DAYS[number % len(DAYS)]
    body = body_of(share * rated_mass(known), 50 + number) if share else None
    runs = []
    for day in range(days):
        motion = source.draw("long", rng, SECONDS, f"day {day}")
        held = body if day in range(days)[which] else None
        runs.append(Run(motion, held, another_day(world, known, rng), Sensors.of(known), 1000 * number + day))
    return simulate_many(known, runs, rate=100.0, duration=SECONDS, workers=1, resolution=COARSE)


def measured(name: str, case: str, count: int) -> dict[str, Any]:
    """How many profiles of an arm are refused, and how many name the log."""
    known, refused, named = arm(name), 0, 0
    for number in range(count):
        logs = logs_of(known, number, case)
        try:
            learn_profile(known, logs)
        except IdentificationError as reason:
            refused += 1
            named += str(reason).startswith(logs[1].source)
    return {"profiles": count, "refused": refused, "named": named}


def main() -> None:
    asked = options(__doc__, arms="panda,gen3,iiwa14,ur10e", profiles=8)
    found: dict[str, dict[str, Any]] = {}
    for name in asked.arms.split(","):
        found[name] = {case: measured(name, case, asked.profiles) for case in CASES}
        say(f"{name}: {found[name]}")
    rows = []
    for name, by_case in found.items():
        cells = [f"{x['refused']} of {x['profiles']}" for x in by_case.values()]
        rows.append([f"`{name}`", *cells])
    write("profile_agreement", {"arms": found})
    table = markdown_table(["arm", *CASES], "l" + "r" * len(CASES), rows)
    write_table(ROOT / "docs" / "profiles.md", "profile agreement", table)


if __name__ == "__main__":
    main()
