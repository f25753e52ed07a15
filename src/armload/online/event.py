"""A change of payload, as it is reported, and what it was: it gets its name once the run after it can tell."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from armload.inertia import Z95, decimals
from armload.online.runs import Runs
from armload.online.thresholds import (
    KIND_FROM,
    KIND_LATEST,
    KIND_STD,
    RETURN_STD,
    RETURN_UNTIL,
    RETURN_WITHIN,
    STEP_STD,
)
from armload.posterior import PosteriorLeastSquares

_KINDS = {(False, True): "grasp", (True, False): "release", (True, True): "swap", (False, False): "change"}


@dataclass(frozen=True)
class Event:
    """Something was taken up, put down or exchanged.

    kind: "change" until it is known which, and where nothing seems to be held before or after; "grasp", "release",
        "swap" (one payload for another) or "return" (what was held before the last event is held again; a "grasp" after
        all, if it turns out to be only nearly the same).
    t: when it was noticed, on the stream's clock [s]. began: when it seems to have begun [s].
    mass: by how much the mass has changed [kg], below zero where something was put down, of a "return", too; None
        until it is known.
    decimals: with which the mass is shown: two digits of the standard deviation with which it is told at most.
    """

    kind: str
    t: float
    began: float
    mass: float | None
    decimals: int = 2

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"kind": self.kind, "t": self.t, "began": self.began, "mass": self.mass}

    @property
    def shown_mass(self) -> str:
        """The change of mass with its sign and unit; "" until it is known."""
        return "" if self.mass is None else f"{self.mass:+.{self.decimals}f} kg"

    def __str__(self) -> str:
        return f"{self.kind} at {self.t:.2f} s" + (f": {self.shown_mass}" if self.shown_mass else "")


class Naming:
    """The last change noticed, and whether the run after it is still judged.

    Attributes:
        event: the last change. judging: whether the run after it is asked: it may give way to the earlier one, or what
            the change was is not all known.
        held_before: whether anything was held before the change, or the doubt.
    """

    def __init__(self) -> None:
        self.event: Event | None = None
        self.judging = self._unnamed = self.held_before = self._held = self._rest = self._recognised = False
        self._ended: PosteriorLeastSquares | None = None
        self._may_return = False  # whether the run is still so new that it may hold what the earlier one held
        self._before = False, False, False  # all three of the last change, before what may be its rest

    def corrects_the_recognition(self, t: float, step: float) -> bool:
        """Whether a step of the mass [payloads] at t [s] tells that the run was recognised wrongly, as it is as small.

        The payload has not changed then: it is another than the one it was taken for, and weighs nearly as much.
        """
        if self.event is None or not self._recognised or t - self.event.t > RETURN_WITHIN:
            return False
        return abs(step) <= Z95 * RETURN_STD

    def begin(self, t: float, began: float, run: PosteriorLeastSquares, rest: bool) -> None:
        """A change is noticed at t [s]; nobody knows yet which.

        Args:
            t, began: as of `Event`. run: that ends. rest: it is that of the last change, which went on in this run, or
                after which the run was recognised wrongly.
        """
        self._before = self.judging, self._unnamed, self._may_return
        self.judging, self._recognised, self._may_return = False, False, True
        self._rest, self._unnamed = rest and self.event is not None, True
        if self.event is not None and self._rest:
            self.event = replace(self.event, mass=None)
        else:
            self.event, self._ended, self._held = Event("change", t, began, None), run, self.held_before

    def call_off(self, runs: Runs) -> None:
        """It was none, or the last change did not go on: the payload is what it was."""
        assert self.event is not None
        if self._rest:
            self.judging, self._unnamed, self._may_return = self._before
            self._name(self.event.kind, runs.mass_step(self._ended), runs)
        else:
            self._name("return", 0.0, runs)

    def judge(self, runs: Runs, held: bool | None) -> bool:
        """Say what the change was once the new run can tell; whether that holds what the earlier run held.

        held: whether anything is, by an answer of the new run; None: it has given none yet.
        """
        assert self.event is not None
        stream, std = runs.current.stream, float(runs.current.last.std[0]) / runs.unit
        if stream.seconds < KIND_FROM:
            return False
        if self._may_return and runs.is_earlier():
            self.judging, self._recognised = False, True
            self._name("return", runs.mass_step(self._ended, runs.earlier), runs)
            return True
        self._may_return = stream.seconds <= RETURN_UNTIL
        tells = std <= KIND_STD or stream.seconds > KIND_LATEST or stream.stands
        if self._unnamed and held is not None and tells:
            self._unnamed = False
            self._name(_KINDS[self._held, held], runs.mass_step(self._ended), runs)
        elif not self._unnamed and self.event.mass is None and (mass := runs.mass_step(self._ended)) is not None:
            self._name(self.event.kind, mass, runs)
        self.judging = self._may_return or self._unnamed or self.event.mass is None
        return False

    def _name(self, kind: str, mass: float | None, runs: Runs) -> None:
        assert self.event is not None
        self.event = replace(self.event, kind=kind, mass=mass, decimals=decimals(STEP_STD * runs.unit))
