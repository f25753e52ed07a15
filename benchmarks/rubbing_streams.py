"""Streams of sound arms whose joints rub under load, or whose velocities are noisy: how often they are doubted.

    python benchmarks/rubbing_streams.py [--logs 12] [--seed 0]

The logs of `rubbing_joints.py` with their tares, sample by sample: a stream is not read twice. events: changes of the
payload noticed, all of them false, in so many streams of 10 s. doubted: share of the streams that end with an answer
that is not called calibrated. inside: share of the true values inside their intervals at the end, mass · first moments
· inertia. Written to benchmarks/results/rubbing_streams.json and a table of docs/online.md; ten minutes of one core.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rubbing_joints import CASES, ROBOTS, Logs, logs_of
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_logs import GROUPS

from armload import Arm, arm
from armload.inertia import Z95
from armload.online import OnlineIdentifier

CHOSEN = ("nothing", "load 0.5 %", "load 1 %", "100 Hz", "differences, 100 Hz", "load 1 %, differences, 100 Hz")


def streamed(known: Arm, logs: Iterator[Logs]) -> dict[str, object]:
    """What streams of the logs say."""
    events, doubted, inside = 0, [], []
    for log in logs:
        stream, seen = OnlineIdentifier(known, log.tare), set()
        for sample in log.run:
            answer = stream.update(*sample)
            if answer.event is not None:
                seen.add(answer.event.t)
        end = stream.conclude()
        stream.close()
        events += len(seen)
        doubted.append(not end.calibrated)
        inside.append(np.abs(end.phi - log.truth) <= Z95 * end.std)
    held = np.array(inside)
    return {
        "streams": len(held),
        "events": events,
        "doubted": round(float(np.mean(doubted)), 3),
        "inside": [round(float(held[:, part].mean()), 3) for part in GROUPS],
    }


def table(found: dict[str, dict[str, dict]]) -> str:
    """The cases as rows."""
    rows = [
        [
            robot,
            name,
            f"{case['events']} in {case['streams']}",
            f"{100 * case['doubted']:.0f} %",
            " · ".join(f"{x:.2f}" for x in case["inside"]),
        ]
        for robot, cases in found.items()
        for name, case in cases.items()
    ]
    return markdown_table(["arm", "stream", "events", "doubted", "inside"], "llrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=12, seed=0)
    found: dict[str, dict[str, dict]] = {}
    for robot in ROBOTS:
        for name in CHOSEN:
            seen = streamed(arm(robot), logs_of(arm(robot), CASES[name], asked.logs, asked.seed))
            found.setdefault(robot, {})[name] = seen
            say(f"{robot}, {name}: {seen}")
    write("rubbing_streams", {"seed": asked.seed, "robots": found})
    write_table(ROOT / "docs" / "online.md", "rubbing streams", table(found))


if __name__ == "__main__":
    main()
