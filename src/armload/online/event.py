"""A change of payload, as it is reported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

KINDS = ("change", "grasp", "release", "swap", "return")


def kind_of(before: bool, after: bool) -> str:
    """The kind of a change, by whether anything is held before and after it."""
    return {(False, True): "grasp", (True, False): "release", (True, True): "swap"}.get((before, after), "change")


@dataclass(frozen=True)
class Event:
    """Something was taken up, put down or exchanged.

    kind: "change" until it is known which, and where nothing seems to be held before or after; "grasp", "release",
        "swap" (one payload for another) or "return" (what was held before the last event is held again).
    t: when it was noticed, on the stream's clock [s]. began: when it seems to have begun [s].
    mass: by how much the mass has changed [kg], below zero where something was put down, of a "return", too; None
        until it is known.
    """

    kind: str
    t: float
    began: float
    mass: float | None

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"kind": self.kind, "t": self.t, "began": self.began, "mass": self.mass}

    def __str__(self) -> str:
        return f"{self.kind} at {self.t:.2f} s" + ("" if self.mass is None else f": {self.mass:+.2f} kg")
