"""Alarms: typed, one raised and one cleared for each episode, with hysteresis in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from armload.inertia import decimals
from armload.online.thresholds import STEP_STD
from armload.regression.prior import LOAD

RAISED_AFTER = (
    0.5  # [s] a condition holds before its alarm: longer than the worst estimates of a hand-over at once last
)
CLEARED_AFTER = 5.0  # [s] it does not hold before the alarm is over: a limit that is grazed gives one alarm
STARTS = 30.0  # [s] a source may take to give its first sample: a process, a reader and a robot that connects
# why an arm is not heard of; all others are of a source that works
_LOST = ("starting", "source lost", "silent")


@dataclass(frozen=True)
class Alarm:
    """An alarm that begins or ends.

    arm: its name. kind: one of `_CONDITIONS`. raised: whether it begins. value, limit: what was compared, None where
    nothing was: masses [kg], or distances from the payload frame [m].
    """

    arm: str
    kind: str
    raised: bool
    text: str
    value: float | None = None
    limit: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        state = "raised" if self.raised else "cleared"
        return {
            "arm": self.arm,
            "alarm": self.kind,
            "state": state,
            "text": self.text,
            "value": self.value,
            "limit": self.limit,
        }


class Alarms:
    """What becomes an alarm of one arm's answers.

    A condition must hold for 0.5 s to raise its alarm, and must not hold for 5 s to clear it. While the answer is
    unknown, nobody knows whether a mass is over the rating: then neither begins nor ends, and both times begin anew. A
    source counts as lost 0.5 s after its last sample is half a second old, and where it never came, after 30 s.

    >>> alarms = Alarms("left", rating=3.0)
    >>> heavy = {"known": True, "mass": 3.4, "com": [0.0, 0.0, 0.1]}
    >>> [[a.kind for a in alarms.look(heavy, now)] for now in (0.0, 0.4, 0.6, 0.8)]
    [[], [], ['over_rating'], []]

    Args:
        arm: its name. rating: the most it may hold [kg]. com_range: the farthest its payload's centre of mass may be
            from the payload frame [m]; None: no limit.
    """

    def __init__(self, arm: str, rating: float = math.inf, com_range: float | None = None) -> None:
        self.arm, self.rating, self.com_range = arm, rating, com_range
        self.raised: set[str] = set()
        self._since: dict[str, float] = {}  # since when each condition is known to be other than its alarm says

    def look(self, answer: Mapping[str, Any], now: float) -> list[Alarm]:
        """The alarms that begin or end with an answer told at `now` [s, monotonic]."""
        return [alarm for kind in _CONDITIONS if (alarm := self._look(kind, answer, now)) is not None]

    def _look(self, kind: str, answer: Mapping[str, Any], now: float) -> Alarm | None:
        holds, text, value, limit = _CONDITIONS[kind](self, answer)
        was = kind in self.raised
        if holds is None or holds == was:
            self._since.pop(kind, None)
            return None
        lasts = CLEARED_AFTER if not holds else STARTS if answer.get("unknown") == "starting" else RAISED_AFTER
        if now - self._since.setdefault(kind, now) < lasts:
            return None
        del self._since[kind]
        (self.raised.add if holds else self.raised.discard)(kind)
        return Alarm(self.arm, kind, holds, text, value, limit)

    def _over_rating(self, answer: Mapping[str, Any]) -> _Found:
        if not answer["known"] or not math.isfinite(self.rating):
            return None, "", None, None
        mass = answer["mass"]
        over = mass > self.rating
        # with the digits of a change (`online.Event`), of an arm of this rating
        shown = f"{mass:.{decimals(STEP_STD * LOAD * self.rating)}f}"
        return over, f"{shown} kg are held, {self.rating:g} kg are allowed", mass, self.rating

    def _com_out_of_range(self, answer: Mapping[str, Any]) -> _Found:
        if not answer["known"] or self.com_range is None:
            return None, "", None, None
        if not answer.get("held", True) or answer["com"] is None or not all(answer.get("determined", [True] * 4)[:4]):
            return False, "no centre of mass is known", None, self.com_range
        away = math.hypot(*answer["com"])
        text = f"the centre of mass is {away:.3f} m from the payload frame, {self.com_range:g} m are allowed"
        return away > self.com_range, text, away, self.com_range

    def _arm_changed(self, answer: Mapping[str, Any]) -> _Found:
        doubted = answer.get("unknown") == "samples implausible"
        if not answer["known"] and not doubted:
            return None, "", None, None
        said = answer["why"] if doubted else answer.get("arm_changed")
        return said is not None, said or "the arm is as it was", None, None

    def _source_lost(self, answer: Mapping[str, Any]) -> _Found:
        if answer.get("unknown") == "compiling":
            return None, "", None, None
        lost = answer.get("unknown") in _LOST
        return lost, (answer.get("why") or "no sample comes") if lost else "samples come again", None, None


_Found = tuple[bool | None, str, float | None, float | None]  # whether it holds (None: not known), text, value, limit
_CONDITIONS: dict[str, Callable[[Alarms, Mapping[str, Any]], _Found]] = {
    "over_rating": Alarms._over_rating,
    "com_out_of_range": Alarms._com_out_of_range,
    "arm_changed": Alarms._arm_changed,
    "source_lost": Alarms._source_lost,
}
