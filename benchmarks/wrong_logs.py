"""What is wrong with a log, is it covered or said? Answers to logs of which something is not as identify assumes.

    python benchmarks/wrong_logs.py [--robot panda] [--logs 24] [--seed 0] [--cases "old tare;nothing"]
    python benchmarks/wrong_logs.py --again "5,9" --logs 64 --cases "taken up or put down;held throughout"

Every case takes the same arms, payloads and motions (the benchmark's reference population, `armload.lab.episodes`),
with a tare of 20 s and a run of 6 s, makes one thing wrong (`wrong_cases.py`) and asks `armload.identify` as a user
does. Sound logs are among the cases, twice as many of each: of several populations, and of a second simulator that
shares nothing with the one the hybrid was trained on but the rigid body.

mass          mean absolute error ± mean half-width [g]
inside        share of the true values inside their intervals: mass · first moments · inertia
calibrated    share of the answers that are called calibrated
covered or said   share of the true values that lie inside, or whose answer is not called calibrated; or refused
no word       share of the answers that are not called calibrated, and have no note that says why

Cases that are named replace their own among the results. Written to benchmarks/results/wrong_logs_<robot>.json and a
table of docs/hybrid_measured.md, after every case; half an hour of one core.

With --again, cases are answered with other seeds, to tell chance from fault: how many values are covered or said, with
Clopper–Pearson intervals (95 %) that take each value, or each log only, for an answer of its own, as the values of a
log are correlated; all, and those where something is held at the end. *held throughout* are logs of *taken up or put
down* where something is taken up, but with it held from the start. `wrong_cases.LIMITS` are asked so, too: what nothing
in a log tells. Cases that are named replace their own in benchmarks/results/wrong_logs_again.json, which is of the
Panda.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta
from script import RESULTS, ROOT, cases_of, markdown_table, options, say, write, write_table
from wrong_cases import CASES, CONTROLS, LIMITS, PANDAS, Wrong

from armload import Arm, arm, identify
from armload.errors import RecordingError

GROUPS = (slice(0, 1), slice(1, 4), slice(4, 10))
NAMES = ("mass", "first moments", "inertia")


def answered(known: Arm, logs: Iterable[Wrong]) -> dict[str, Any]:
    """What is said of the logs of a case."""
    error, half, inside, calibrated, silent, notes, refused = [], [], [], [], [], {}, 0
    for log in logs:
        try:
            answer = identify(log.run, known, tare=log.tare, profile=log.profile)
        except RecordingError as reason:
            first = f"refused: {str(reason)[:60]}"
            refused, notes[first] = refused + 1, notes.get(first, 0) + 1
            continue
        error.append(np.abs(answer.phi - log.truth))
        half.append(0.5 * (answer.phi_high - answer.phi_low))
        inside.append((log.truth >= answer.phi_low) & (log.truth <= answer.phi_high))
        calibrated.append(answer.interval == "calibrated")
        silent.append(not calibrated[-1] and not answer.notes)
        first = answer.notes[0].split(":")[0][:60] if answer.notes and not calibrated[-1] else ""
        notes[first] = notes.get(first, 0) + 1
    held, trusted = np.array(inside, dtype=bool).reshape(-1, 10), np.array(calibrated, dtype=bool)
    fine = np.vstack([held | ~trusted[:, None], np.ones((refused, 10), bool)])
    errors, halves = (np.array(x).reshape(-1, 10) for x in (error, half))
    return {
        "logs": len(fine),
        "refused": refused,
        "mass error [g]": _mean(1e3 * errors[:, 0], 1),
        "half-width [g]": _mean(1e3 * halves[:, 0], 1),
        "first moments [g·m]": _mean(1e3 * errors[:, 1:4], 2),
        "inside": [_mean(held[:, part], 3) for part in GROUPS],
        "calibrated": _mean(trusted, 3),
        "covered or said": [_mean(fine[:, part], 3) for part in GROUPS],
        "no word": _mean(np.array(silent), 3),
        "first notes": notes,
    }


def _mean(x: NDArray, digits: int) -> float | None:
    """None: of logs that were all refused."""
    return round(float(x.mean()), digits) if x.size else None


def table(found: dict[str, Any]) -> str:
    """The cases as rows."""
    rows = []
    for name, case in found.items():
        answered = case["mass error [g]"] is not None
        rows.append(
            [
                name,
                str(case["logs"]),
                str(case["refused"]),
                f"{case['mass error [g]']:.1f} ± {case['half-width [g]']:.0f}" if answered else "",
                " · ".join(f"{x:.2f}" for x in case["inside"]) if answered else "",
                f"{100 * case['calibrated']:.0f} %" if answered else "",
                " · ".join(f"{x:.2f}" for x in case["covered or said"]),
            ]
        )
    return markdown_table(
        ["what is wrong", "logs", "refused", "mass [g]", "inside", "calibrated", "covered or said"], "lrrrrrr", rows
    )


def between(held: float, of: int) -> list[float]:
    """The Clopper–Pearson interval (95 %) of a share of which `held` were seen; of logs, it may be a part of one."""
    low = float(beta.ppf(0.025, held, of - held + 1.0)) if held > 0 else 0.0
    high = float(beta.ppf(0.975, held + 1.0, of - held)) if held < of else 1.0
    return [round(low, 3), round(high, 3)]


def again(name: str, logs: int, seeds: list[int]) -> dict[str, Any]:
    """A case with several seeds, and how sure its shares are."""
    panda, fine, held = arm("panda"), [], []
    for log in (log for seed in seeds for log in (CASES | CONTROLS | LIMITS)[name]("panda", logs, seed)):
        answer = identify(log.run, panda, tare=log.tare, profile=log.profile)
        inside = (log.truth >= answer.phi_low) & (log.truth <= answer.phi_high)
        fine.append(inside | (answer.interval != "calibrated"))
        held.append(bool(log.truth.any()))
    return {"all": counted(np.array(fine)), "held at the end": counted(np.array(fine)[held])}


def counted(fine: NDArray[np.bool_]) -> dict[str, Any]:
    """Of each group of parameters: values covered or said, of how many, their share, and its two intervals."""
    out: dict[str, Any] = {"logs": len(fine)}
    for name, part in zip(NAMES, GROUPS, strict=True):
        seen, of, share = int(fine[:, part].sum()), fine[:, part].size, float(fine[:, part].mean())
        by = {"by value": between(seen, of), "by log": between(share * len(fine), len(fine))}
        out[name] = {"covered or said": [seen, of], "share": round(share, 3)} | by
    return out


def several(asked: argparse.Namespace) -> None:
    """The cases that are named, with several seeds."""
    file, seeds = RESULTS / "wrong_logs_again.json", [int(seed) for seed in asked.again.split(",")]
    found = json.loads(file.read_text(encoding="utf-8"))["cases"] if file.exists() else {}
    for name in asked.cases.split(";"):
        found[name] = {"seeds": seeds} | again(name, asked.logs, seeds)
        write("wrong_logs_again", {"cases": found})


def main() -> None:
    asked = options(__doc__, robot="panda", logs=24, seed=0, cases="", again="")
    known, result = arm(asked.robot), f"wrong_logs_{asked.robot}"
    if asked.again:
        several(asked)
        return
    there = [name for name in CASES if asked.robot == "panda" or name not in PANDAS]
    chosen, found = cases_of(result, there, asked.cases)
    for name in chosen:
        count = asked.logs * (2 if name.startswith("nothing") else 1)
        found[name] = answered(known, CASES[name](asked.robot, count, asked.seed))
        say(f"{name}: {found[name]}")
        found = {name: found[name] for name in CASES if name in found}
        write(result, {"seed": asked.seed, "cases": found})
        marker = "wrong logs" if asked.robot == "panda" else f"wrong logs of {asked.robot}"
        write_table(ROOT / "docs" / "hybrid_measured.md", marker, table(found))


if __name__ == "__main__":
    main()
