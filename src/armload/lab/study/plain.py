"""The study for a reader who has not seen the code: short sentences, every number computed from the cells."""

from __future__ import annotations

from numpy.typing import NDArray

from armload.lab.evaluation import Table
from armload.lab.report.shown import short
from armload.lab.study.ablations import compared
from armload.lab.study.numbers import (
    Cells,
    Ensemble,
    at_end,
    at_first,
    benchmark,
    both_stages,
    held_out,
    matched,
    mean_ratio,
)
from armload.lab.study.spec import REAL
from armload.lab.study.study_tables import (
    COMMAND,
    LEARNERS,
    LEAST_SQUARES,
    MISSING,
    NOT_YET,
    TRAINING_MEAN,
    listing,
    mass_shown,
)
from armload.lab.study.training_mean import names_by_chance, ratio_elsewhere

_KINDS = ("tree", "network")
_RIVALS = ("rls", "rls-filter", "rls-filter-calibrated", "same-prior")
_EMPTY = f"Not measured yet; `{COMMAND}` measures it."
_INTRODUCTION = """The paper trains ensembles of decision trees and of neural networks. They read the payload from joint
position, velocity and torque. We trained the same ensembles on simulated data of the same form and compared them with
least squares. `Real-like` arms are simulated arms that differ from their model as real ones do. No real Panda with a
payload was measured."""
_AGAINST = """In the table below, a number under 1 means that the ensemble is better. `[7]` is the paper's benchmark.
`Same-prior least squares` know the mean and the covariance of the payloads that the ensembles were trained with. The
`training mean` is the mean of these payloads; it uses no measurement."""


def in_plain_words(cells: Cells) -> str:
    """What the study found, half a page; a part without its cells says that it is not measured."""
    parts = {
        "Against least squares": _AGAINST,
        "What the ensembles have learned": _learned(cells),
        "The first sample": _first(cells),
        "The role of the torque": _torque(cells),
    }
    return "\n\n".join([_INTRODUCTION, *(f"**{title}.** {text or _EMPTY}" for title, text in parts.items())])


def against_table(cells: Cells) -> Table:
    """The ensembles' error divided by that of least squares: one number for all ten parameters."""
    others = {m: at_end(benchmark(cells, m), REAL) for m in _RIVALS}
    others[TRAINING_MEAN] = at_end(benchmark(cells, "training-mean", "row"), REAL)
    rows, rest, blind = [], [], others[TRAINING_MEAN]
    for kind in _KINDS:
        own = both_stages(cells, kind, "row", REAL)
        if own is not None and blind is not None:
            rest.append(f"{short(ratio_elsewhere(own.errors, blind), 2)} for {LEARNERS[kind]}")
        ratios = (MISSING if own is None or e is None else _ratio(own.errors, e) for e in others.values())
        rows.append((LEARNERS[kind], *ratios))
    hit = [] if blind is None or not rest else names_by_chance(blind)
    chance = f"On {listing(hit)} the training mean is right by chance: without, {listing(rest)}. " if hit else ""
    return Table(
        "Error of an ensemble divided by the error of",
        ("ensemble", *(LEAST_SQUARES.get(m, m) for m in others)),
        tuple(rows),
        "Test payload on real-like arms, rows split at random, end of the run; geometric mean over the ten parameters. "
        + chance
        + NOT_YET,
    )


def _learned(cells: Cells) -> str:
    grown, moved = [], []
    for kind in _KINDS:
        for match in matched(cells, Ensemble(kind, 1, "row"), Ensemble(kind, 1, "payload"))[:1]:
            row, payload = (held_out(group) for group in match.cells)
            other = at_end(match.cells[0], "other_motion")
            if row is not None and payload is not None and other is not None:
                factor = short(payload[:, 0].mean() / max(row[:, 0].mean(), 1e-30), 2)
                grown.append(f"{factor} times as large for the {LEARNERS[kind]}")
                moved.append(f"{mass_shown(other)} for the {LEARNERS[kind]}")
    mean = at_end(benchmark(cells, "training-mean", "row"), "other_motion")
    if not grown:
        return ""
    text = (
        "The paper tests on rows of the same runs as the training rows. If whole payloads are kept out of the training "
        f"instead, the mass error of a single sample is {listing(grown)}. On motions that were not in the training it "
        f"is {listing(moved)} at the end of a run."
    )
    return text + (
        f" The {TRAINING_MEAN}, which uses no measurement, is off by {mass_shown(mean)}." if mean is not None else ""
    )


def _first(cells: Cells) -> str:
    found = {LEARNERS[kind]: both_stages(cells, kind, "row", REAL, read=at_first) for kind in _KINDS}
    errors = {name: answers.errors for name, answers in found.items() if answers is not None}
    blind = at_first(benchmark(cells, "training-mean", "row"), REAL)
    filtered = at_first(benchmark(cells, "rls-filter"), REAL)
    if blind is None or not errors:
        return ""
    masses = {**errors, **({} if filtered is None else {LEAST_SQUARES["rls-filter"]: filtered}), TRAINING_MEAN: blind}
    shown = [
        f"{mass_shown(e)} for {'the ' * (name != LEAST_SQUARES['rls-filter'])}{name}" for name, e in masses.items()
    ]
    ratios = [f"{_ratio(e, blind)} times (the {name})" for name, e in errors.items()]
    text = (
        f"After one sample on real-like arms the mass error is {listing(shown)}. Over all ten parameters the error is "
        f"{listing(ratios)} that of the {TRAINING_MEAN}."
    )
    if hit := names_by_chance(blind):
        rest = [f"{short(ratio_elsewhere(e, blind), 2)} times (the {name})" for name, e in errors.items()]
        text += f" On {listing(hit)} the {TRAINING_MEAN} is right by chance; over the others it is {listing(rest)}."
    return text


def _torque(cells: Cells) -> str:
    sentences = []
    for reference, cell in compared(cells, "torque"):
        seen, unseen = held_out([reference]), held_out([cell])
        if cell["spec"]["split"] == "row" and seen is not None and unseen is not None:
            without, with_torque = mass_shown(unseen), mass_shown(seen)
            sentences.append(
                f"On held-out rows {LEARNERS[cell['spec']['kind']]} have a mass error of {without} without the torque "
                f"and of {with_torque} with it."
            )
    if not sentences:
        return ""
    return (
        " ".join(sentences)
        + " Position and velocity alone contain information on the payload, because the simulated joints sag under it "
        "by up to a few milliradians."
    )


def _ratio(errors: NDArray, reference: NDArray) -> str:
    return short(mean_ratio(errors.mean(axis=0), reference.mean(axis=0)), 2)
