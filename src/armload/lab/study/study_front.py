"""The study's first page, read from top to bottom: conclusion, figures, claims, readings, rivals, protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.lab.report import Section
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, Table, short
from armload.lab.study.claims import BAND, CONFIRMED, CONSTANT, DEPENDS, NOT_COMPARABLE, RULE, load_claims
from armload.lab.study.conclusion import conclusion
from armload.lab.study.findings import SKLEARN, Nearness, distinct, in_band, nearness, tally, turned
from armload.lab.study.multiverse import USUAL, Multiverse, Reading
from armload.lab.study.numbers import Cells
from armload.lab.study.rivals import DERIVATIVES, RATES
from armload.lab.study.spec import REAL
from armload.lab.study.statements import RULES
from armload.lab.study.study_tables import COMMAND, MISSING, NOT_YET, listing
from armload.lab.study.trainings import by_training

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Claims = Sequence[Mapping[str, Any]]
CAPTIONS = {
    4: "Fig. 4, single-stage training: mean absolute error of single samples on held-out rows (above), and the ratio "
    "of the two ensembles' errors beside the paper's (below).",
    5: "Fig. 5, two-stage training: as Fig. 4. The paper gives no number for Izz.",
    6: "Fig. 6, the test payload in simulation (nominal arm) and on real-like arms, which stand for the real one. The "
    "paper gives no numbers.",
    7: "Fig. 7, ensembles and least squares with the test payload on real-like arms. Below: only what the paper names.",
    8: "Fig. 8, Izz over time in one run on a real-like arm. Dotted: 2.85 s, from when the paper calls its mean flat, "
    "and 3 s, from when [7] averages RLS. What overshoots more leaves the picture.",
}
RIVAL_NAMES = {
    "difference": "RLS, difference of velocities",
    "savgol": "RLS, Savitzky–Golay derivative",
    "butterworth": "RLS, Butterworth derivative",
    "filter": "filtered RLS",
}
_READINGS = """The paper's text leaves open how inputs and outputs are scaled, when the training of the networks stops,
how rows are split, with which training the experiment was made, and of its rivals the rate, the derivative, the
forgetting (as `tuned`) and the calibration. `holds under` in the claims' table counts every combination of what matters
to a claim. The first table changes one choice at a time: `turned` are the comparisons whose direction it reverses.
Learning rate, weight decay and the noise of the training's signals were not varied in full; the appendix has a sweep of
the learning rate, and trainings with noise."""
_NEAREST = """Which reading is nearest to all the paper's numbers at once? `off by` is the geometric mean, over all
percentages, of how many times our ratio of two errors is larger or smaller than the paper's."""
_RIVALS = """RLS need an acceleration. Its noise, and so the rate and the derivative, decides how large their error is:
it is a choice of the experiment, not a property of the method. `usual`: remembers everything, and the settings a reader
of [7] would take first. `tuned`: the setting that errs least on eight other arms with payloads of the training (see
`rivals.py`). `calibrated` as in [7]: minus the answer of the empty arm on the same motion. In simulation the empty run
repeats the arm's mismatch to the last detail, which is the best case for it. The paper's introduction says that its
benchmark uses "additional filters and calibration steps", and its Fig. 7 names RLS and RLS with the filter: whether
these are calibrated it does not say. Uncalibrated, the usual reading, is the kinder one to the paper. The ensembles
know as much: they were trained on these payloads and this motion."""
_PROTOCOL = """**Data.** The test payload's and the loadings' runs follow the paper: the arm, sinusoids in every joint,
77 loadings, 249 788 rows, 70 / 15 / 15 %. It says neither how many sinusoids nor how long a run lasts: eight over six
seconds are those of its reference [7], as far as that is public. The signals of the training have no noise, those of
the real-like arms the Panda's. Single samples of held-out rows measure Fig. 4 and 5; whole runs on real-like arms, with
the running mean of an ensemble and the mean of RLS over the second half, measure Fig. 6 to 8.

**Ensembles.** Five members, drawn with replacement; trees without limits; one hidden layer of 500 units. The usual
reading: SI units, at most 1000 epochs, stopped when ten epochs lower the validation loss by less than a ten-thousandth.

**Checks.** `python benchmarks/study_crosscheck.py` trains the trees with scikit-learn alone and puts its errors beside
the cells'. A test computes every verdict again from the cells by other code. Filtered RLS agree with an implementation
of [7] written anew from its formulas.

**Beyond the paper.** [Which claims travel](paper_travel.md) to another arm and to other payloads; [what a learner of
raw signals learns](learning.md), and what learners that are tied to no motion add to physics.

**No real Panda with a payload was measured.** `Real-like` arms are simulated arms that differ from their model as real
ones do. Read "real robot" in a claim as the paper's, "real-like" as ours."""


