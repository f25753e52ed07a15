"""The numbers of the page as HTML: estimate and intervals, events, state of the stream."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from armload.app.page.drawing import CHI2_95, com_region, has_com
from armload.app.page.status import Status, in_words
from armload.inertia import NAMES, UNITS, Z95, InertialParameters
from armload.online import OnlineEstimate
from armload.online.listening import UNUSED
from armload.recording import GAP
from armload.service.session_log import Entry
from armload.service.unknown import Unknown

_DIM = "color:var(--mantine-color-dimmed)"
_TEXT = "font-size:13px;line-height:1.45;font-variant-numeric:tabular-nums;padding:2px 8px"
_WARNING = ' style="color:var(--mantine-color-red-text)"'
_DECIMALS = (3, 4, 4, 4, 5, 5, 5, 5, 5, 5)


def headline(
    estimate: OnlineEstimate | None, truth: InertialParameters | None = None, misfit: str | None = None
) -> str:
    """Mass and centre of mass, large, and the state of the identification; grey where the samples are doubted.

    Args:
        misfit: a note that is shown elsewhere.
    """
    if estimate is None:
        return f'<div style="{_TEXT}" data-armload="state">waiting for the first sample</div>'
    mass = "—"
    if estimate.determined[0]:
        mass = f"{estimate.phi[0]:.3f} ± {Z95 * estimate.std[0]:.3f} kg"
    size = f"font-size:22px;{_DIM}" if _doubted(estimate, misfit) else "font-size:22px;font-weight:600"
    lines = [
        f'<div style="{size}" data-armload="mass">{mass}</div>',
        f'<div data-armload="com">{_com(estimate)}</div>',
        f'<div style="{_DIM}" data-armload="truth">{_truth(truth)}</div>' if truth is not None else "",
        f'<div data-armload="state">{escape(state_of(estimate, misfit))}</div>',
        f'<div style="{_DIM}">{escape(rests_on(estimate))}</div>',
    ]
    return f'<div style="{_TEXT}">{"".join(lines)}</div>'


def _doubted(estimate: OnlineEstimate, misfit: str | None) -> bool:
    """Whether the samples cannot come from this arm: such a doubt is among the answer's notes."""
    return misfit is not None and misfit in estimate.notes


def gone(status: Status) -> str:
    """In the place of the headline while the last answer says nothing of the present."""
    why = "" if status.why is None else status.why.text
    return (
        f'<div style="{_TEXT}"><div style="font-size:22px;font-weight:600" data-armload="mass">—</div>'
        f'<div data-armload="state"{_WARNING}>{escape(why)}</div></div>'
    )


