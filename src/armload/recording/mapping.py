"""From a header to the columns of time, position, velocity and torque: one mapping for every kind of table.

It never chooses between two readings. Where two sets of columns could be the same quantity, the answer is a sentence
that names both and the `--columns` that decides; only where the tool that wrote the log is known (`FORMS`) does that
tool's own rule decide.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.aliases import AMPERE, CALLED, EPISODE, FORMS, QUANTITIES, UNITS, WANTED, Form
from armload.recording.choice import WHY_NOT, Header, TimeColumns, some
from armload.recording.column_spec import ColumnSpec
from armload.recording.columns import check_joint_count, column_names
from armload.recording.currents import factors, no_constants, of_currents, torque_constants
from armload.recording.header import Family, Reading, families_of, read_name, wanted_of, words_of
from armload.recording.templates import abridged, named_columns


@dataclass(frozen=True)
class ColumnMap:
    """Which columns of a table a log is made of.

    Args:
        time: None: the table has no times.
        places: of each quantity, the place in the header of each joint's column (n,); of velocity none where there are
            no such columns.
        scales: of each quantity, what its columns are multiplied with (n,) to be in rad, rad/s, N·m.
        joints: names of the joints, where the table names them: joints that are only counted may be in another order.
        episode: the column that tells several episodes apart.
        notes: what was read from where.
        wanted: where the torque is motor current of unknown constants, the places of the moments and of the currents
            (n,) that the controller itself wanted, from which they follow; None: they are among the scales.
    """

    time: TimeColumns | None
    places: dict[str, list[int]]
    scales: dict[str, tuple[float, ...]]
    joints: tuple[str, ...] | None
    episode: int | None
    notes: tuple[str, ...]
    wanted: tuple[list[int], list[int]] | None = None


def map_columns(
    names: Sequence[str],
    where: str,
    arm: Arm | None = None,
    spec: ColumnSpec | None = None,
    text: Callable[[int], str | None] = lambda _: None,
    dates: Sequence[int] = (),
) -> ColumnMap:
    """The columns of a log in a header.

    >>> map_columns(["time", "temperature_0", "effort_0", "position_0", "velocity_0"], "log").places
    {'q': [3], 'dq': [4], 'tau': [2]}

    Args:
        names: the header; elements of a list-valued column are called `name[0]`, `name[1]`, …
        where: the file, for messages.
        arm: whose log it is, where known.
        spec: what the user says of the columns.
        text: the one text that a column holds in all rows, for columns of joint names.
        dates: places of the columns that hold dates: times, whatever they are called, where no other column is.

    Raises:
        RecordingError: a quantity is missing, incomplete or could be read in two ways, or n is not the arm's.
    """
    spec = spec or ColumnSpec()
    families, times = families_of(names, () if arm is None else arm.joint_names)
    times = times or [(place, Reading("t", "measured", names[place], None, None)) for place in dates]
    form = _form_of(names, families)
    families = _with_joint_names(families, names, where, text)
    given = {}
    for key in QUANTITIES:
        if (template := getattr(spec, key)) is not None and not (key == "dq" and spec.without_velocities):
            given[key] = named_columns(template, key, names, where, arm)
    if not given and not any(family.quantity in QUANTITIES for family in families):
        raise RecordingError(
            f"{where} has no columns named q1, dq1, tau1, …: found {abridged(names) or 'none'}; name yours, such as "
            '--columns "t=TIME,q=POSITION{i},dq=VELOCITY{i},tau=TORQUE{i}"'
        )
    header = Header(names, families, times, form, _joint_count(families, given, where, arm), arm, where, dates)
    places: dict[str, list[int]] = {}
    scales, notes, wanted = {}, [], None
    for key in QUANTITIES:
        if key == "dq" and key not in given and (spec.without_velocities or header.lacks(key)):
            places[key], scales[key] = [], ()
            continue
        places[key] = given[key] if key in given else header.family(key).order(header.n, header.joints)
        if len(places[key]) != header.n:
            raise RecordingError(
                f"{where}: --columns names {len(places[key])} column(s) of {CALLED[key]} for {header.n} joints: "
                "expected one per joint"
            )
        scale = _scale(header, key, places[key], spec)
        if scale is None and (wanted := _wanted(header)) is None:
            what = f"{some([header.names[place] for place in places[key]])} look like"
            instead = f"log {WANTED[0]} and {WANTED[1]} as well, from which they follow, or "
            raise no_constants(header.where, what, header.arm, header.n, instead)
        scales[key], note = scale or ((1.0,) * header.n, [])
        notes += note
    notes += _not_measured(header, places["tau"])
    if not given:
        _check_bases(header, places)
    time = header.time(spec)
    episode = list(names).index(EPISODE) if EPISODE in names else None
    joints = header.joints if _are_named(header, places["q"]) else None
    return ColumnMap(time, places, scales, joints, episode, (*_notes(header, places, time), *notes), wanted)


def _form_of(names: Sequence[str], families: Sequence[Family]) -> Form | None:
    """The tool that wrote the header, if all its marks are there."""
    there = {family.stem for family in families}
    there.update(name.lower().removesuffix("[0]") for name in names)
    there.update("_".join(words_of(name)) for name in names)
    return next((form for form in FORMS if there.issuperset(form.marks)), None)


def _with_joint_names(
    families: list[Family], names: Sequence[str], where: str, text: Callable[[int], str | None]
) -> list[Family]:
    """Families whose indices have names in the table itself (`field.name0`), by these names.

    Raises:
        RecordingError: a column of names does not hold the same one in every row.
    """
    labels: dict[str, dict[int | str, str | None]] = {}
    for family in families:
        if family.quantity == "name" and not family.by_name:
            labels[family.prefix] = {key: text(places[0]) for key, places in family.places.items()}
            for key, called in labels[family.prefix].items():
                if not called:
                    name = names[family.places[key][0]]
                    raise RecordingError(
                        f"{where}: column {name!r} does not name the same joint in every row: expected one "
                        "device on the topic; write it alone, or read the bag itself"
                    )
    out = []
    for family in families:
        joints = labels.get(family.prefix, {})
        if family.quantity in QUANTITIES and joints.keys() == family.places.keys():
            places: dict[int | str, list[int]] = {}
            for key, at in family.places.items():
                places.setdefault(str(joints[key]), []).extend(at)
            family = Family(family.quantity, family.kind, family.stem, True, places, family.units)
        out.append(family)
    return out


def _are_named(header: Header, places: Sequence[int]) -> bool:
    """Whether the table says by name which joint each of these columns (n,) is of, rather than by a number."""
    named = [family.places.values() for family in header.families if family.by_name]
    if any(set(places) <= {place for at in keys for place in at} for keys in named):
        return True
    joints = header.joints or ()
    return bool(joints) and all(joint in header.names[k] for joint, k in zip(joints, places, strict=True))


def _joint_count(families: Sequence[Family], given: dict[str, list[int]], where: str, arm: Arm | None) -> int:
    """The number of joints: the arm's, or the largest that the columns speak of.

    Raises:
        RecordingError: all columns speak of another number than the arm's.
    """
    if given:
        return arm.n if arm is not None else len(next(iter(given.values())))
    sets = [family for family in families if family.quantity in QUANTITIES and family.kind in ("measured", "current")]
    named = [family for family in sets if family.by_name]
    if named and arm is None:
        return len(named[0].places)
    found = max((family.count() for family in sets), default=0)
    if arm is None:
        return max(found, 1)
    consistent = {family.quantity for family in sets if family.complete(found, None) and not family.by_name}
    fits = any(family.complete(arm.n, arm.joint_names) for family in sets)
    if found != arm.n and not named and not fits and consistent == set(QUANTITIES):
        own = f', or the arm\'s own columns with --columns "q=NAME{{0..{arm.n - 1}}}"' if found > arm.n else ""
        check_joint_count(found, where, arm, own)  # raises
    return arm.n


def _scale(header: Header, key: str, places: list[int], spec: ColumnSpec) -> tuple[tuple[float, ...], list[str]] | None:
    """What the columns of a quantity are multiplied with (n,), and a note where that is more than a unit.

    None: they are motor currents, and the torque of an ampere is not known.
    """
    readings = [
        read_name(header.names[place], () if header.arm is None else header.arm.joint_names) for place in places
    ]
    units = {None if reading is None else reading.unit for reading in readings}
    unit = getattr(spec, f"{key}_unit")
    if unit is None and len(units) == 1:
        (unit,) = units
        currents = {reading is not None and reading.kind == "current" for reading in readings}
        if key == "tau" and unit is None and (currents == {True} or spec.of_currents):
            unit = AMPERE
    elif unit is None:
        stated = sorted(str(unit or "none") for unit in units)
        raise RecordingError(
            f"{header.where}: columns of {CALLED[key]} state different units ({', '.join(stated)}): expected one; say "
            f"which with --columns {key}_unit=…"
        )
    if unit is None:
        return (1.0,) * header.n, []
    if unit.strip().lower() not in UNITS[key]:
        raise RecordingError(
            f"{header.where}: columns of {CALLED[key]} state the unit {unit!r}: expected one of "
            f"{', '.join(UNITS[key])}; say which with --columns {key}_unit=…"
        )
    if unit.strip().lower() != AMPERE:
        return factors(key, unit, header.arm, header.n), []
    constants = torque_constants(spec, header.arm, header.n, header.where)
    return None if constants is None else (constants, [of_currents(header.where, constants)])


def _not_measured(header: Header, places: list[int]) -> list[str]:
    """That torque was taken, as the user asked for, from columns of what a controller wants."""
    readings = [read_name(header.names[place], ()) for place in places]
    if not any(reading is not None and reading.kind == "desired" for reading in readings):
        return []
    return [
        f"{header.where}: tau is {some([header.names[place] for place in places])}, as was asked for; by its name it "
        f"{WHY_NOT['desired']}: a payload that is not set in the controller does not show in it"
    ]


def _wanted(header: Header) -> tuple[list[int], list[int]] | None:
    """Places of the moments and of the currents (n,) that the controller wanted, where the header has all of them."""
    found: dict[str, dict[int, list[int]]] = {"moment": {}, "current": {}}
    for place, name in enumerate(header.names):
        what, index = wanted_of(name)
        if what:
            found[what].setdefault(index, []).append(place)
    for first in (0, 1):
        joints = range(first, first + header.n)
        moments, currents = ([places[j][0] for j in joints if len(places.get(j, ())) == 1] for places in found.values())
        if len(moments) == len(currents) == header.n:
            return moments, currents
    return None


def _check_bases(header: Header, places: dict[str, list[int]]) -> None:
    """Refuse a header that counts its joints from 0 in one quantity and from 1 in another."""
    bases = {}
    for family in header.families:
        order = [] if family.by_name or family.quantity not in QUANTITIES else places[family.quantity]
        if order and order[0] in family.places.get(family.base(), ()):
            bases.setdefault(family.base(), family)
    if len(bases) > 1:
        shown = " and ".join(f"{header.shown(family)} from {base}" for base, family in sorted(bases.items()))
        some_key = bases[0].quantity
        raise RecordingError(
            f"{header.where} counts its joints in two ways, {shown}: expected one; say which joints are meant with "
            f'--columns "{some_key}={header.template(bases[0])}"'
        )


def _notes(header: Header, places: dict[str, list[int]], time: TimeColumns | None) -> list[str]:
    """What was read from where, unless the header says just that."""
    names, canonical = header.names, column_names(header.n)
    taken = {place for key in QUANTITIES for place in places[key]}
    if time is not None:
        taken |= {time.place} if time.nanoseconds is None else {time.place, time.nanoseconds}
    left = [name for k, name in enumerate(names) if k not in taken and not name.startswith("Unnamed: ")]
    out = f"; left out {some(left)}" if left else ""
    plain = {re.sub(r"\[([0-9]+)\]$", lambda m: str(int(m[1]) + 1), names[place]) for place in taken}  # an array's q[0]
    if plain == set(canonical):
        return [f"{header.where}: left out {some(left)}"] if left else []
    parts = []
    if time is not None:
        by = f" as {time.tool} writes" if time.tool else ""
        parts.append(f"t from {names[time.place]!r} [{time.unit or 's'}{by}]")
    for key in QUANTITIES:
        if not places[key]:
            continue
        first, last = names[places[key][0]], names[places[key][-1]]
        parts.append(f"{key} from {first!r}" + (f" … {last!r}" if header.n > 1 else ""))
    return [f"{header.where}: read {', '.join(parts)}{out}"]
