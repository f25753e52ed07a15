"""One row for each payload that was carried, and one for each log that cannot be answered: the columns of a survey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armload.identification import ArmHealth, Identification
from armload.inertia import NAMES
from armload.survey.sliding import WAYS, Slide

ANSWERED, UNUSABLE = "answered", "unusable"
_AXES = ("x", "y", "z")
_PRODUCTS = ("xx", "xy", "xz", "yy", "yz", "zz")
SEPARATOR = " | "  # between notes, and between determined parameters: sentences have commas
_COPY = "a copy, packed or not, of "  # what the last note of a log that is one begins with; the other's name follows

TEXT, WHOLE, FLAG, NUMBER = "text", "whole", "flag", "number"


def of_joints(n: int) -> list[str]:
    """The columns (2n,) of the arm's own torque: each joint's offset, then each joint's friction.

    >>> of_joints(2)
    ['offset_1', 'offset_2', 'coulomb_1', 'coulomb_2']
    """
    return [f"{name}_{j}" for name in ("offset", "coulomb") for j in range(1, n + 1)]


def columns(n: int) -> dict[str, str]:
    """Names and kinds of the columns, of arms with n joints.

    >>> [name for name, kind in columns(6).items() if kind == "flag"]
    ['held', 'consistent', 'moves', 'changed']
    """
    of_payload = ["mass", *(f"com_{a}" for a in _AXES), *(f"inertia_{p}" for p in _PRODUCTS)]
    of_ways = [f"{name}_{k}" for name in ("slide", "slide_std") for k in range(1, WAYS + 1)]
    return {
        **dict.fromkeys(("log", "arm"), TEXT),
        **dict.fromkeys(("episode", "part", "parts"), WHOLE),
        **dict.fromkeys(("t0", "t1", "date"), NUMBER),
        "samples": WHOLE,
        **dict.fromkeys(("status", "reason"), TEXT),
        "held": FLAG,
        **dict.fromkeys((f"{name}{end}" for name in of_payload for end in ("", "_low", "_high")), NUMBER),
        **dict.fromkeys(("determined", "interval", "method", "relative_to"), TEXT),
        **dict.fromkeys(("consistent", "moves"), FLAG),
        "notes": TEXT,
        **dict.fromkeys(("residual", "restlessness", "misfit"), NUMBER),
        "misfit_joint": WHOLE,
        "changed": FLAG,
        **dict.fromkeys((*of_joints(n), *of_ways), NUMBER),
        **dict.fromkeys(("version", "key"), TEXT),
    }


def shows_the_arm(row: Mapping[str, Any]) -> bool:
    """Whether the arm moved so much that the row tells of its own torque: mass and first moments are determined.

    Of an arm that stands, or of a log that was broken off at once, offsets and friction are what was expected of them,
    near zero, and not what they are.
    """
    return row["status"] == ANSWERED and set(NAMES[:4]) <= set(row["determined"].split(SEPARATOR))


def answered(found: Identification, where: dict[str, Any], slides: Sequence[Slide | None] = ()) -> list[dict[str, Any]]:
    """The rows of a log, one for each part throughout which the payload is the same; `date` becomes the part's own.

    slides: what each part tells of sliding; nothing: that was not asked.
    """
    of_parts = slides or [None] * len(found.segments)
    date = where.get("date")
    return [
        where
        | {"part": k, "parts": len(found.segments), "t0": _number(part.start), "t1": _number(part.stop)}
        | {"date": None if date is None else _number(date + part.start), "status": ANSWERED, "reason": ""}
        | _of_payload(part.answer)
        | _of_arm(part.answer.health)
        | of_slide(slide)
        for k, (part, slide) in enumerate(zip(found.segments, of_parts, strict=True))
    ]


def unusable(reason: str, where: dict[str, Any]) -> dict[str, Any]:
    """The row of a log that cannot be answered."""
    empty = dict.fromkeys(("determined", "interval", "method", "relative_to", "notes"), "")
    return where | empty | {"status": UNUSABLE, "reason": " ".join(reason.split())}


def as_copy(row: dict[str, Any], original: str | None) -> dict[str, Any]:
    """The row of a log that is a copy of another one, which its last note says; None: it is none.

    >>> as_copy({"notes": "short"}, "a.csv"), as_copy({"notes": ""}, "a.csv"), as_copy({"notes": ""}, None)
    ({'notes': 'short | a copy, packed or not, of a.csv'}, {'notes': 'a copy, packed or not, of a.csv'}, {'notes': ''})
    """
    if original is None:
        return row
    return row | {"notes": SEPARATOR.join(filter(None, (row["notes"], f"{_COPY}{original}")))}


def original_of(row: Mapping[str, Any]) -> str | None:
    """The log that a row's log is a copy of; None: it is none."""
    last = row["notes"].rpartition(SEPARATOR)[2]
    return last.removeprefix(_COPY) if last.startswith(_COPY) else None


def _of_payload(found: Identification) -> dict[str, Any]:
    upper = np.triu_indices(3)
    values: dict[str, tuple[Any, Any, Any]] = {"mass": (found.mass, found.phi_low[0], found.phi_high[0])}
    for k, axis in enumerate(_AXES):
        values[f"com_{axis}"] = (found.com[k], found.com_low[k], found.com_high[k])
    for name, i, j in zip(_PRODUCTS, *upper, strict=True):
        inertia = (found.inertia_com, found.inertia_com_low, found.inertia_com_high)
        values[f"inertia_{name}"] = tuple(x[i, j] for x in inertia)  # type: ignore[assignment]
    names = [name for name, known in zip(NAMES, found.determined, strict=True) if known]
    return {
        "samples": found.n_samples,
        "held": bool(found.held),
        **{f"{k}{e}": _number(x) for k, xs in values.items() for e, x in zip(("", "_low", "_high"), xs, strict=True)},
        "determined": SEPARATOR.join(names),
        "interval": found.interval,
        "method": found.method,
        "relative_to": found.relative_to,
        "consistent": bool(found.consistent),
        "moves": bool(found.moves),
        "notes": SEPARATOR.join(found.notes),
    }


def _of_arm(health: ArmHealth | None) -> dict[str, Any]:
    if health is None:
        return {}
    torques = [*health.offset, *health.coulomb]
    return {
        "residual": _number(health.residual),
        "restlessness": _number(health.restlessness),
        "misfit": _number(health.misfit),
        "misfit_joint": health.joint,
        "changed": bool(health.changed),
        **{name: _number(x) for name, x in zip(of_joints(len(torques) // 2), torques, strict=True)},
    }


def of_slide(slide: Slide | None) -> dict[str, Any]:
    """The columns of what a part of a log tells of sliding; none where it tells nothing."""
    if slide is None or not np.isfinite(slide.std).all():
        return {}
    both = {"slide": slide.moment, "slide_std": slide.std}
    return {f"{name}_{k}": _number(x) for name, xs in both.items() for k, x in enumerate(xs, start=1)}


def _number(value: Any) -> float | None:
    """A float that JSON can hold; None where it is not finite or not there."""
    return float(value) if value is not None and np.isfinite(value) else None
