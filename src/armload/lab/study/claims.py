"""What Taie et al. 2024 claim, as data, and what our cells say about each claim.

`claims.json` holds every percentage of Sections V and VI: 62 are printed, repeats included, one of them for four
parameters at once, which makes 65 claims. The abstract adds 4 (the ends of two ranges); 17 statements carry no number.
A percentage compares two methods on one parameter: how much smaller the mean absolute error of the better one is. Ten
percentages of the conclusion and the abstract repeat Section V, and count once (`repeats`).
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

from armload.inertia import NAMES
from armload.lab.study.multiverse import AXES, LEVEL, USUAL, Improvement, Multiverse, percent
from armload.lab.study.numbers import LEAST, Cells, Ensemble, at_end, benchmark, matched, on_many_arms
from armload.lab.study.spec import SEMI_REAL, SPLITS
from armload.lab.study.statements import RULES

CONFIRMED, DIRECTION, UNDETERMINED = "confirmed", "direction only", "undetermined"
NOT_CONFIRMED, DEPENDS = "not confirmed", "depends on"
NOT_COMPARABLE, NOT_MEASURED = "not comparable", "not measured"
VERDICTS = (CONFIRMED, DIRECTION, UNDETERMINED, NOT_CONFIRMED, DEPENDS, NOT_COMPARABLE, NOT_MEASURED)
BAND = 10.0  # [percentage points] within which a number counts as the paper's
CONSTANT = "Ixy"  # zero in every loading of our container

RULE = f"""A percentage is **{CONFIRMED}** if the same method is better, the whole interval is on its side, and our
number lies within {BAND:g} points of the paper's; **{DIRECTION}** if the number lies further off; **{UNDETERMINED}**
if the interval spans zero; **{NOT_CONFIRMED}** if the other method is better, or neither by {LEAST:g} %. It
**{DEPENDS}** a choice that the paper leaves open (the scaling, the stopping, the split, the stages, or the rival's
rate, derivative, tuning or calibration) if this one change alone turns it, both intervals being clear of zero (where
a cell has no errors for single payloads: both numbers). On Ixy it is **{NOT_COMPARABLE}**: Ixy is zero in every
loading of our container, so that a learner only has to learn a constant. A statement without a number is judged in
the same way by a criterion of ours, under both splits.

All intervals are of one kind: {100 * LEVEL:.0f} % of a bootstrap, over held-out payloads (Fig. 4 and 5) or over
real-like arms (Fig. 6 to 8), for one training (seed 0). Those of the percentages are widened by what the seeds 1 and 2
change where three were trained (networks of at most 60 epochs and trees, in SI units); those of the statements are
not, and what three trainings give stands beside them. They say what other payloads or arms would give, not what another
container, motion or simulator would."""


@cache
def load_claims() -> tuple[dict[str, Any], ...]:
    """Every claim: id, where, text, paper (percent or None), and what to compare.

    >>> len(load_claims()), sum(claim["printed"] for claim in load_claims() if claim["where"] != "Abstract")
    (86, 62)
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
    first: dict[tuple, str] = {}
    for claim in claims:
        same = claim["better"], claim["worse"], claim["parameter"]
        claim["repeats"] = first.get(same, "")
        first.setdefault(same, claim["id"])
    for statement in data["statements"]:
        claims.append({"paper": None, "parameter": None, "note": "", "printed": 0, "repeats": "", **statement})
    return tuple(claims)


def evaluate(cells: Cells) -> list[dict[str, Any]]:
    """What the cells say about every claim.

    A percentage of Fig. 4 and 5 is measured on the single samples of the test rows of the simulated data set, one of
    Fig. 7, the conclusion and the abstract on real-like arms holding the test payload: running mean of an ensemble at
    the end of the run against the mean of least squares over the second half. There the paper does not say which
    training it used: mass and first moments come from one stage, the inertia from two, as it found better.

    Returns:
        For each claim id, where, text, paper, ours (both in percent, or what `unit` says; None: not measured), low and
        high (its interval; None: a single unit), units, verdict, on (the choices it depends on); and parameter, unit,
        repeats (the claim it says again, or empty), held_out (ours with whole payloads held out), semi_real (ours on a
        real log with the payload's torque added, another motion), bearing, readings and reach (under how
        many of the readings that the text allows it holds, and the least and largest of their numbers; None for
        statements), note.
    """
    multiverse, many = Multiverse(cells), on_many_arms(cells)
    return [
        _statement(claim, many) if "rule" in claim else _percentage(claim, multiverse, cells) for claim in load_claims()
    ]