def state_of(estimate: OnlineEstimate, misfit: str | None = None) -> str:
    """In a few words: whether anything is held, and what keeps it from being known better.

    Args:
        misfit: a note that is shown elsewhere.
    """
    if _doubted(estimate, misfit):
        words = ["not to be trusted: see below"]
    elif estimate.settling:
        words = ["the payload has just changed"]
    elif estimate.determined[0]:
        words = ["a payload is held" if estimate.held else "nothing is held"]
    else:
        unused = any(note.startswith(UNUSED) for note in estimate.notes)  # nobody knows whether it moves
        words = ["mass undetermined yet" if estimate.moving or unused else "mass undetermined: move the arm"]
    noted = any(note.startswith((UNUSED, "standing")) for note in estimate.notes)
    if estimate.determined[0] and not (estimate.moving or noted):
        words.append("the arm stands still")
    words += [n for n in estimate.notes if "moving" not in n and "has changed" not in n and n != misfit]
    return "; ".join(words)


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
        lines.append(f'<div data-armload="waits"><b>waits for</b> {escape(status.waits)}</div>')
    if status.misfit is not None:
        lines.append(f'<div data-armload="misfit"{_WARNING}><b>does not fit:</b> {escape(status.misfit)}</div>')
    ages = [] if status.age is None else [f"answer {in_words(status.age)} old"]
    ages += [status.why.text] if status.why is not None and status.why.reason is Unknown.SOURCE_ENDED else []
    ages += [] if status.tare is None else [f"tare {status.tare}"]
    lines.append(f'<div style="{_DIM}" data-armload="age">{escape("; ".join(ages))}</div>')
    return f'<div style="{_TEXT}">{"".join(lines)}</div>'


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
    """The ten parameters with intervals and units; what the stream does not determine is marked."""
    if estimate is None:
        return ""
    heads = [("", "left"), ("value", "right"), ("± 95 %", "right"), ("truth", "right"), ("unit", "left")]
    head = "".join(
        f'<th style="text-align:{side};font-weight:600;padding:0 4px">{text}</th>'
        for text, side in heads
        if truth is not None or text != "truth"
    )
    rows = []
    for k, name in enumerate(NAMES):
        known, digits, half = bool(estimate.determined[k]), _DECIMALS[k], Z95 * float(estimate.std[k])
        cells = [
            ("left", name),
            ("right", f"{estimate.phi[k]:+.{digits}f}"),
            ("right", f"{half:.{digits}f}" if known and np.isfinite(half) else "undetermined"),
            *([] if truth is None else [("right", f"{truth.phi[k]:+.{digits}f}")]),
            ("left", UNITS[k]),
        ]
        row = "".join(f'<td style="text-align:{side};padding:0 4px">{text}</td>' for side, text in cells)
        rows.append(f'<tr data-armload="phi{k}" style="{"" if known else _DIM}">{row}</tr>')
    return (
        f'<div style="{_TEXT};overflow-x:auto"><table style="width:100%;border-collapse:collapse;white-space:nowrap">'
        f"<tr>{head}</tr>{''.join(rows)}</table></div>"
    )


def events(log: Iterable[Entry], most: int = 6) -> str:
    """The last lines of the log, the newest first."""
    last = list(log)[-most:][::-1]
    if not last:
        return f'<div style="{_TEXT};{_DIM}" data-armload="log">nothing has happened yet</div>'
    lines = "".join(
        f'<div{_WARNING if entry.warning else ""}><span style="{_DIM}">{entry.t:.1f} s</span>&ensp;'
        f"{escape(entry.text if entry.event is None else entry.event.kind)}</div>"
        for entry in last
    )
    return f'<div style="{_TEXT}" data-armload="log">{lines}</div>'


def stream(name: str, estimate: OnlineEstimate | None, lost: int = 0) -> str:
    """Where samples come from, how many counted, why others were left out, and whether this machine keeps up."""
    if estimate is None:
        return f'<div style="{_TEXT};{_DIM}" data-armload="health">{escape(name)}</div>'
    text = f"{name}: t = {estimate.t:.1f} s, {estimate.health}"
    if estimate.lag >= GAP:
        text += f"; answered {estimate.lag:.1f} s after it arrived: this machine is too busy"
    if lost:
        text += f"; {lost} lost: this machine is too busy"
    return f'<div style="{_TEXT};{_DIM}" data-armload="health">{escape(text)}</div>'


def _com(estimate: OnlineEstimate) -> str:
    if estimate.determined[0] and not estimate.held:
        return f'<span style="{_DIM}">no centre of mass: nothing is held</span>'
    if not has_com(estimate):
        return f'<span style="{_DIM}">centre of mass undetermined</span>'
    r = 1000 * estimate.phi[1:4] / estimate.phi[0]
    half = 1000 * com_std(estimate) * Z95
    values = ", ".join(f"{x:+.1f}&#8239;±&#8239;{h:.1f}" for x, h in zip(r, half, strict=True))
    return f"centre of mass ({values}) mm"


def com_std(estimate: OnlineEstimate) -> np.ndarray:
    """Standard deviations (3,) of the centre of mass along the frame's axes [m], to first order."""
    region = com_region(estimate.phi, estimate.covariance)
    return np.sqrt(np.einsum("ij,j->i", region.axes**2, region.lengths**2) / CHI2_95)


def _truth(truth: InertialParameters) -> str:
    if truth.mass == 0.0:
        return "truth: nothing is held"
    r = ", ".join(f"{1000 * x:+.1f}" for x in truth.com)
    return f"truth: {truth.mass:.3f} kg, ({r}) mm"
