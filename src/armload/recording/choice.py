"""The one reading of a header, or the sentence that says why there is not exactly one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.aliases import CALLED, CLOCKS, PARTS, TIME_UNITS, Form
from armload.recording.column_spec import ColumnSpec
from armload.recording.header import Family, Reading, words_of
from armload.recording.templates import abridged, place_of

WHY_NOT = {
    "desired": "is what the controller wants or its model expects, not what was measured",
    "external": "has gravity and the arm's own torque taken out",
}


DATE = "date"  # the unit of a column whose cells are dates


@dataclass(frozen=True)
class TimeColumns:
    """The columns of time: seconds and, where they are apart, nanoseconds.

    unit: as stated in the header, by the tool or by the user, or `DATE`; None: not stated.
    tool: whose rule gave the unit. other: another clock, for files in which this one stands still.
    """

    place: int
    unit: str | None = None
    nanoseconds: int | None = None
    tool: str | None = None
    other: int | None = None


@dataclass(frozen=True)
class Header:
    """A header, read name by name.

    Args:
        names: of all columns.
        families: sets of columns that could be a quantity.
        times: columns that could be time, with their places.
        form: the tool that wrote it, where it is known.
        n: number of joints.
        arm: whose log it is, where known.
        where: the file.
        dates: places of the columns that hold dates.
    """

    names: Sequence[str]
    families: Sequence[Family]
    times: Sequence[tuple[int, Reading]]
    form: Form | None
    n: int
    arm: Arm | None
    where: str
    dates: Sequence[int] = ()

    @property
    def joints(self) -> tuple[str, ...] | None:
        """The joints in their order, where they have names."""
        if self.arm is not None:
            return self.arm.joint_names
        named = [family for family in self.families if family.by_name and family.quantity == "q"]
        return tuple(str(key) for key in named[0].places) if named else None

    def lacks(self, quantity: str) -> bool:
        """Whether no column speaks of what was measured of a quantity."""
        return not any(family.quantity == quantity and family.kind == "measured" for family in self.families)

    def family(self, quantity: str) -> Family:
        """The columns of position, velocity or torque.

        Raises:
            RecordingError: there are none, some are missing, or two sets could be meant.
        """
        mine = [family for family in self.families if family.quantity == quantity]
        measured = [family for family in mine if family.kind == "measured"]
        complete = [family for family in measured if family.complete(self.n, self.joints)]
        own = [family for family in complete if self.form is not None and family.stem == self.form.torque]
        if quantity == "tau" and own:
            return self._once(own[0])
        larger = [f for f in measured if f not in complete and not f.by_name and len(f.places) >= self.n]
        if len(complete + larger) > 1:
            raise self._two(quantity, *(complete + larger)[:2])
        wanted = [f for f in mine if f.kind == "desired" and quantity == "tau" and f.complete(self.n, self.joints)]
        if complete:
            if wanted and not complete[0].is_said_to_be_measured:
                raise self._two(quantity, complete[0], wanted[0])
            return self._once(complete[0])
        currents = [f for f in mine if f.kind == "current" and f.complete(self.n, self.joints)]
        if not measured and currents:
            rivals = currents[1:] + ([] if currents[0].is_said_to_be_measured else wanted)
            if rivals:
                raise self._two(quantity, currents[0], rivals[0])
            return self._once(currents[0])
        raise self._missing(quantity, mine, measured)

    def time(self, spec: ColumnSpec) -> TimeColumns | None:
        """The columns of time; None: the samples are evenly spaced, at the rate the user gives.

        Raises:
            RecordingError: there is none and no rate, more than one, or both; or a unit is stated for dates.
        """
        time = self._time(spec)
        if time is not None and time.unit == DATE and spec.t_unit is not None:
            raise RecordingError(
                f"{self.where}: column {self.names[time.place]!r} holds dates: expected no t_unit then; leave it out"
            )
        return time

    def _time(self, spec: ColumnSpec) -> TimeColumns | None:
        places = [place for place, _ in self.times]
        if spec.rate is not None:
            if spec.t is not None or places:
                name = spec.t or self.names[places[0]]
                raise RecordingError(f"{self.where} has times (column {name!r}): expected no --rate then; leave it out")
            return None
        if spec.t is not None:
            place = place_of(spec.t, "t", self.names, self.where)
            unit = spec.t_unit or next((reading.unit for at, reading in self.times if at == place), None)
            if unit is None and self.form is not None and spec.t.lower() in self.form.times:
                unit = self.form.unit
            return self._timed(place, unit)
        if self.form is not None:
            lower = [name.lower() for name in self.names]
            known = [lower.index(name) for name in self.form.times if name in lower]
            strange = [at for at in places if at not in known and not re.fullmatch(self.form.clocks, lower[at])]
            if known and not strange and known[0] not in self.dates:
                unit = spec.t_unit or self.form.unit
                return TimeColumns(known[0], unit, None, None if spec.t_unit else self.form.tool, (*known[1:], None)[0])
        if (parts := self._in_parts()) is not None and set(places) <= set(parts):
            return TimeColumns(parts[0], "s", parts[1])
        if len(places) > 1:
            one, other = (self.names[place] for place in places[:2])
            raise RecordingError(
                f"{self.where}: time could be column {one!r} or {other!r}: expected one; decide with --columns t={one}"
            )
        if not places:
            raise RecordingError(
                f"{self.where} lacks a column of time: expected t or timestamp [s]; name it with --columns t=…, or "
                "give the rate of evenly spaced samples with --rate HZ"
            )
        return self._timed(
            places[0], spec.t_unit or self.times[0][1].unit or ("s" if self.names[places[0]] == "t" else None)
        )

    def _in_parts(self) -> tuple[int, int] | None:
        """The columns of one clock's seconds and nanoseconds; None: there are none, or of more than one clock."""
        words = [tuple(words_of(name)) or (name,) for name in self.names]
        found = [
            (k, words.index((*clock, of_nanoseconds)))
            for k, (*clock, last) in enumerate(words)
            if not clock or clock[-1] in CLOCKS
            for of_nanoseconds in PARTS.get(last, ())
            if (*clock, of_nanoseconds) in words
        ]
        return found[0] if len(found) == 1 else None

    def _timed(self, place: int, unit: str | None) -> TimeColumns:
        if place in self.dates:
            return TimeColumns(place, DATE)
        if unit is not None and unit.strip().lower() not in TIME_UNITS:
            raise RecordingError(
                f"{self.where}: column {self.names[place]!r} states the unit {unit!r}: expected s, ms, us or ns; say "
                "which with --columns t_unit=…"
            )
        return TimeColumns(place, unit)

    def _once(self, family: Family) -> Family:
        for key in family.places:
            places = family.places[key]
            if len(places) > 1 and (not family.by_name or key in (self.joints or ())):
                one, other = (self.names[place] for place in places[:2])
                if one == other:
                    raise RecordingError(f"{self.where} has the column {one!r} more than once: expected it once")
                raise RecordingError(
                    f"{self.where}: {CALLED[family.quantity]} of one joint could be column {one!r} or {other!r}: "
                    f"expected one; decide with --columns {family.quantity}={self.template(family)}"
                )
        return family

    def _two(self, quantity: str, one: Family, other: Family) -> RecordingError:
        if other.kind == "desired":
            what, ways = f", which {WHY_NOT['desired']}", f'"{quantity}={self.template(one)}"'
        else:
            what, ways = "", f'"{quantity}={self.template(one)}" or "{quantity}={self.template(other)}"'
        return RecordingError(
            f"{self.where}: {CALLED[quantity]} could be {self.shown(one)} or {self.shown(other)}{what}: expected one; "
            f"decide with --columns {ways}"
        )

    def _missing(self, quantity: str, mine: list[Family], measured: list[Family]) -> RecordingError:
        """Why there is no complete set of columns for a quantity."""
        called = CALLED[quantity]
        for family in measured:
            self._once(family)
        partly = [family for family in measured if family.missing(self.n, self.joints)]
        if partly:
            family = max(partly, key=lambda f: len(f.places))
            if family.by_name and "{joint}" not in self.template(family):  # its names are cells of the table
                joints = ", ".join(str(key) for key in family.missing(self.n, self.joints))
                found = ", ".join(str(key) for key in family.places)
                return RecordingError(
                    f"{self.where}: {self.shown(family)} are not of {joints}: found {found}; name the robot that made "
                    "the log"
                )
            lacking = [self.name_of(family, key) for key in family.missing(self.n, self.joints)]
            whole = [f for f in self.families if f is family or f.complete(self.n, self.joints)]
            read = {place for f in whole for places in f.places.values() for place in places}
            read.update(place for place, _ in self.times)
            instead = [name for k, name in enumerate(self.names) if k not in read]
            also = f" (it has {some(instead)} instead)" if instead else ""
            return RecordingError(
                f"{self.where} lacks {some(lacking)}{also}: expected the {called} of {self.n} joints; name its columns "
                f"with --columns {quantity}=…"
            )
        if measured:
            return RecordingError(
                f"{self.where}: {self.shown(measured[0])} are {len(measured[0].places)} columns of {called}: expected "
                f'{self.n}; name the arm\'s own with --columns "{quantity}={self.template(measured[0], ranged=True)}"'
            )
        for kind, why in WHY_NOT.items():
            found = [family for family in mine if family.kind == kind]
            if found:
                return RecordingError(
                    f"{self.where} lacks the measured {called}: {self.shown(found[0])} {why}; record the measured one, "
                    f"or, if it is there under a name of its own, say so with --columns {quantity}=NAME{{i}}"
                )
        return RecordingError(
            f"{self.where} lacks columns of {called} (found {abridged(self.names)}): if they have other names, say so "
            f"with --columns {quantity}=NAME{{i}}"
        )

    def shown(self, family: Family) -> str:
        """A family by its first and last column."""
        places = [places[0] for places in family.places.values()]
        return f"{self.names[places[0]]!r}" + (f" … {self.names[places[-1]]!r}" if len(places) > 1 else "")

    def template(self, family: Family, ranged: bool = False) -> str:
        """What `--columns` calls a family."""
        name = self.names[next(iter(family.places.values()))[0]]
        if family.by_name:
            key = str(next(iter(family.places)))
            return name.replace(key, "{joint}") if key in name else name
        index = f"{{{family.base()}..{family.base() + self.n - 1}}}" if ranged else "{i}"
        return re.sub(r"[0-9]+(?=[^0-9]*$)", index, name)

    def name_of(self, family: Family, key: int | str) -> str:
        """What the column of one joint would be called."""
        return re.sub(r"\{(i|joint)\}", str(key), self.template(family))


def some(names: Sequence[str]) -> str:
    """Some columns by name.

    >>> some(["a", "b"])
    "columns 'a', 'b'"
    """
    shown = ", ".join(repr(name) for name in names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return f"column{'s' if len(names) > 1 else ''} {shown}"
