"""What is wrong with a log, is it covered or said? Answers to logs of which something is not as identify assumes.

    python benchmarks/wrong_logs.py [--logs 24] [--seed 0] [--cases "tilted;swings"]

Every case takes the same Pandas, payloads and motions (the benchmark's reference population, `armload.lab.episodes`),
with a tare of 20 s and a run of 6 s, makes one thing wrong (`wrong_cases.py`) and asks `armload.identify` as a user
does. Sound logs are among the cases, twice as many of each: of several populations, and of a second simulator that
shares nothing with the one the hybrid was trained on but the rigid body.

mass          mean absolute error ± mean half-width [g]
inside        share of the true values inside their intervals: mass · first moments · inertia
calibrated    share of the answers that are called calibrated
covered or said   share of the true values that lie inside, or whose answer is not called calibrated
no word       share of the answers that are not called calibrated, and have no note that says why

Cases that are named replace their own among the results. Written to benchmarks/results/wrong_logs.json and a table of
docs/hybrid.md, after every case; half an hour of one core.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table
from wrong_cases import CASES, Wrong

from armload import arm, identify

GROUPS = (slice(0, 1), slice(1, 4), slice(4, 10))


def answered(logs: Iterable[Wrong]) -> dict[str, Any]:
    """What is said of the logs of a case."""
    error, half, inside, calibrated, silent, notes = [], [], [], [], [], {}
    panda = arm("panda")
    for log in logs:
        answer = identify(log.run, panda, tare=log.tare, profile=log.profile)
        error.append(np.abs(answer.phi - log.truth))
        half.append(0.5 * (answer.phi_high - answer.phi_low))
        inside.append((log.truth >= answer.phi_low) & (log.truth <= answer.phi_high))
        calibrated.append(answer.interval == "calibrated")
        silent.append(not calibrated[-1] and not answer.notes)
        first = answer.notes[0].split(":")[0][:60] if answer.notes and not calibrated[-1] else ""
        notes[first] = notes.get(first, 0) + 1
    held, trusted = np.array(inside), np.array(calibrated)
    fine = held | ~trusted[:, None]
    return {
        "logs": len(trusted),
        "mass error [g]": round(1e3 * float(np.mean(error, axis=0)[0]), 1),
        "half-width [g]": round(1e3 * float(np.mean(half, axis=0)[0]), 1),
        "first moments [g·m]": round(1e3 * float(np.mean(error, axis=0)[1:4].mean()), 2),
        "inside": [round(float(held[:, part].mean()), 3) for part in GROUPS],
        "calibrated": round(float(trusted.mean()), 3),
        "covered or said": [round(float(fine[:, part].mean()), 3) for part in GROUPS],
        "no word": round(float(np.mean(silent)), 3),
        "first notes": notes,
    }


def table(found: dict[str, Any]) -> str:
    """The cases as rows."""
    rows = [
        [
            name,
            str(case["logs"]),
            f"{case['mass error [g]']:.1f} ± {case['half-width [g]']:.0f}",
            " · ".join(f"{x:.2f}" for x in case["inside"]),
            f"{100 * case['calibrated']:.0f} %",
            " · ".join(f"{x:.2f}" for x in case["covered or said"]),
        ]
        for name, case in found.items()
    ]
    return markdown_table(
        ["what is wrong", "logs", "mass [g]", "inside", "calibrated", "covered or said"], "lrrrrr", rows
    )


def main() -> None:
    asked = options(__doc__, logs=24, seed=0, cases="")
    chosen = [name for name in CASES if not asked.cases or name in asked.cases.split(";")]
    file = RESULTS / "wrong_logs.json"
    found = json.loads(file.read_text(encoding="utf-8"))["cases"] if asked.cases and file.exists() else {}
    for name in chosen:
        count = asked.logs * (2 if name.startswith("nothing") else 1)
        found[name] = answered(CASES[name](count, asked.seed))
        say(f"{name}: {found[name]}")
        found = {name: found[name] for name in CASES if name in found}
        write("wrong_logs", {"seed": asked.seed, "cases": found})
        write_table(ROOT / "docs" / "hybrid.md", "wrong logs", table(found))


if __name__ == "__main__":
    main()
