"""The numbers of the page as HTML: estimate and intervals, events, state of the stream."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from armload.app.page.drawing import CHI2_95, com_region, has_com
from armload.app.page.status import Status, in_words
from armload.app.page.style import BAD, GOOD, SOFT, TEXT, WAIT, WARNING, dot
from armload.inertia import NAMES, UNITS, Z95, InertialParameters
from armload.online import Event, OnlineEstimate
from armload.online.listening import UNUSED
from armload.recording import GAP
from armload.service.session_log import Entry
from armload.service.unknown import Unknown

_DECIMALS = (3, 4, 4, 4, 5, 5, 5, 5, 5, 5)
_LARGE = "font-size:22px"
_LINES = 4  # of the status: what is below it stays where it is while it says more or less
_PRIOR_LINES = 2  # below the table, kept for the same reason
# widths of the table's columns, so that none moves while a number becomes known: name, value, ± 95 %, truth, unit
_WIDTHS = ("3.1em", "auto", "5.2em", "auto", "3.7em")
_NARROW = 300  # [px] that the table needs; viser's narrowest panel leaves 302
# answers that are not of now, though they come: they are grey, with their age before them
_OLD = (Unknown.BEHIND, Unknown.UNUSABLE)


def headline(
    estimate: OnlineEstimate | None, truth: InertialParameters | None = None, status: Status | None = None
) -> str:
    """Mass, large, whether it can be taken as it is, and centre of mass; grey where it is doubted or of earlier.

    Args:
        status: how the answer is to be taken; None: as it is.
    """
    if estimate is None:
        words = "waiting for the first sample"
        return f'<div style="{TEXT}" data-armload="state" data-spoken="{words}">{dot(WAIT)}{words}</div>'
    why, misfit = (None, None) if status is None else (status.why, status.misfit)
    mass = "—"
    if estimate.determined[0]:
        mass = f"{_signed(estimate.phi[0], 3).removeprefix('+')} ± {Z95 * estimate.std[0]:.3f} kg"
    doubted = _doubted(estimate, misfit)
    remarks = _remarks(estimate, misfit)
    sure = (why is None or why.reason is Unknown.SOURCE_ENDED) and not any(
        not note.startswith("standing")  # a rest is no doubt
        for note in remarks
    )
    colour = BAD if doubted else GOOD if sure else WAIT
    state = state_of(estimate, misfit)
    told = state.partition(";")[0]  # without what comes and goes with each stop, and without numbers
    if why is not None and why.reason in _OLD:
        told = f"not of now: {told}"
    if why is not None and why.reason in _OLD and status is not None and status.age is not None:
        state = f"{in_words(status.age)} ago: {state}"
    elif why is not None and why.reason is Unknown.SOURCE_ENDED:
        state, told = (f"at the end of the source: {words}" for words in (state, told))
    old = doubted or (why is not None and why.reason in _OLD)
    size = f"{_LARGE};{SOFT}" if old else f"{_LARGE};font-weight:600"
    lines = [
        f'<div style="{size}" data-armload="mass">{mass}</div>',
        f'<div data-armload="state" data-spoken="{escape(told)}">'
        f'<span style="font-size:15px">{dot(colour)}{escape(state)}</span>'
        f"{'' if doubted else _lines(remarks)}</div>",
        f'<div style="{SOFT if old else ""}" data-armload="com">{_com(estimate, doubted)}</div>',
        f'<div style="{SOFT}" data-armload="truth">{_truth(truth)}</div>' if truth is not None else "",
        f'<div style="{SOFT}">{escape(rests_on(estimate))}</div>',
    ]
    return f'<div style="{TEXT}">{"".join(lines)}</div>'


def _doubted(estimate: OnlineEstimate, misfit: str | None) -> bool:
    """Whether the samples cannot come from this arm: such a doubt is among the answer's notes."""
    return misfit is not None and misfit in estimate.notes


def gone(status: Status) -> str:
    """In the place of the headline while the last answer says nothing of the present."""
    why, told = ("", "") if status.why is None else (status.why.text, f"no answer: {status.why.reason}")
    return (
        f'<div style="{TEXT}"><div style="{_LARGE};font-weight:600" data-armload="mass">—</div>'
        f'<div data-armload="state" data-spoken="{told}"{WARNING}>{dot(BAD)}{escape(why)}</div></div>'
    )


def _lines(sentences: Iterable[str]) -> str:
    return "".join(f"<div>{escape(sentence)}</div>" for sentence in sentences)


