"""An answer in words: mass, centre of mass and inertia about it, each ± half of its 95 % interval; and as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

from armload.inertia import NAMES, UNITS, decimals, vech

if TYPE_CHECKING:
    from armload.identification.answer import Identification

_LOPSIDED = 0.1  # of the half-width, between the value and the middle of its interval: beyond, both ends are shown


class Quantity(NamedTuple):
    """A number with its interval and unit, and what is to be said of it: "", "undetermined" or "rests on the prior"."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    mark: str


def quantities(result: Identification) -> dict[str, list[Quantity]]:
    """What is printed of an answer, by what it is; only the mass of what is not held."""
    marks = _marks(result)
    out = {"mass": [Quantity("", result.mass, result.phi_low[0], result.phi_high[0], "kg", marks[0])]}
    if not result.held:
        return out
    out["centre of mass"] = [
        Quantity(axis, 1e3 * value, 1e3 * low, 1e3 * high, "mm", mark or marks[0])
        for axis, value, low, high, mark in zip(
            "xyz", result.com, result.com_low, result.com_high, marks[1:4], strict=True
        )
    ]
    six = (vech(x) for x in (result.inertia_com, result.inertia_com_low, result.inertia_com_high))
    out["inertia about it"] = [
        Quantity(name, value, low, high, "kg·m²", mark)
        for name, value, low, high, mark in zip(NAMES[4:], *six, marks[4:], strict=True)
    ]
    return out


def ten(result: Identification) -> list[Quantity]:
    """The ten parameters about the frame's origin."""
    rows = zip(NAMES, result.phi, result.phi_low, result.phi_high, UNITS, _marks(result), strict=True)
    return [Quantity(*row) for row in rows]


def _marks(result: Identification) -> list[str]:
    """What is to be said of each of the ten parameters."""
    return [
        "undetermined" if not known else "rests on the prior" if leaning else ""
        for known, leaning in zip(result.determined, result.rests_on_prior, strict=True)
    ]


def shown(rows: Sequence[Quantity]) -> list[str]:
    """Value ± half-width, aligned, to two digits of the narrowest; both ends where the value is not in the middle.

    >>> shown([Quantity("", 1.4734, 1.428, 1.519, "kg", "")])
    ['1.473 ± 0.045']
    >>> shown([Quantity("", 0.1, -0.2, 0.5, "kg", "")])
    ['0.10 [-0.20, 0.50]']
    """
    halves = [0.5 * (row.high - row.low) for row in rows]
    digits = max(map(decimals, halves))
    signed = "+" if any(row.low < 0.0 for row in rows) and len(rows) > 1 else ""

    def number(x: float) -> str:
        return f"{round(x, digits) + 0.0:{signed}.{digits}f}"  # no -0.0

    values = [number(row.value) for row in rows]
    width, out = max(map(len, values)), []
    for row, half, value in zip(rows, halves, values, strict=True):
        lopsided = abs(row.value - 0.5 * (row.low + row.high)) > _LOPSIDED * half
        ends = f"[{number(row.low)}, {number(row.high)}]"
        out.append(f"{value:>{width}} {ends if lopsided else f'± {half:.{digits}f}'}")
    return out


def summary(result: Identification, everything: bool = False) -> str:
    """The answer in lines; `everything`: with the ten parameters about the frame's origin below."""
    lines = [f"{result.robot}: payload about {result.frame}, relative to the {result.relative_to}", ""]
    lines += _rows(quantities(result))
    if not result.consistent:
        lines.append("no body can have these parameters")
    if not result.held:
        lines.append(result.why_not_held)
    if everything:
        lines += ["", f"about the origin of {result.frame}:", *_rows({"": ten(result)})]
    return "\n".join([*lines, "", rests_on(result)])


def in_short(result: Identification) -> str:
    """The answer on one line."""
    (mass,) = shown(quantities(result)["mass"])
    held = "held" if result.held else "nothing held"
    return f"{result.robot}, {mass} kg about {result.frame}, {held}, {result.method}, {result.interval}"


def html(result: Identification) -> str:
    """The same as a small table for notebooks."""
    rows = []
    for title, part in quantities(result).items():
        for k, (row, value) in enumerate(zip(part, shown(part), strict=True)):
            cells = (title if k == 0 else "", row.name, value, row.unit, row.mark)
            rows.append(
                "<tr>" + "".join(f"<td style='text-align:left'>{escape(cell)}</td>" for cell in cells) + "</tr>"
            )
    below = [text for text in (result.why_not_held, rests_on(result), *result.notes) if text]
    title = f"{result.robot}: payload about {result.frame}, relative to the {result.relative_to}"
    return f"<table><caption style='text-align:left'>{escape(title)}</caption>{''.join(rows)}</table>" + "".join(
        f"<p>{escape(text)}</p>" for text in below
    )


def rests_on(result: Identification) -> str:
    """What ± means, the method, and how much of a log it saw."""
    why = f" ({result.why})" if result.why else ""
    scale = result.torque_gain_std
    how = "known" if result.gain_known else "assumed to be right"
    known = "" if scale is None else f" for a torque scale {how} to {100 * scale:.2g} %"
    if result.same_arm_assumed:
        known += f"{' and' if known else ' for'} a {_before(result)} of this very arm, which nothing here confirms"
    return (
        f"± is half of the 95 % interval, {result.interval}{known}; method {result.method}{why}, "
        f"{result.n_samples} samples, {result.duration:.2f} s"
    )


def _before(result: Identification) -> str:
    return result.relative_to if result.relative_to in ("tare", "profile") else "tare or profile"


def _rows(parts: dict[str, list[Quantity]]) -> list[str]:
    """Lines of all parts, their columns below each other."""
    cells = [
        (title if k == 0 else "", row.name, value, row.unit, row.mark)
        for title, part in parts.items()
        for k, (row, value) in enumerate(zip(part, _each(part), strict=True))
    ]
    widths = [max(len(cell[k]) for cell in cells) for k in range(3)]
    return [
        "  ".join([f"{cell[k]:<{widths[k]}}" for k in range(3) if widths[k]] + list(cell[3:])).rstrip()
        for cell in cells
    ]


def _each(part: list[Quantity]) -> list[str]:
    """Values of one unit share their decimals."""
    out: list[str] = []
    for unit in dict.fromkeys(row.unit for row in part):
        out += shown([row for row in part if row.unit == unit])
    return out
