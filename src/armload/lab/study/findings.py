"""What follows from the claims taken together: the tally, what turns them, the reading nearest to the paper, more."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from armload.inertia import NAMES
from armload.lab.study.claims import BAND, CONFIRMED, CONSTANT, DIRECTION, VERDICTS, load_claims
from armload.lab.study.multiverse import AXES, USUAL, Improvement, Multiverse, Reading, percent
from armload.lab.study.numbers import LEAST

Claims = Sequence[Mapping[str, Any]]
SKLEARN = USUAL._replace(stop=AXES["the stopping"][1][-1])  # networks that stop where scikit-learn's do by default
CHANGES: dict[str, Reading] = {  # one choice of `USUAL` changed at a time
    "inputs and outputs standardised": USUAL._replace(scale="standard"),
    "networks of at most 60 epochs, three seeds": USUAL._replace(stop=AXES["the stopping"][1][1]),
    "networks of 14 epochs, as scikit-learn stops": SKLEARN,
    "whole payloads held out": USUAL._replace(split="payload"),
    "all ten parameters from one stage": USUAL._replace(stages=1),
    "all ten parameters from two stages": USUAL._replace(stages=2),
    "rival at 1 kHz": USUAL._replace(rate=1000),
    "rival with a Savitzky–Golay derivative": USUAL._replace(derivative="savgol"),
    "rival with a Butterworth derivative": USUAL._replace(derivative="butterworth"),
    "rival tuned on other runs": USUAL._replace(tuned=True),
    "rival calibrated as in [7]": USUAL._replace(calibrated=True),
}


def distinct(claims: Claims) -> list[Mapping[str, Any]]:
    """The percentages, each once."""
    return [claim for claim in claims if claim["paper"] is not None and not claim["repeats"]]


def tally(claims: Iterable[Mapping[str, Any]]) -> Counter[str]:
    """How many claims have each verdict, in the order of `VERDICTS`."""
    count = Counter(claim["verdict"] for claim in claims)
    return Counter({verdict: count[verdict] for verdict in VERDICTS if count[verdict]})


def in_band(claims: Claims, band: float) -> int:
    """How many distinct percentages would be confirmed if a number within `band` points counted as the paper's."""
    held = [claim for claim in distinct(claims) if claim["verdict"] in (CONFIRMED, DIRECTION)]
    return sum(abs(claim["ours"] - claim["paper"]) <= band for claim in held)


def compared_claims() -> list[dict[str, Any]]:
    """The distinct percentages that can be compared: without those on the constant parameter."""
    found = (claim for claim in load_claims() if claim["paper"] is not None and not claim["repeats"])
    return [claim for claim in found if claim["parameter"] != CONSTANT]


class Turned(NamedTuple):
    """One change of the usual reading: how many comparisons it concerns, how many of these hold before and after it,
    and how many directions it turns."""

    change: str
    concerned: int
    before: int
    after: int
    turned: int


def turned(multiverse: Multiverse) -> list[Turned]:
    """What each of `CHANGES` does to the distinct percentages."""
    out = []
    for change, reading in CHANGES.items():
        pairs = []
        for claim in compared_claims():
            if any(getattr(reading, field) != getattr(USUAL, field) for field in multiverse.axes(claim)):
                both = [multiverse.log_ratio(claim, at) for at in (USUAL, reading)]
                if both[0] is not None and both[1] is not None:
                    pairs.append([holds(ratio) for ratio in both if ratio is not None])
        before, after = (sum(pair[k] for pair in pairs) for k in (0, 1))
        out.append(Turned(change, len(pairs), before, after, sum(a != b for a, b in pairs)))
    return out


def holds(log_ratio: float) -> bool:
    """Whether the method that the paper calls better errs less, by `LEAST` percent at least."""
    return bool(percent(log_ratio) >= LEAST)