def front(
    cells: Cells, claims: Claims, figures: Mapping[int, Figure] | None = None, appendix: str = ""
) -> list[Section]:
    """The first page as sections.

    Args:
        cells: finished cells by name. claims: `evaluate(cells)`. figures: by the paper's number.
        appendix: the page with all other tables, as this one links to it.
    """
    multiverse, drawn = Multiverse(cells), figures or {}
    near = nearness(multiverse)
    turns = turned(multiverse)
    pictures = tuple((drawn[n], CAPTIONS[n]) for n in sorted(drawn))
    more = f"\n\nEverything else is in the [appendix]({appendix})." if appendix else ""
    return [
        Section("Conclusion", conclusion(cells, claims, turns, near)),
        Section("The figures", _FIGURES, (), pictures),
        Section("The claims", _claims_text(claims), (claims_table(claims), statements_table(claims, cells))),
        Section("The readings of the paper", _READINGS, (_turned_table(turns),)),
        Section("The nearest reading", _NEAREST, (_nearest_table(near),)),
        Section("Rivals that are not handicapped", _RIVALS + _on_arms(cells), (rivals_table(cells),)),
        Section("Protocol", f"{_PROTOCOL}\n\n{_time(cells)}{more}"),
    ]


_FIGURES = """In the paper's form, in our numbers. The public text of the paper has no errors, only by how many
percent one method errs less than another: these stand in the lower panels (diamonds) beside ours (dots, with 95 %
intervals over payloads or arms). Grey: where ours lies under all readings of the text."""


def _claims_text(claims: Claims) -> str:
    once = distinct(claims)
    repeats = [claim for claim in claims if claim["repeats"]]
    bands = ", ".join(f"{in_band(claims, band)} at {band:g}" for band in (5.0, BAND, 20.0))
    criteria = "\n".join(f"- `{name}`: {rule.criterion}." for name, rule in RULES.items())
    return (
        f"The paper gives {len(once) + len(repeats)} percentages; {len(repeats)} of them, in the abstract and the "
        f"conclusion, repeat others. Each is counted once. Of {len(once)}: {counted(once)}. With another band than "
        f"{BAND:g} points, {bands} points would be confirmed. Statements without a number: "
        f"{counted([c for c in claims if c['paper'] is None])}.\n\n{RULE}\n\n"
        f"The criteria of the statements are ours:\n\n{criteria}"
    )


def counted(claims: Claims) -> str:
    """A tally in words."""
    return listing([f"{count} {verdict}" for verdict, count in tally(claims).items()] or ["none"])


def claims_table(claims: Claims) -> Table:
    """Every percentage once."""
    rows = []
    for claim in distinct(claims):
        again = sum(other["repeats"] == claim["id"] for other in claims)
        payload, semi = (MISSING if claim[key] is None else _number(claim[key]) for key in ("held_out", "semi_real"))
        bearing = MISSING if not claim["readings"] else f"{claim['bearing']} of {claim['readings']}"
        rows.append(
            (
                claim["id"],
                claim["text"].partition(": ")[2] + (f" (said {again + 1} times)" if again else ""),
                f"{claim['paper']:g}",
                _with_interval(claim),
                payload,
                semi,
                bearing,
                verdict(claim),
            )
        )
    columns = ("claim", "what the paper says", "paper [%]", "ours [%]", "payloads held out [%]", "real log [%]")
    note = (
        "An improvement is 1 − error of the better method over that of the other; below zero it is the other way "
        f"round. Real log: another motion than the training's; it does not enter the verdict. {NOT_YET}"
    )
    return Table("Percentages", (*columns, "holds under", "verdict"), tuple(rows), note)


def statements_table(claims: Claims, cells: Cells) -> Table:
    """Statements without a number."""
    stated = {claim["id"]: claim for claim in load_claims() if claim["paper"] is None}
    rows = []
    for claim in (c for c in claims if c["paper"] is None):
        payload = MISSING if claim["held_out"] is None else _number(claim["held_out"])
        found = by_training(cells, stated[claim["id"]])
        seeds = f"{_number(min(found))} to {_number(max(found))}" if found else MISSING
        ours = (_with_interval(claim), claim["unit"], seeds, payload)
        rows.append((claim["id"], claim["text"], *ours, verdict(claim)))
    columns = ("claim", "what the paper says", "ours", "in", "three trainings", "payloads held out", "verdict")
    note = (
        "Three trainings: the least and the largest number of the seeds 0, 1 and 2, rows held out, on the arms that "
        "all three were measured on, networks with the cap that all three have; the interval is for one training. "
    )
    return Table("Statements without a number", columns, tuple(rows), note + NOT_YET)


def verdict(claim: Mapping[str, Any]) -> str:
    """A verdict as shown: with the choices it depends on."""
    return f"{DEPENDS} {listing(claim['on'])}" if claim["verdict"] == DEPENDS else str(claim["verdict"])


