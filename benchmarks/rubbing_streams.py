"""Streams of sound arms whose joints rub under load, or whose velocities are noisy: how often they are doubted.

    python benchmarks/rubbing_streams.py [--logs 12] [--seed 0]

The logs of `rubbing_joints.py` with their tares, sample by sample, as they come and steadied (`devices.Steadied`, as
`armload live --steady`): a stream is not read twice. In the last row the payload is taken up within the log.

false      changes of the payload noticed that are none, in so many streams of 10 s
doubted    share of the streams that end with an answer that is not called calibrated
inside     share of the true values inside their intervals at the end: mass · first moments · inertia
noticed    changes noticed within a second, and how long after: median [s] until the sample came by which it was

Written to benchmarks/results/rubbing_streams.json and a table of docs/online_measured.md; twenty minutes of one core.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rubbing_joints import CASES, ROBOTS, Case, Logs, logs_of
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_logs import GROUPS

from armload import Arm, arm
from armload.inertia import Z95
from armload.online import OnlineIdentifier
from armload.recording import Recording, Sample, Steadying, steadied

CHOSEN = ("nothing", "load 0.5 %", "load 1 %", "100 Hz", "differences, 100 Hz", "load 1 %, differences, 100 Hz")
STREAMS = {
    **{name: CASES[name] for name in CHOSEN},
    "taken up, differences, 100 Hz": Case(0.0, None, 100.0, wrong="taken up"),
}
WITHIN = 1.0  # [s]


def samples_of(log: Recording, n: int, steady: bool) -> Iterator[tuple[float, Sample]]:
    """The samples of a stream, each with the time of the one that had come last [s]."""
    steadying = Steadying(n)
    for sample in log:
        for out, _ in steadying.take(sample) if steady else [(sample, None)]:
            yield sample.t, out
    for out, _ in steadying.flush():
        yield float(log.t[-1]), out


def streamed(known: Arm, logs: Iterator[Logs], steady: bool) -> dict[str, object]:
    """What streams of the logs say."""
    wrong, delays, changes, doubted, inside = 0, [], 0, [], []
    for log in logs:
        stream, seen = OnlineIdentifier(known, steadied(log.tare) if steady else log.tare), {}
        for now, sample in samples_of(log.run, known.n, steady):
            event = stream.update(*sample).event
            if event is not None:
                seen.setdefault(event.t, now)
        end = stream.conclude()
        stream.close()
        after = [] if log.when is None else [t - log.when for t in seen.values() if 0.0 <= t - log.when <= WITHIN]
        changes += log.when is not None
        delays += after[:1]
        wrong += len(seen) - len(after[:1])
        doubted.append(not end.calibrated)
        inside.append(np.abs(end.phi - log.truth) <= Z95 * end.std)
    held = np.array(inside)
    return {
        "streams": len(held),
        "false": wrong,
        "doubted": round(float(np.mean(doubted)), 3),
        "inside": [round(float(held[:, part].mean()), 3) for part in GROUPS],
        "changes": changes,
        "noticed": len(delays),
        "delay": round(float(np.median(delays)), 3) if delays else None,
    }


def table(found: dict[str, dict[str, dict]]) -> str:
    """The cases as rows."""
    rows = []
    for robot, cases in found.items():
        for name, ways in cases.items():
            for way, seen in ways.items():
                noticed = f"{seen['noticed']} of {seen['changes']}" if seen["changes"] else ""
                noticed += f", {seen['delay']:.2f} s" if seen["delay"] is not None else ""
                inside = " · ".join(f"{x:.2f}" for x in seen["inside"])
                false = f"{seen['false']} in {seen['streams']}"
                rows.append([robot, name, way, false, f"{100 * seen['doubted']:.0f} %", inside, noticed])
    return markdown_table(["arm", "stream", "samples", "false", "doubted", "inside", "noticed"], "lllrrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=12, seed=0)
    found: dict[str, dict[str, dict]] = {}
    for robot in ROBOTS:
        for name, case in STREAMS.items():
            for way in ("as they come", "steadied"):
                seen = streamed(arm(robot), logs_of(arm(robot), case, asked.logs, asked.seed), way == "steadied")
                found.setdefault(robot, {}).setdefault(name, {})[way] = seen
                say(f"{robot}, {name}, {way}: {seen}")
            write("rubbing_streams", {"seed": asked.seed, "robots": found})
            write_table(ROOT / "docs" / "online_measured.md", "rubbing streams", table(found))


if __name__ == "__main__":
    main()
