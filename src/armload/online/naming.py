"""What was it? A change of payload gets its name once the run after it can tell."""

from __future__ import annotations

from dataclasses import replace

from armload.estimators import Estimate
from armload.online.event import Event, kind_of
from armload.online.runs import Runs
from armload.online.thresholds import KIND_FROM, KIND_LATEST, KIND_STD, RETURN_STD, RETURN_UNTIL


class Naming:
    """The last change noticed, and whether the run after it is still judged.

    Args:
        unit: standard deviation of a payload's mass beforehand [kg].

    Attributes:
        event: the last change; None: there was none. judging: whether the run is new, and may give way to the earlier
            one. held_before: whether anything was held before the change, or the doubt.
    """

    def __init__(self, unit: float) -> None:
        self._unit = unit
        self.event: Event | None = None
        self.judging = self._unnamed = self.held_before = self._held = self._rest = False

    def begin(self, t: float, began: float, rest: bool) -> None:
        """A change is noticed at t [s]; nobody knows yet which. `rest`: it is that of the last one, which went on."""
        self._rest, self.judging, self._unnamed = rest, False, True
        if not rest:
            self._held = self.held_before
        self.event = replace(self.event) if rest and self.event else Event("change", t, began, None)

    def call_off(self) -> None:
        """It was none: the payload is what it was."""
        assert self.event is not None
        self.event = replace(self.event) if self._rest else replace(self.event, kind="return", mass=0.0)

    def judge(self, runs: Runs, estimate: Estimate, held: bool) -> bool:
        """Say what the change was once the new run can tell; whether that holds what the earlier run held."""
        assert self.event is not None
        stream, std = runs.current.stream, float(estimate.std[0]) / self._unit
        if stream.seconds < KIND_FROM:
            return False
        self.judging = stream.seconds <= RETURN_UNTIL
        if std <= RETURN_STD and runs.is_earlier(estimate):
            self.judging = False
            self.event = replace(self.event, kind="return")
            return True
        if self._unnamed and (std <= KIND_STD or stream.seconds > KIND_LATEST or stream.stands):
            self._unnamed = False
            self.event = replace(self.event, kind=kind_of(self._held, held))
        return False