def state_of(estimate: OnlineEstimate, misfit: str | None = None) -> str:
    """In a few words: whether anything is held, or what keeps it from being known.

    Args:
        misfit: a note that is shown elsewhere.
    """
    if _doubted(estimate, misfit):
        return "not to be trusted: see below"
    if estimate.settling:
        words = ["the payload has just changed"]
    elif estimate.determined[0]:
        words = ["a payload is held" if estimate.held else "nothing is held"]
    else:
        unused = any(note.startswith(UNUSED) for note in estimate.notes)  # nobody knows whether it moves
        words = ["mass undetermined yet" if estimate.moving or unused else "mass undetermined: move the arm"]
    noted = any(note.startswith((UNUSED, "standing")) for note in estimate.notes)
    if estimate.determined[0] and not (estimate.moving or noted):
        words.append("the arm stands still")
    return "; ".join(words)


def _remarks(estimate: OnlineEstimate, misfit: str | None) -> list[str]:
    """Notes that nothing else on the page says."""
    return [n for n in estimate.notes if "moving" not in n and "has changed" not in n and n != misfit]


def status(estimate: OnlineEstimate | None, status: Status) -> str:
    """Probabilities, what is waited for and why, what does not fit, and how old answer and tare are."""
    lines = []
    if estimate is not None and not status.gone:
        probabilities = (("held", estimate.p_held), ("change", estimate.p_change), ("contact", estimate.p_contact))
        judged = [(what, p) for what, p in probabilities if p is not None and estimate.p_held > 0.0]  # 0.0: not yet
        if judged:
            words = "&ensp;".join(f"P({what}) {_probability(p)}" for what, p in judged)
            lines.append(f'<div data-armload="probabilities">{words}</div>')
    if status.waits is not None:
        said = f" ({status.why.text})" if status.gone and status.why is not None else ""  # in the headline's place
        lines.append(f'<div data-armload="waits"><b>waits for</b> {escape(status.waits.removesuffix(said))}</div>')
    if status.misfit is not None:
        lines.append(f'<div data-armload="misfit"{WARNING}><b>does not fit:</b> {escape(status.misfit)}</div>')
        if estimate is not None and _doubted(estimate, status.misfit):
            lines.append(_lines(_remarks(estimate, status.misfit)))
    ages = [] if status.age is None else [f"answer {in_words(status.age)} old"]
    ages += [status.why.text] if status.why is not None and status.why.reason is Unknown.SOURCE_ENDED else []
    ages += [] if status.tare is None else [f"tare {status.tare}"]
    lines.append(f'<div style="{SOFT}" data-armload="age">{escape("; ".join(ages))}</div>')
    return f'<div style="{TEXT};min-height:{1.45 * _LINES:g}em">{"".join(lines)}</div>'


def _probability(p: float) -> str:
    return "&gt;&#8239;0.99" if p > 0.99 else "&lt;&#8239;0.01" if p < 0.01 else f"{p:.2f}"


def rests_on(estimate: OnlineEstimate) -> str:
    """Method, kind of intervals, how long this payload has been seen, and what the answer is relative to."""
    relative = {"arm": "bare arm", "tare": "tare", "before": "empty arm before"}.get(
        estimate.relative_to, estimate.relative_to
    )
    kind = "calibrated" if estimate.calibrated else "approximate"
    seen = max(estimate.t - estimate.since, 0.0)
    return f"{estimate.method}, 95 % intervals {kind}, {seen:.0f} s of this payload, relative to the {relative}"


def parameters(estimate: OnlineEstimate | None, truth: InertialParameters | None = None) -> str:
    """The ten parameters with intervals and units; what the stream does not determine is marked.

    Below them are those whose interval comes more from the prior than from the samples.
    """
    if estimate is None:
        return ""
    heads = [("", "left"), ("value", "right"), ("± 95 %", "right"), ("truth", "right"), ("unit", "left")]
    head = "".join(
        f'<th scope="col" style="text-align:{side};font-weight:600;padding:0 4px;width:{width}">{text}</th>'
        for (text, side), width in zip(heads, _WIDTHS, strict=True)
        if truth is not None or text != "truth"
    )
    rows = []
    for k, name in enumerate(NAMES):
        known, digits, half = bool(estimate.determined[k]), _DECIMALS[k], Z95 * float(estimate.std[k])
        cells = [
            ("right", _signed(estimate.phi[k], digits)),
            ("right", f"{half:.{digits}f}" if known and np.isfinite(half) else "unknown"),
            *([] if truth is None else [("right", _signed(truth.phi[k], digits))]),
            ("left", UNITS[k]),
        ]
        row = "".join(f'<td style="text-align:{side};padding:0 4px">{text}</td>' for side, text in cells)
        head_of_row = f'<th scope="row" style="text-align:left;font-weight:400;padding:0 4px">{name}</th>'
        rows.append(f'<tr data-armload="phi{k}" style="{"" if known else SOFT}">{head_of_row}{row}</tr>')
    return (
        f'<div style="{TEXT};overflow-x:auto"><table style="width:100%;min-width:{_NARROW}px;table-layout:fixed;'
        f'border-collapse:collapse;white-space:nowrap"><tr>{head}</tr>{"".join(rows)}</table>'
        f'<div style="{SOFT};padding:0 4px;min-height:{1.45 * _PRIOR_LINES:g}em" data-armload="prior">'
        f"{_on_the_prior(estimate)}</div></div>"
    )


