"""The study in plain words, every number and every comparison computed from the cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.evaluate.table import GROUPS, SHOWN_SCALE, SHOWN_UNITS, short
from armload.inertia import NAMES
from armload.study.claims import CONFIRMED, NOT_MEASURED, VERDICTS
from armload.study.counterparts import best_of_stages, curves
from armload.study.numbers import EXACT, Cells, Ensemble, at_end, benchmark, held_out, matched, mean_ratio
from armload.study.tables import COMMAND, LEARNERS, LEAST_SQUARES, NOMINAL, PROTOCOLS, REAL, within_spread

_NOT_YET = f"not measured yet; `{COMMAND}` measures it."
_SIZE = 10.0  # percentage points within which a number agrees with the paper's, too


def paragraphs(cells: Cells, claims: Sequence[dict[str, Any]]) -> list[str]:
    """What the study found; a paragraph without its cells says so."""
    out = [_tally(claims)]
    out += [f"**{_capital(LEARNERS[kind])} against least squares.** {_against(cells, kind)}" for kind in _KINDS]
    out.append("**How much is memorising.** " + _memorising(cells))
    out.append("**Accurate from the first time step.** " + _first_step(cells))
    out.append("**Against the same-prior least squares.** " + _same_prior(cells))
    out.append("**One stage or two.** " + _stages(cells))
    return out


_KINDS = ("tree", "network")


def _tally(claims: Sequence[dict[str, Any]]) -> str:
    numbered = [claim for claim in claims if claim["paper"] is not None]
    said = [claim for claim in claims if claim["paper"] is None]
    close = [c for c in numbered if c["verdict"] == CONFIRMED and abs(c["ours"] - c["paper"]) <= _SIZE]
    vague = [c for c in numbered if within_spread(c)]
    return (
        f"**The claims.** {len(numbered)} comparisons with a percentage: {_counts(numbered)}. Of the confirmed ones "
        f"{len(close)} are also within {_SIZE:g} percentage points of the paper's number; {len(vague)} of all measured "
        "ones are smaller than "
        f"their own spread over seeds or arms. {len(said)} statements without a number: "
        f"{_counts(said)}."
    )


def _counts(claims: Iterable[dict[str, Any]]) -> str:
    count = Counter(claim["verdict"] for claim in claims)
    words = {NOT_MEASURED: "not measured yet", **{v: v for v in VERDICTS if v != NOT_MEASURED}}
    return ", ".join(f"{count[v]} {words[v]}" for v in VERDICTS if count[v]) or "none"


def _against(cells: Cells, kind: str) -> str:
    own = best_of_stages(cells, kind, "row", REAL)
    if own is None:
        return _capital(_NOT_YET)
    sentences = []
    for method, name in LEAST_SQUARES.items():
        other = at_end(list(benchmark(cells, method).values()), REAL)
        if other is None:
            continue
        better = own.mean(axis=0) < other.mean(axis=0)
        sentences.append(f"{name}: better on {_named(better)}, not on {_named(~better)}")
    if not sentences:
        return _capital(_NOT_YET)
    return "Test payload on real-like arms, rows split at random, at the end of the run. " + "; ".join(sentences) + "."


def _named(which: NDArray[np.bool_]) -> str:
    return "all ten" if which.all() else ", ".join(n for n, yes in zip(NAMES, which, strict=True) if yes) or "none"


def _memorising(cells: Cells) -> str:
    sentences = []
    for kind in _KINDS:
        found = matched(cells, Ensemble(kind, 1, "row"), Ensemble(kind, 1, "payload"))
        if not found:
            sentences.append(f"{_capital(LEARNERS[kind])}: {_NOT_YET}")
            continue
        row, payload = (held_out(group) for group in found[0].cells)
        off = at_end(found[0].cells[0], "off_family")
        other = at_end(found[0].cells[0], "other_motion")
        nominal = at_end(found[0].cells[0], NOMINAL)
        if row is None or payload is None:
            continue
        ratios = [
            f"{_times(payload[:, p].mean() / row[:, p].mean())} for the {g}"
            for g, p in GROUPS.items()
            if row[:, p].mean() > 0
        ]
        text = (
            f"{_capital(LEARNERS[kind])}, single-stage: with whole payloads held out instead of rows the error of "
            f"single samples is {_listed(ratios)}"
        )
        if off is not None and other is not None and nominal is not None:
            text += (
                f"; the mass error at the end of a run is {_shown(nominal[:, 0].mean(), 0)} for the test payload, "
                f"{_shown(off[:, 0].mean(), 0)} for payloads outside the container's family and "
                f"{_shown(other[:, 0].mean(), 0)} on motions it was not trained on"
            )
        sentences.append(text + ".")
    return " ".join(sentences)


def _first_step(cells: Cells) -> str:
    shown = curves(cells)
    if not {LEARNERS["tree"], LEARNERS["network"]} & set(shown):
        return _capital(_NOT_YET)
    parts = []
    for name, curve in shown.items():
        first, end = abs(float(curve["single_error"][0])), abs(float(curve["running_error"][-1]))
        parts.append(f"{name} {_shown(first, 9)}, at the end {_shown(end, 9)}")
    text = "Error of the first estimate of Izz in one run on a real-like arm: " + "; ".join(parts) + "."
    prior = shown.get(LEAST_SQUARES["same-prior"])
    if prior is not None:
        theirs = max(abs(float(prior["single_error"][0])), EXACT)
        own = [(LEARNERS[k], shown[LEARNERS[k]]) for k in _KINDS if LEARNERS[k] in shown]
        ratios = [f"{_times(abs(float(curve['single_error'][0])) / theirs)} for {name}" for name, curve in own]
        text += (
            " What being early is worth beside least squares that are told the same payloads: the error of the first "
            f"estimate is {_listed(ratios)} (theirs: 1)."
        )
    return text


def _same_prior(cells: Cells) -> str:
    sentences = []
    for kind in _KINDS:
        ratios = []
        for protocol in (p for p in PROTOCOLS if p != "held_out"):
            own = best_of_stages(cells, kind, "row", protocol)
            other = at_end(list(benchmark(cells, "same-prior").values()), protocol)
            if own is not None and other is not None:
                ratios.append(f"{PROTOCOLS[protocol]} {short(mean_ratio(own.mean(axis=0), other.mean(axis=0)), 2)}")
        sentences.append(
            f"{_capital(LEARNERS[kind])}: " + ("; ".join(ratios) + "." if ratios else f"{_NOT_YET}"),
        )
    return (
        "Error of an ensemble over that of the least squares that are told the training payloads as a Gaussian prior, "
        "at the end of a run, geometric mean over the parameters (above 1: the ensemble is worse). "
        + " ".join(sentences)
    )


def _stages(cells: Cells) -> str:
    sentences = []
    for kind in _KINDS:
        for scale, named in (("raw", "in SI units"), ("standard", "standardised")):
            found = matched(cells, Ensemble(kind, 1, "row", scale), Ensemble(kind, 2, "row", scale))
            errors = [held_out(group) for group in found[0].cells] if found else []
            kept = [e.mean(axis=0) for e in errors if e is not None]
            if len(kept) < 2:
                sentences.append(f"{_capital(LEARNERS[kind])}, {named}: {_NOT_YET}")
                continue
            ratios = [f"{mean_ratio(kept[1][p], kept[0][p]):.2f} for the {g}" for g, p in GROUPS.items()]
            sentences.append(f"{_capital(LEARNERS[kind])}, {named}: {_listed(ratios)}.")
    return (
        "Error of two-stage over single-stage training on held-out rows; if scaling the outputs brings the ratios to "
        "1, it was the scale, not the stages. " + " ".join(sentences)
    )


def _shown(error: float, parameter: int) -> str:
    return f"{short(SHOWN_SCALE * float(error))} {SHOWN_UNITS[parameter]}"


def _times(ratio: float) -> str:
    return f"{short(float(ratio), 2)} times"


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
