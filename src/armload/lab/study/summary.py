"""The findings of the study in numbers, every number and every comparison computed from the cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES
from armload.lab.report.shown import GROUPS, short
from armload.lab.study.ablations import compared
from armload.lab.study.counterparts import RIVALS, SHOWN_ENSEMBLES
from armload.lab.study.numbers import (
    Answers,
    Cells,
    Ensemble,
    Match,
    at_end,
    at_first,
    benchmark,
    both_stages,
    cap,
    held_out,
    matched,
    mean_ratio,
)
from armload.lab.study.spec import NOMINAL, REAL
from armload.lab.study.study_tables import (
    COMMAND,
    LEARNERS,
    LEAST_SQUARES,
    PROTOCOLS,
    SPLITS,
    TRAINING_MEAN,
    capped,
    ensemble_shown,
    listing,
    mass_shown,
)
from armload.lab.study.training_mean import HIT, names_by_chance, ratio_elsewhere

_NOT_YET = f"not measured yet; `{COMMAND}` measures it."
_KINDS = ("tree", "network")


def paragraphs(cells: Cells) -> list[str]:
    """What the study found; a paragraph without its cells says so."""
    out = [f"**{_capital(LEARNERS[kind])} against least squares.** {_against(cells, kind)}" for kind in _KINDS]
    out.append("**How much is memorising.** " + _memorising(cells))
    out.append("**Accurate from the first time step.** " + _first_step(cells))
    out.append("**Against the same-prior least squares.** " + _same_prior(cells))
    out.append("**Without torque.** " + _without_torque(cells))
    out.append("**One stage or two.** " + _stages(cells))
    out.append("**SI units or standardised.** " + _scales(cells))
    return out


def _against(cells: Cells, kind: str) -> str:
    own = both_stages(cells, kind, "row", REAL)
    if own is None:
        return _capital(_NOT_YET)
    sentences = []
    for method in RIVALS:
        other = at_end(benchmark(cells, method), REAL)
        if other is not None:
            sentences.append(f"than {LEAST_SQUARES[method]} on {_named(own.errors.mean(axis=0) < other.mean(axis=0))}")
    if not sentences:
        return _capital(_NOT_YET)
    return (
        "Test payload on real-like arms, rows split at random, at the end of the run. "
        f"{_capital(_name(kind, own))} err less " + "; ".join(sentences) + "."
    )


def _named(which: NDArray[np.bool_]) -> str:
    """The parameters that are true; where most are, those that are not."""
    true, false = ([n for n, yes in zip(NAMES, which, strict=True) if yes == wanted] for wanted in (True, False))
    if not true or not false:
        return "all ten" if true else "none"
    return f"all but {listing(false)}" if len(false) < len(true) else f"{listing(true)} only"


def _memorising(cells: Cells) -> str:
    sentences = []
    for kind in _KINDS:
        found = matched(cells, Ensemble(kind, 1, "row"), Ensemble(kind, 1, "payload"))
        if not found:
            sentences.append(f"{_capital(LEARNERS[kind])}: {_NOT_YET}")
            continue
        row, payload = (held_out(group) for group in found[0].cells)
        ends = [at_end(found[0].cells[0], protocol) for protocol in (NOMINAL, "off_family", "other_motion")]
        if row is None or payload is None:
            continue
        ratios = [short(payload[:, p].mean() / max(row[:, p].mean(), 1e-30), 2) for p in GROUPS.values()]
        text = (
            f"{_capital(_name(kind, found[0]))}, single-stage: error of single samples with whole payloads held out "
            f"over that with rows held out: {_each(ratios)}"
        )
        if all(errors is not None for errors in ends):
            mass = [mass_shown(errors) for errors in ends if errors is not None]
            text += (
                f"; the mass error at the end of a run is {mass[0]} for the test payload, {mass[1]} for payloads "
                f"outside the container's family and {mass[2]} on motions they were not trained on"
            )
        sentences.append(text + ".")
    blind = [at_end(benchmark(cells, "training-mean", "row"), p) for p in (NOMINAL, "off_family")]
    mean = [mass_shown(errors) for errors in blind if errors is not None]
    if len(mean) == 2:
        sentences.append(f"The training mean errs by {mean[0]} on the test payload and by {mean[1]} on the others.")
    return " ".join(sentences)


def _first_step(cells: Cells) -> str:
    blind = at_first(benchmark(cells, "training-mean", "row"), REAL)
    first = {}
    for kind, scale in SHOWN_ENSEMBLES:
        own = both_stages(cells, kind, "row", REAL, scale, at_first)
        if own is not None:
            first[_name(kind, own, scale)] = own.errors
    if blind is None or not first:
        return _capital(_NOT_YET)
    text = (
        "Error of the first estimate on real-like arms divided by that of the training mean, which uses no "
        "measurement: geometric mean over the ten parameters, and by group. "
        + _capital("; ".join(f"{name}: {_over(errors, blind)}" for name, errors in first.items()))
        + "."
    )
    if hit := names_by_chance(blind):
        rest = [f"{name} {short(ratio_elsewhere(errors, blind), 2)}" for name, errors in first.items()]
        text += (
            f" The training mean happens to be within {100 * HIT:g} % of the truth on {listing(hit)}, which in the "
            "geometric mean counts against every method that uses measurements, and hardly within a group. Geometric "
            f"mean over the other parameters: {'; '.join(rest)}."
        )
    prior = benchmark(cells, "same-prior")
    begin, end = at_first(prior, REAL), at_end(prior, REAL)
    if begin is not None and end is not None:
        text += (
            f" For comparison {LEAST_SQUARES['same-prior']}, whose prior is the same payloads: "
            f"their first estimate, the prior, is at {_over(begin, blind)}; their last one at {_over(end, blind)}."
        )
    filtered = at_first(benchmark(cells, "rls-filter"), REAL)
    if filtered is not None:
        masses = [f"{name} {mass_shown(errors)}" for name, errors in first.items()]
        masses += [f"{LEAST_SQUARES['rls-filter']} {mass_shown(filtered)}", f"{TRAINING_MEAN} {mass_shown(blind)}"]
        text += f" Error of the mass from one sample: {'; '.join(masses)}."
    return text


def _over(errors: NDArray, reference: NDArray) -> str:
    """Errors (R, 10) over those of a reference: geometric mean over the parameters, and by group."""
    a, b = errors.mean(axis=0), reference.mean(axis=0)
    groups = _each([short(a[p].mean() / b[p].mean(), 2) for p in GROUPS.values()])
    return f"{short(mean_ratio(a, b), 2)} ({groups})"


def _each(ratios: Sequence[str]) -> str:
    return ", ".join(f"{group} {ratio}" for group, ratio in zip(GROUPS, ratios, strict=True))


def _same_prior(cells: Cells) -> str:
    sentences = []
    for kind, scale in SHOWN_ENSEMBLES:
        ratios, name = [], ensemble_shown(kind, scale)
        for protocol in (p for p in PROTOCOLS if p != "held_out"):
            own = both_stages(cells, kind, "row", protocol, scale)
            other = at_end(benchmark(cells, "same-prior"), protocol)
            if own is not None and other is not None:
                name = _name(kind, own, scale)
                ratio = mean_ratio(own.errors.mean(axis=0), other.mean(axis=0))
                ratios.append(f"{PROTOCOLS[protocol]} {short(ratio, 2)}")
        sentences.append(f"{_capital(name)}: " + ("; ".join(ratios) + "." if ratios else _NOT_YET))
    return (
        "Error of an ensemble divided by that of least squares with a Gaussian prior fitted to the training payloads, "
        "at the end of a run, geometric mean over the parameters (above 1: the ensemble is worse). "
        + " ".join(sentences)
    )


def _without_torque(cells: Cells) -> str:
    sentences = []
    for reference, cell in compared(cells, "torque"):
        a, b = held_out([reference]), held_out([cell])
        if a is not None and b is not None:
            ratios = [short(b[:, p].mean() / a[:, p].mean(), 2) for p in GROUPS.values()]
            name = ensemble_shown(cell["spec"]["kind"], cell["spec"]["scale"], most=cap(cell))
            sentences.append(
                f"{name}, {SPLITS[cell['spec']['split']]} held out: {_each(ratios)}, mass error {mass_shown(b)}"
            )
    if not sentences:
        return _capital(_NOT_YET)
    return (
        "Error of single samples of single-stage ensembles without the torque, divided by that of the same ensembles "
        "with it. "
        + _capital("; ".join(sentences))
        + ". The controller does not know the payload, so the joints sag under it by up to a few milliradians: in "
        "noise-free simulation position and velocity alone reveal the payload, the more the softer the controller is."
    )


def _stages(cells: Cells) -> str:
    sentences = []
    for kind, scale in SHOWN_ENSEMBLES:
        found = matched(cells, Ensemble(kind, 1, "row", scale), Ensemble(kind, 2, "row", scale))
        sentences.append(_ratios(found, f"{LEARNERS[kind]}, {_UNITS[scale]}"))
    return (
        "Error of two-stage divided by that of single-stage training on held-out rows. Ratios near 1 after scaling the "
        "outputs mean that the scale made the difference, not the stages. " + " ".join(sentences)
    )


_UNITS = {"raw": "in SI units", "standard": "standardised"}


def _scales(cells: Cells) -> str:
    sentences = []
    for kind in _KINDS:
        found = matched(cells, Ensemble(kind, 1, "row", "raw"), Ensemble(kind, 1, "row", "standard"))
        sentences.append(_ratios(found, LEARNERS[kind]))
    return (
        "The paper does not say how it scaled inputs and outputs; our main rows are in SI units. Error of standardised "
        "divided by that of SI training on held-out rows, single-stage, geometric mean within a group. "
        + " ".join(sentences)
    )


def _ratios(found: Sequence[Match], name: str) -> str:
    """The second ensemble's error over the first's by group, at the largest cap on epochs both have."""
    for match in found:
        errors = [held_out(group) for group in match.cells]
        a, b = (None if e is None else e.mean(axis=0) for e in errors)
        if a is not None and b is not None:
            ratios = [f"{mean_ratio(b[p], a[p]):.2f}" for p in GROUPS.values()]
            return f"{_capital(name + capped(match.cap))}: {_each(ratios)}."
    return f"{_capital(name)}: {_NOT_YET}"


def _name(kind: str, found: Answers | Match, scale: str = "raw") -> str:
    return ensemble_shown(kind, scale, most=found.cap)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