class Nearness(NamedTuple):
    """How near a reading is to the paper: `factor` is the geometric mean, over the percentages that are measured, of
    how many times our ratio of errors is larger or smaller than the paper's; `borne` of `measured` hold."""

    reading: Reading
    factor: float
    borne: int
    measured: int


def nearness(multiverse: Multiverse) -> list[Nearness]:
    """Every reading of the whole paper, the nearest to all its numbers at once first."""
    claims = compared_claims()
    axes = [multiverse.axes(claim) for claim in claims]

    @cache
    def at(k: int, reading: Reading) -> float | None:
        return multiverse.log_ratio(claims[k], reading)

    options = {field: values for field, values in AXES.values()} | {"stages": (0, 1, 2)}
    out = []
    for values in product(*options.values()):
        reading = USUAL._replace(**dict(zip(options, values, strict=True)))
        found = []
        for k, claim in enumerate(claims):
            only = USUAL._replace(**{field: getattr(reading, field) for field in axes[k]})
            if (ratio := at(k, only)) is not None:
                found.append((ratio, np.log(1.0 - claim["paper"] / 100.0)))
        if len(found) == len(claims):
            away = np.mean([abs(ours - paper) for ours, paper in found])
            out.append(Nearness(reading, float(np.exp(away)), sum(holds(ours) for ours, _ in found), len(found)))
    return sorted(out, key=lambda n: n.factor)


class Implied(NamedTuple):
    """A ratio of two errors that follows from two percentages of Fig. 7."""

    ratio: str
    parameter: str
    paper: float
    ours: float


def implied_ratios(multiverse: Multiverse) -> list[Implied]:
    """Ratios between methods that the paper does not compare, from percentages that share their third one.

    Filtered over plain RLS, by the networks' and by the trees' percentages, and trees over networks, by those on RLS
    and on filtered RLS.
    """
    by = {(c["better"], c["worse"], c["parameter"]): c for c in compared_claims() if c["on"] == "real"}

    def left(claim: Mapping[str, Any]) -> float:
        return 1.0 - claim["paper"] / 100.0

    def ours(claim: Mapping[str, Any]) -> float:
        ratio = multiverse.log_ratio(claim, USUAL)
        return float("nan") if ratio is None else float(np.exp(ratio))

    wanted = [
        ("filtered RLS over RLS, by the networks", ("network", "rls"), ("network", "rls-filter")),
        ("filtered RLS over RLS, by the trees", ("tree", "rls"), ("tree", "rls-filter")),
        ("trees over networks, by RLS", ("tree", "rls"), ("network", "rls")),
        ("trees over networks, by filtered RLS", ("tree", "rls-filter"), ("network", "rls-filter")),
    ]
    out = []
    for name, first, second in wanted:
        for parameter in NAMES:
            a, b = by.get((*first, parameter)), by.get((*second, parameter))
            if a is not None and b is not None:
                out.append(Implied(name, parameter, left(a) / left(b), ours(a) / ours(b)))
    return out


class Win(NamedTuple):
    """A parameter on which the paper names no improvement over a rival, which so is no worse there."""

    learner: str
    rival: str
    parameter: str
    ours: Improvement | None


def baseline_wins(multiverse: Multiverse) -> list[Win]:
    """Where the paper's Fig. 7 leaves the rival ahead, and by how much the ensemble is better (negative: worse)."""
    named = {(c["better"], c["worse"], c["parameter"]) for c in load_claims() if c.get("on") == "real"}
    out = []
    for learner, rival, parameter in product(("network", "tree"), ("rls", "rls-filter"), NAMES):
        if (learner, rival, parameter) not in named and parameter != CONSTANT:
            claim = {"better": learner, "worse": rival, "parameter": parameter, "on": "real"}
            out.append(Win(learner, rival, parameter, multiverse.improvement(claim)))
    return out


__all__ = [
    "BAND",
    "CHANGES",
    "SKLEARN",
    "baseline_wins",
    "compared_claims",
    "distinct",
    "implied_ratios",
    "in_band",
    "nearness",
    "tally",
    "turned",
]