def _result(claim: dict[str, Any]) -> dict[str, Any]:
    kept = {key: claim[key] for key in ("id", "where", "text", "paper", "parameter", "repeats", "note")}
    nothing = dict.fromkeys(("ours", "low", "high", "units", "held_out", "semi_real", "reach", "bearing", "readings"))
    unit = RULES[claim["rule"]].unit if "rule" in claim else "%"
    return {**kept, **nothing, "unit": unit, "verdict": NOT_MEASURED, "on": []}


def _percentage(claim: dict[str, Any], multiverse: Multiverse, cells: Cells) -> dict[str, Any]:
    out, ours = _result(claim), multiverse.improvement(claim)
    payload = multiverse.improvement(claim, USUAL._replace(split="payload"))
    if ours is None or payload is None:
        return out
    found = [multiverse.log_ratio(claim, reading) for reading in multiverse.readings(claim)]
    there = [ratio for ratio in found if ratio is not None]
    turning = [name for name in AXES if _turns(claim, name, multiverse, ours)]
    return out | {
        "ours": round(ours.value, 2),
        "low": _rounded(ours.low),
        "high": _rounded(ours.high),
        "units": ours.units,
        "verdict": _verdict(claim, ours, turning),
        "on": turning if claim["parameter"] != CONSTANT else [],
        "held_out": round(payload.value, 2),
        "semi_real": _semi_real(claim, cells) if claim["on"] == "real" else None,
        "reach": [round(percent(max(there)), 2), round(percent(min(there)), 2)],
        "bearing": sum(percent(ratio) >= LEAST for ratio in there),
        "readings": len(there),
        "note": (claim["note"] + _EXACT * (claim["parameter"] == CONSTANT)).strip(),
    }


_EXACT = f" {CONSTANT} is 0 in every loading of our container: a learner only has to learn a constant."


def _turns(claim: dict[str, Any], axis: str, multiverse: Multiverse, ours: Improvement) -> bool:
    """Whether another value of one axis reverses a direction, both being clear."""
    field = AXES[axis][0]
    before = direction(ours)
    others = [value for value in multiverse.axes(claim).get(field, ()) if value != getattr(USUAL, field)]
    found = [multiverse.improvement(claim, USUAL._replace(**{field: value})) for value in others]
    return before is not None and any(o is not None and direction(o) is (not before) for o in found)


def direction(improvement: Improvement) -> bool | None:
    """Whether there is an improvement; None: the interval leaves it open. Below `LEAST` there is none.

    >>> [direction(Improvement(20.0, low, 30.0, 9)) for low in (5.0, -5.0)]
    [True, None]
    """
    if improvement.low is None or improvement.high is None:
        return improvement.value >= LEAST
    if improvement.low > 0.0:
        return improvement.value >= LEAST
    return False if improvement.high < LEAST else None


def _verdict(claim: dict[str, Any], ours: Improvement, turning: list[str]) -> str:
    there = direction(ours)
    if claim["parameter"] == CONSTANT:
        return NOT_COMPARABLE
    if there is None:
        return UNDETERMINED
    if turning:
        return DEPENDS
    if not there:
        return NOT_CONFIRMED
    return CONFIRMED if abs(ours.value - claim["paper"]) <= BAND else DIRECTION


def _statement(claim: dict[str, Any], cells: Cells) -> dict[str, Any]:
    out, rule = _result(claim), RULES[claim["rule"]]
    row, payload = (rule.measure(cells, claim.get("learner"), split) for split in SPLITS)
    if row is None or payload is None:
        return out
    turned = row.holds is not None and payload.holds is (not row.holds)
    verdict = UNDETERMINED if row.holds is None else DEPENDS if turned else CONFIRMED if row.holds else NOT_CONFIRMED
    low, high = row.bounds or (None, None)
    return out | {
        "ours": round(row.value, 2),
        "low": _rounded(low),
        "high": _rounded(high),
        "units": row.units,
        "verdict": NOT_COMPARABLE if claim.get("unknown") else verdict,
        "on": ["the split"] if turned and not claim.get("unknown") else [],
        "held_out": round(payload.value, 2),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


def _semi_real(claim: dict[str, Any], cells: Cells) -> float | None:
    """The same percentage on a real log with the payload's torque added."""
    column = NAMES.index(claim["parameter"])
    worse = at_end(benchmark(cells, claim["worse"]), SEMI_REAL)
    for match in matched(cells, Ensemble(claim["better"], 1 if column < 4 else 2)):
        better = at_end(match.cells[0], SEMI_REAL)
        if better is not None and worse is not None:
            return round(100.0 * (1.0 - float(better[:, column].mean() / worse[:, column].mean())), 2)
    return None
