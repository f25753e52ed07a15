"""Live streams of which one thing is not as they assume, and sound ones: how soon is it said, and what until then?

    python benchmarks/wrong_streams.py [--robot panda] [--logs 24] [--seed 0]

The logs of `wrong_logs.py`, cases that a stream can have, sample by sample with their tares (`OnlineIdentifier`): 6 s
each. What is asked of a log once is asked of a stream at every full solution, after 0.1, 0.3, 0.5 s and so on;
whether the arm is as it was at its tare from 1 s on.

false            changes of the payload noticed that are none, in so many streams
calibrated       share of the moments, from a second on, in which the answer is called calibrated
and out          share in which it is, and the mass lies outside its interval
covered or said  share of the moments in which the mass lies inside, or the answer is not called calibrated
at the end       the same of the last answer (`conclude`): mass · first moments · inertia

Written to benchmarks/results/wrong_streams_<robot>.json and a table of docs/online_measured.md; ten minutes of one
core.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import CASES, Wrong
from wrong_logs import GROUPS

from armload import arm
from armload.identification.tare_age import DAY
from armload.inertia import Z95
from armload.online import OnlineIdentifier

CHOSEN = (
    "nothing",
    "nothing, no tare",
    "nothing, arms beyond",
    "nothing, another simulator",
    "tare of another arm",
    "old tare",
    "old tare, its age said",
    "torque gain +3 %",
    "base tilted by 5°",
    "base tilted by 5°, no tare",
    "base tilted by 2°",
    "30 % of the mass swings",
    "30 % of the mass sloshes",
)
FROM = 1.0  # [s]
SAID = ", its age said"
AGE = 9 * DAY  # after which offsets and friction differ as those of an old tare do, on the average


def streamed(robot: str, cases: Iterator[Wrong], age: float) -> dict[str, object]:
    """What streams of the logs say, their tares being so old [s]."""
    false, trusted, out, ends = 0, [], [], []
    for case in cases:
        stream, events, truth = OnlineIdentifier(arm(robot), case.tare, tare_age=age), set(), case.truth
        for sample in case.run:
            said = stream.update(*sample)
            if said.event is not None:
                events.add(said.event.t)
            if sample.t - case.run.t[0] >= FROM:
                trusted.append(said.calibrated)
                out.append(said.calibrated and abs(said.phi[0] - truth[0]) > Z95 * said.std[0])
        end = stream.conclude()
        stream.close()
        false += len(events)
        ends.append((np.abs(end.phi - truth) <= Z95 * end.std) | (not end.calibrated))
    held = np.array(ends)
    return {
        "streams": len(held),
        "false": false,
        "calibrated": round(float(np.mean(trusted)), 3),
        "and out": round(float(np.mean(out)), 3),
        "at the end": [round(float(held[:, part].mean()), 3) for part in GROUPS],
    }


def table(found: dict[str, dict]) -> str:
    """The cases as rows."""
    rows = []
    for name, seen in found.items():
        covered, end = 1.0 - seen["and out"], " · ".join(f"{x:.2f}" for x in seen["at the end"])
        false = f"{seen['false']} in {seen['streams']}"
        shares = [f"{100 * seen[key]:.1f} %" for key in ("calibrated", "and out")]
        rows.append([name, false, *shares, f"{100 * covered:.1f} %", end])
    columns = ["what is wrong", "false", "calibrated", "and out", "covered or said", "at the end"]
    return markdown_table(columns, "lrrrrr", rows)


def main() -> None:
    asked = options(__doc__, robot="panda", logs=24, seed=0)
    found: dict[str, dict] = {}
    for name in CHOSEN:
        cases = CASES[name.removesuffix(SAID)](asked.robot, asked.logs, asked.seed)
        found[name] = streamed(asked.robot, cases, AGE if name.endswith(SAID) else 0.0)
        say(f"{name}: {found[name]}")
        write(f"wrong_streams_{asked.robot}", {"seed": asked.seed, "cases": found})
    if asked.robot == "panda":
        write_table(ROOT / "docs" / "online_measured.md", "wrong streams", table(found))


if __name__ == "__main__":
    main()
