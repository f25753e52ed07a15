"""What was found, first: the answer of `identify` as a section, beside the truth where that is known."""

from __future__ import annotations

from armload.identification import Identification
from armload.identification.text import quantities, rests_on, shown, ten
from armload.inertia import InertialParameters, vech
from armload.lab.report.html import Section
from armload.lab.report.shown import Table


def answer_section(result: Identification, truth: InertialParameters | None = None) -> Section:
    """Mass, centre of mass and the inertia about it with their 95 % intervals, what it rests on, and the notes.

    Args:
        result: the answer. truth: what is held, about the same frame; None: not known.
    """
    parts = quantities(result)
    known: dict[str, list[float]] = {}
    if truth is not None:
        known["mass"] = [truth.mass]
        if truth.mass > 0.0:
            known["centre of mass"] = (1e3 * truth.com).tolist()
            known["inertia about it"] = vech(truth.inertia_com).tolist()
    rows, digits = [], {"kg": 4, "mm": 1, "kg·m²": 5}
    for name, part in parts.items():
        values = known.get(name, [None] * len(part))
        for row, value, true in zip(part, shown(part), values, strict=True):
            what = f"{name} {row.name}".strip()
            true_value = () if truth is None else ("" if true is None else f"{true:+.{digits[row.unit]}f}",)
            rows.append((what, value, *true_value, row.unit, row.mark))
    columns = ("quantity", "value", *(() if truth is None else ("truth",)), "unit", "")
    mass = shown(ten(result)[:1])[0]
    holding = f"**{mass} kg**" if result.held else f"{mass} kg: {result.why_not_held}"
    text = f"{result.robot} holds {holding}, about {result.frame}, relative to the {result.relative_to}."
    if result.notes:
        text += "\n\n" + "\n\n".join(note[:1].upper() + note[1:] + "." for note in result.notes)
    return Section("What was found", text, (Table("The answer", columns, tuple(rows), rests_on(result)),))