def _on_the_prior(estimate: OnlineEstimate) -> str:
    leaning = estimate.determined & estimate.rests_on_prior
    names = ", ".join(name for name, leans in zip(NAMES, leaning, strict=True) if leans)
    return f"more on the prior than on the samples: {names}" if names else ""


def _signed(value: float, digits: int) -> str:
    """With its sign, but for a zero: there it would only flicker."""
    text = f"{value:+.{digits}f}"
    return text if float(text) else text[1:]


def events(log: Iterable[Entry]) -> str:
    """The last six lines of the log, the newest first."""
    last = list(log)[:-7:-1]
    if not last:
        return f'<div style="{TEXT};{SOFT}" data-armload="log">nothing has happened yet</div>'
    lines = "".join(
        f'<div{WARNING if entry.warning else ""}><span style="{SOFT}">{entry.t:.1f} s</span>&ensp;'
        f"{escape(entry.text if entry.event is None else _event(entry.event))}</div>"
        for entry in last
    )
    return f'<div style="{TEXT}" data-armload="log">{lines}</div>'


def _event(event: Event) -> str:
    return event.kind + (f", {event.shown_mass}" if event.shown_mass else "")


def stream(name: str, estimate: OnlineEstimate | None, lost: int = 0, reason: Unknown | None = None) -> str:
    """Where samples come from, how many counted, why others were left out, and whether this machine keeps up now.

    Args:
        reason: why the answer is unknown, if it is.
    """
    if estimate is None:
        return f'<div style="{TEXT};{SOFT}" data-armload="health">{escape(name)}</div>'
    text = f"{name}: t = {estimate.t:.1f} s, {estimate.health}"
    if estimate.lag >= GAP:
        why = "functions are compiled, once" if reason is Unknown.COMPILING else "this machine is too busy"
        text += f"; {why}: answers come {estimate.lag:.1f} s after their samples"
    if lost:  # perhaps long ago
        text += f"; {lost} sample{'s were' if lost > 1 else ' was'} lost so far"
    return f'<div style="{TEXT};{SOFT}" data-armload="health">{escape(text)}</div>'


def _com(estimate: OnlineEstimate, doubted: bool) -> str:
    """Two lines, whatever is known: what is below stays where it is. A number keeps its place while it changes."""
    title = f'<div style="{SOFT}">centre of mass [mm] from {escape(estimate.frame)}</div>'
    if not has_com(estimate):
        nothing = estimate.determined[0] and not (estimate.held or doubted)
        return f'{title}<div style="{SOFT}">{"none: nothing is held" if nothing else "undetermined"}</div>'
    r = 1000 * estimate.phi[1:4] / estimate.phi[0]
    half = 1000 * com_std(estimate) * Z95
    parts = "".join(
        f'<span style="white-space:nowrap">{axis} {_signed(x, 1)}&#8239;±&#8239;{h:.1f}</span>'
        for axis, x, h in zip("xyz", r, half, strict=True)
    )
    return f'{title}<div style="display:grid;grid-template-columns:1fr 1fr 1fr">{parts}</div>'


def com_std(estimate: OnlineEstimate) -> np.ndarray:
    """Standard deviations (3,) of the centre of mass along the frame's axes [m], to first order."""
    region = com_region(estimate.phi, estimate.covariance)
    return np.sqrt(np.einsum("ij,j->i", region.axes**2, region.lengths**2) / CHI2_95)


def _truth(truth: InertialParameters) -> str:
    if truth.mass == 0.0:
        return "truth: nothing is held"
    r = ", ".join(_signed(1000 * x, 1) for x in truth.com)
    return f"truth: {truth.mass:.3f} kg, ({r}) mm"
