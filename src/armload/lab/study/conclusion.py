"""The conclusion of the study in plain words, every number and every comparison in it computed from the cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from armload.lab.study.claims import CONFIRMED, DEPENDS, DIRECTION, NOT_CONFIRMED, NOT_MEASURED, UNDETERMINED
from armload.lab.study.findings import Nearness, Turned, distinct, tally
from armload.lab.study.numbers import Cells, Ensemble, at_end, benchmark, both_stages, held_out, matched, on_many_arms
from armload.lab.study.spec import REAL
from armload.lab.study.study_tables import COMMAND, LEARNERS, listing, mass_shown
from armload.lab.study.training_mean import first_elsewhere

Claims = Sequence[Mapping[str, Any]]
_FIG45 = "Section V,"  # where a percentage of Fig. 4 and 5 stands


def conclusion(cells: Cells, claims: Claims, turns: Sequence[Turned], near: Sequence[Nearness]) -> str:
    """What of the paper stands, what does not, what decides it, and what to do instead."""
    if any(claim["verdict"] == NOT_MEASURED for claim in claims):
        return f"Not measured yet in full; `{COMMAND}` measures what is missing."
    parts = {
        "In short": _in_short(claims, turns),
        "What stands": _stands(claims),
        "What does not": _falls(claims) + _by_chance(on_many_arms(cells), claims),
        "What decides it": _decides(claims, turns, near),
        "What to do instead": _instead(on_many_arms(cells)),
    }
    return "\n\n".join(f"**{title}.** {text}" for title, text in parts.items())


def _in_short(claims: Claims, turns: Sequence[Turned]) -> str:
    """The answer in two sentences."""
    once, by = distinct(claims), {t.change: t for t in turns}
    firm = sum(claim["verdict"] in (CONFIRMED, DIRECTION) for claim in once)
    text = (
        f"{firm} of the paper's {len(once)} percentages point its way here, and no single change of a choice that it "
        "leaves open clearly turns them"
    )
    conditions = {
        "whole payloads held out": ("on payloads that were not trained on", "on the paper's own split"),
        "rival calibrated as in [7]": ("beside least squares calibrated as in its reference [7]", "uncalibrated"),
    }
    shown = [
        f"{by[c].after} of {by[c].concerned} {new} ({by[c].before} {usual})"
        for c, (new, usual) in conditions.items()
        if by[c].concerned
    ]
    return f"{text}. By their sign alone, {listing(shown)} do." if shown else f"{text}."


def _stands(claims: Claims) -> str:
    once = distinct(claims)
    count, stated = tally(once), tally(claim for claim in claims if claim["paper"] is None)
    good = [claim for claim in once if claim["verdict"] in (CONFIRMED, DIRECTION)]
    return (
        f"Of {len(once)} distinct percentages, {count[CONFIRMED]} are confirmed in direction and size and "
        f"{count[DIRECTION]} in direction only: {_by_group(good)}. Of {stated.total()} statements without a number, "
        f"{stated[CONFIRMED]} are confirmed: {_texts(claims, CONFIRMED)}."
    )


def _falls(claims: Claims) -> str:
    once = distinct(claims)
    count = tally(once)
    bad = [claim for claim in once if claim["verdict"] == NOT_CONFIRMED]
    return (
        f"{count[NOT_CONFIRMED]} percentages are not confirmed: {_by_group(bad)}. {count[UNDETERMINED]} are "
        f"undetermined: our interval spans zero. Not confirmed are also these statements: "
        f"{_texts(claims, NOT_CONFIRMED)}."
    )


def _by_chance(cells: Cells, claims: Claims) -> str:
    """What of "accurate from the first time step" hangs on parameters that the training mean hits by chance."""
    refused = {c["id"] for c in claims if c["verdict"] == NOT_CONFIRMED}
    text = ""
    for kind, name in LEARNERS.items():
        found = first_elsewhere(cells, kind) if f"first-step-{kind}" in refused else None
        if found is not None and found[1] < 1.0:
            hit, rest, izz = found
            less = f"{abs(100.0 * (1.0 - izz)):.0f} % {'less' if izz < 1.0 else 'more'}"
            text += (
                f" The first of these hangs, for {name}, on {listing(hit)}, where the training mean is right by "
                f"chance: over the other parameters the first estimate errs {100.0 * (1.0 - rest):.0f} % less than "
                f"that mean, on Izz, which Fig. 8 shows, {less}."
            )
    return text


def _decides(claims: Claims, turns: Sequence[Turned], near: Sequence[Nearness]) -> str:
    once = distinct(claims)
    on = Counter(choice for claim in once if claim["verdict"] == DEPENDS for choice in claim["on"])
    most = sorted((t for t in turns if t.turned), key=lambda t: t.turned / t.concerned, reverse=True)[:3]
    listed = listing([f"{choice} ({count})" for choice, count in on.most_common()] or ["no choice"])
    text = (
        f"{tally(once)[DEPENDS]} percentages depend on a choice that the text leaves open: {listed}. Largest single "
        f"changes: {listing([f'{t.change} turns {t.turned} of {t.concerned} comparisons' for t in most] or ['none'])}."
    )
    if near:
        text += (
            " No reading comes near all numbers: in the nearest one our ratios of errors are still off by "
            f"{near[0].factor:.1f} times (geometric mean), and {near[0].borne} of {near[0].measured} comparisons "
            f"hold; in the farthest by {near[-1].factor:.0f} times, with {near[-1].borne}."
        )
    return text


def _instead(cells: Cells) -> str:
    shown = []
    for kind, name in LEARNERS.items():
        own = both_stages(cells, kind, "row", REAL) if kind != "mixed" else None
        if own is not None:
            shown.append(f"{mass_shown(own.errors)} for {name}")
    rivals = {
        "RLS as benchmarked": "rival-difference-540-panda",
        "the same with a Savitzky–Golay derivative": "rival-savgol-540-panda",
        "that calibrated along the same motion (in simulation the best case)": "rival-savgol-540-panda-calibrated",
        "filtered RLS calibrated as in [7]": "rival-filter-540-panda-calibrated",
    }
    for name, cell in rivals.items():
        if (errors := at_end([cells[cell]] if cell in cells else [], REAL)) is not None:
            shown.append(f"{mass_shown(errors)} for {name}")
    for name, method in {
        "same-prior least squares": "same-prior",
        "armload's default, without a tare": "hybrid",
    }.items():
        if (errors := at_end(benchmark(cells, method), REAL)) is not None:
            shown.append(f"{mass_shown(errors)} for {name} (on {len(errors)} of the arms)")
    ratio = []
    for kind in ("tree", "network"):
        for match in matched(cells, Ensemble(kind, 1, "row"), Ensemble(kind, 1, "payload"))[:1]:
            row, payload = (held_out(group) for group in match.cells)
            if row is not None and payload is not None:
                ratio.append(f"{payload[:, 0].mean() / row[:, 0].mean():.1f} for {LEARNERS[kind]}")
    return (
        f"Use the physics. Error of the mass at the end of a run on real-like arms: {listing(shown)}. The ensembles "
        "know one arm, one motion and one family of payloads; least squares need none of these, and a smoothed "
        "derivative or a run of the empty arm costs less than a training. Test a learner on payloads it has not seen: "
        f"from rows to payloads held out the error of the mass is multiplied by {listing(ratio)}. And say how the "
        "rival differentiates, and at which rate."
    )


def _by_group(claims: Claims) -> str:
    groups = {
        "trees against networks": lambda c: {"tree", "network"} <= _kinds(c),
        "one stage against two": lambda c: c["id"].startswith("stages"),
        "networks against least squares": lambda c: c["id"].startswith("fig7-network"),
        "trees against least squares": lambda c: c["id"].startswith("fig7-tree"),
    }
    count = {name: sum(bool(belongs(claim)) for claim in claims) for name, belongs in groups.items()}
    return listing([f"{number} of {name}" for name, number in count.items() if number] or ["none"])


def _kinds(claim: Mapping[str, Any]) -> set[str]:
    return set(claim["id"].split("-")) if claim["where"].startswith(_FIG45) and "fig" in claim["id"] else set()


def _texts(claims: Claims, verdict: str) -> str:
    """Statements of a verdict; what is said of trees and of networks alike stands once."""
    said: dict[str, list[str]] = {}
    for claim in claims:
        if claim["paper"] is None and claim["verdict"] == verdict:
            of, _, what = claim["text"].rpartition(": ")
            said.setdefault(what, []).extend([of] if of else [])
    return "; ".join(f'"{what}"' + f" ({' and '.join(of)})" * bool(of) for what, of in said.items()) or "none"