def _with_interval(claim: Mapping[str, Any]) -> str:
    if claim["ours"] is None:
        return MISSING
    bounds = "" if claim["low"] is None else f" [{_number(claim['low'])}, {_number(claim['high'])}]"
    return _number(claim["ours"]) + bounds


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}"


def _turned_table(turns: Sequence[Any]) -> Table:
    rows = tuple(
        (t.change, str(t.concerned), str(t.before), str(t.after), str(t.turned)) if t.concerned
        else (t.change, *[MISSING] * 4)
        for t in turns
    )  # fmt: skip
    columns = ("one change to the usual reading", "comparisons", "hold before", "hold after", "turned")
    note = f"Distinct percentages without those on {CONSTANT}; the number's sign alone, intervals left out. {NOT_YET}"
    return Table("What one choice turns", columns, rows, note)


def _nearest_table(near: Sequence[Nearness]) -> Table:
    if not near:
        return Table(
            "Readings by their distance to the paper", ("reading",), (), f"Not measured yet: `{COMMAND}` does."
        )
    by = {n.reading: n for n in near}
    most = max(near, key=lambda n: (n.borne, -n.factor))
    chosen = {"nearest": near[0], "most claims hold": most, "usual": by.get(USUAL), "farthest": near[-1]}
    chosen["usual, stopped as scikit-learn does"] = by.get(SKLEARN)
    rows = tuple(
        (name, shown(n.reading), f"{n.factor:.1f} times", f"{n.borne} of {n.measured}")
        for name, n in chosen.items()
        if n is not None
    )
    note = f"Of {len(near)} readings of the whole paper."
    return Table("Readings by their distance to the paper", ("", "reading", "off by", "hold"), rows, note)


def shown(reading: Reading) -> str:
    """A reading in words."""
    parts = [
        {"raw": "SI units", "standard": "standardised"}[reading.scale],
        f"networks ≤ {reading.stop} epochs",
        {"row": "rows split at random", "payload": "payloads held out"}[reading.split],
        ("mass and first moments from one stage, inertia from two", "one stage", "two stages")[reading.stages],
        f"rival at {reading.rate} Hz",
        RIVAL_NAMES[reading.derivative].partition(", ")[2],
        "tuned" if reading.tuned else "usual settings",
    ]
    return ", ".join([*parts, "calibrated" if reading.calibrated else "not calibrated"])


def rivals_table(cells: Cells) -> Table:
    """Mass, first moment and inertia of every rival with the Panda's noise, on real-like arms."""
    rows = []
    for derivative in (*DERIVATIVES, "filter"):
        for calibrated in (False, True):
            for rate in RATES:
                found = [_rival(cells, derivative, rate, calibrated, tuned) for tuned in (False, True)]
                errors = [MISSING if e is None else _mean(e, part) for e in found for part in GROUPS.values()]
                label = RIVAL_NAMES[derivative] + ", calibrated" * calibrated
                rows.append((label, str(rate), *errors))
    heads = [f"{g} [{SHOWN_UNITS[p][0]}]" for g, p in GROUPS.items()]
    columns = ("method", "rate [Hz]", *(f"{when}: {h}" for when in ("usual", "tuned") for h in heads))
    note = f"Mean over the real-like arms of the mean over the second half, with the Panda's sensor noise. {NOT_YET}"
    return Table("Errors of the rivals", columns, tuple(rows), note)


def _on_arms(cells: Cells) -> str:
    arms = {len(c["protocols"][REAL]["second_half"]) for c in cells.values() if c["spec"]["kind"] == "rival"}
    return f" All on the same {max(arms)} real-like arms." if arms else ""


def _rival(cells: Cells, derivative: str, rate: int, calibrated: bool, tuned: bool) -> np.ndarray | None:
    wanted = {"derivative": derivative, "rate": rate, "sensors": "panda", "calibrated": calibrated, "tuned": tuned}
    for cell in cells.values():
        spec = cell["spec"]
        if spec["kind"] == "rival" and wanted.items() <= spec.items():
            return np.array(cell["protocols"][REAL]["second_half"], dtype=float)
    return None


def _mean(errors: np.ndarray, part: slice) -> str:
    return short(SHOWN_SCALE * float(errors[:, part].mean()))


def _time(cells: Cells) -> str:
    if not cells:
        return f"Nothing is measured yet: `{COMMAND}` measures it."
    hours = sum(cell["wall_s"] for cell in cells.values()) / 3600.0
    return (
        f"**Time.** The {len(cells)} cells behind this page took {hours:.1f} h, added up, some of them on a machine "
        "that had other work to do; a run that was stopped goes on where it was. The page itself is written from the "
        "cells in seconds."
    )


__all__ = ["CONFIRMED", "NOT_COMPARABLE", "claims_table", "counted", "front", "rivals_table", "shown", "verdict"]
