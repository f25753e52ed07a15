"""What Taie et al. 2024 claim, as data, and what our cells say about each claim.

`claims.json` holds every percentage of Sections V and VI: 62 are printed, repeats included, one of them for four
parameters at once, which makes 65 claims. The abstract adds 4 (the ends of two ranges); 13 statements carry no number.
A percentage compares two methods on one parameter: how much smaller the mean absolute error of the better one is.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES
from armload.lab.study.numbers import (
    EXACT,
    LEAST,
    Cells,
    Ensemble,
    Match,
    at_end,
    benchmark,
    held_out,
    improvement,
    matched,
    spread,
)
from armload.lab.study.statements import RULES, Measured

CONFIRMED, NOT_CONFIRMED = "confirmed", "not confirmed"
DEPENDS, NOT_MEASURED = "depends on the split", "not measured"
VERDICTS = (CONFIRMED, NOT_CONFIRMED, DEPENDS, NOT_MEASURED)
SPLITS = ("row", "payload")  # the paper's, and the one that keeps whole payloads from the training
REAL = "test_payload_real_like"  # the stand-in for the real robot
SEMI_REAL = "test_payload_semi_real"

RULE = (
    "A claim is confirmed if its direction (or, without a number, its criterion) holds under the paper's own protocol, "
    "rows split at random, and also with whole payloads held out; not confirmed if under neither; depends on the split "
    f"if under one of them only. An improvement below {LEAST:g} % counts as none. "
    "Beyond that, the size of an improvement does not enter the verdict: it stands beside it."
)


@cache
def load_claims() -> tuple[dict[str, Any], ...]:
    """Every claim: id, where, text, paper (percent or None), and what to compare.

    >>> len(load_claims()), sum(claim["printed"] for claim in load_claims() if claim["where"] != "Abstract")
    (82, 62)
    """
    data = json.loads(resources.files("armload.lab.study").joinpath("claims.json").read_text(encoding="utf-8"))
    claims = []
    for group in data["percentages"]:
        for k, (parameter, paper) in enumerate(group["improvements"].items()):
            claims.append(
                {
                    "id": f"{group['group']}-{parameter.replace('·', '')}",
                    "where": group["where"],
                    "text": group["text"].format(parameter=parameter, paper=paper),
                    "paper": paper,
                    "parameter": parameter,
                    "better": group["better"],
                    "worse": group["worse"],
                    "on": group["on"],
                    "note": group.get("notes", {}).get(parameter, ""),
                    "printed": int(k == 0 or not group.get("printed_once")),  # percentages this claim adds to the count
                }
            )
    for statement in data["statements"]:
        claims.append({"paper": None, "parameter": None, "note": "", "printed": 0, **statement})
    return tuple(claims)


def evaluate(cells: Cells) -> list[dict[str, Any]]:
    """What the cells say about every claim.

    A percentage of Fig. 4 and 5 is measured on the single samples of the test rows of the simulated data set, one of
    Fig. 7, the conclusion and the abstract on real-like arms holding the test payload: running mean of an ensemble at
    the end of the run against the mean of least squares over the second half. There the paper does not say which
    training it used: mass and first moments come from one stage, the inertia from two, as it found better.

    Returns:
        For each claim id, where, text, paper, ours (both in percent, or what `unit` says; None: not measured), spread
        (standard deviation over seeds or worlds), split ("row": the one `ours` and `spread` stand for), verdict; and
        parameter, unit, held_out (ours with whole payloads held out), semi_real (ours on a real log with the payload's
        torque added, another motion), cap (on epochs), seeds, note.
    """
    return [_evaluated(claim, cells) for claim in load_claims()]


def _evaluated(claim: dict[str, Any], cells: Cells) -> dict[str, Any]:
    results: dict[str, Measured | None] = {}
    for split in SPLITS:
        if "rule" in claim:
            results[split] = RULES[claim["rule"]].measure(cells, claim.get("learner"), split)
        else:
            results[split] = _percentage(claim, cells, split)
    out = {
        "id": claim["id"],
        "where": claim["where"],
        "text": claim["text"],
        "paper": claim["paper"],
        "ours": None,
        "spread": None,
        "split": "none: nothing is trained" if claim.get("rule") == "overshoot" else "row",
        "verdict": NOT_MEASURED,
        "parameter": claim["parameter"],
        "unit": RULES[claim["rule"]].unit if "rule" in claim else "%",
        "held_out": None,
        "semi_real": None,
        "cap": None,
        "seeds": [],
        "note": claim["note"],
    }
    row, payload = results["row"], results["payload"]
    if row is None or payload is None:
        return out
    out |= {
        "ours": round(row.value, 2),
        "spread": None if row.spread is None else round(row.spread, 2),
        "verdict": _verdict(row.holds, payload.holds),
        "held_out": round(payload.value, 2),
        "semi_real": _semi_real(claim, cells) if claim.get("on") == "real" else None,
        "cap": row.cap,
        "seeds": list(row.seeds),
    }
    if row.exact and claim["parameter"] == "Ixy":
        out["note"] += " I_xy is 0 in every loading of our container, which its trees learn exactly."
    return out | {"note": out["note"].strip()}


def _verdict(row: bool, payload: bool) -> str:
    return DEPENDS if row != payload else CONFIRMED if row else NOT_CONFIRMED


class _Pair(NamedTuple):
    """Errors of the two methods a percentage compares on its parameter, (units,) each."""

    better: NDArray[np.float64]
    worse: NDArray[np.float64]


def _percentage(claim: dict[str, Any], cells: Cells, split: str) -> Measured | None:
    """The improvement at the largest cap on epochs; its spread over seeds at the cap that has most seeds."""
    found = _pairs(claim, cells, split, REAL)
    if not found:
        return None
    match, pair = found[0]
    value = _improvement(*pair)
    units = pair if claim["on"] == "real" else max((p for _, p in found), key=lambda p: len(p.better))
    return Measured(
        value,
        spread(_improvement, *units),
        value >= LEAST,
        match.cap,
        match.seeds,
        exact=bool(min(pair.better.mean(), pair.worse.mean()) < EXACT),
    )


def _semi_real(claim: dict[str, Any], cells: Cells) -> float | None:
    found = _pairs(claim, cells, "row", SEMI_REAL)
    return round(_improvement(*found[0][1]), 2) if found else None


def _improvement(better: NDArray, worse: NDArray) -> float:
    return improvement(float(np.mean(better)), float(np.mean(worse)))


def _pairs(claim: dict[str, Any], cells: Cells, split: str, protocol: str) -> list[tuple[Match, _Pair]]:
    """Every way to compare the two methods, the largest cap on epochs first."""
    column = NAMES.index(claim["parameter"])
    out = []
    if claim["on"] == "held_out":
        for match in matched(cells, _ensemble(claim["better"], split), _ensemble(claim["worse"], split)):
            better, worse = (held_out(group) for group in match.cells)
            if better is not None and worse is not None:
                out.append((match, _Pair(better[:, column], worse[:, column])))
        return out
    stages = 1 if column < 4 else 2
    worse = at_end(benchmark(cells, claim["worse"]), protocol)
    for match in matched(cells, Ensemble(claim["better"], stages, split)):
        better = at_end(match.cells[0], protocol)
        if better is not None and worse is not None:
            out.append((match, _Pair(better[:, column], worse[:, column])))
    return out


def _ensemble(name: str, split: str) -> Ensemble:
    kind, _, stages = name.partition("-")
    return Ensemble(kind, int(stages), split)
