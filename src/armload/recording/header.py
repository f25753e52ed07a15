"""What one column's name says by itself: quantity, joint and unit, by the words of `aliases.py`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from armload.recording.aliases import (
    CURRENTS,
    DESIRED,
    EXTERNAL,
    MEASURED,
    MOMENTS,
    NAMES,
    NEUTRAL,
    TIME_UNITS,
    TIMES,
    WHOLE,
    WORDS,
)

_BRACKET = re.compile(r"\s*[\[(]\s*([^\[\]()]*[^\W\d][^\[\]()]*|°[^\[\]()]*)\s*[\])]\s*$")
_INDEX = re.compile(r"\s*[\[(]\s*(?:j|jnt|joint|axis|a)[\s_]*([0-9]{1,3})\s*[\])]\s*$", re.IGNORECASE)  # (J1)
_CAMEL = re.compile(r"(?<=[a-z]{2})(?=[A-Z])|(?<=(?<![A-Za-z])q)(?=D)")  # qD is no qd
_WORD = re.compile(r"[^\W\d_]+|[0-9]+")
_LAST_NUMBER = re.compile(r"^(.*?)([0-9]{1,3})([^0-9]*)$", re.DOTALL)
_UNIT_TAILS = (("rad", "s"), ("deg", "s"), ("rad",), ("deg",), ("nm",))


@dataclass(frozen=True)
class Reading:
    """One reading of a column's name.

    quantity: t, q, dq, tau, or name (of a joint, as text).
    kind: measured, current (of a motor), desired or external.
    stem: the name's words without index and joint; columns of one stem belong together.
    key: the index in the name, or the joint's name; None for time.
    unit: as stated in the name, in lower case.
    """

    quantity: str
    kind: str
    stem: str
    key: int | str | None
    unit: str | None


@dataclass
class Family:
    """The columns of one quantity under one stem: places in the header by index or joint name."""

    quantity: str
    kind: str
    stem: str
    by_name: bool
    places: dict[int | str, list[int]] = field(default_factory=dict)
    units: set[str | None] = field(default_factory=set)

    @property
    def prefix(self) -> str:
        """The stem without its last word: what the fields of one message have in common."""
        return self.stem.rpartition("_")[0]

    @property
    def is_said_to_be_measured(self) -> bool:
        """Whether its name says so, beside others that are wanted."""
        return not MEASURED.isdisjoint(self.stem.split("_"))

    def base(self) -> int:
        """Where the indices begin: 0 if there is a 0, else 1."""
        return 0 if 0 in self.places else 1

    def count(self) -> int:
        """The number of joints of which the largest index speaks."""
        return 0 if self.by_name else max(int(key) for key in self.places) + 1 - self.base()

    def missing(self, n: int, joints: Sequence[str] | None) -> list[int | str]:
        """The keys that n joints have and this family has not."""
        wanted = list(joints or ()) if self.by_name else list(range(self.base(), self.base() + n))
        return [key for key in wanted if key not in self.places]

    def complete(self, n: int, joints: Sequence[str] | None) -> bool:
        """Whether there is one column for each of n joints and, where they are counted, no further one."""
        return not self.missing(n, joints) and (self.by_name or len(self.places) == n)

    def order(self, n: int, joints: Sequence[str] | None) -> list[int]:
        """The place in the header of each joint's column (n,)."""
        keys = list(joints or ()) if self.by_name else range(self.base(), self.base() + n)
        return [self.places[key][0] for key in keys]


@lru_cache(maxsize=4096)
def read_name(name: str, joints: tuple[str, ...]) -> Reading | None:
    """What a column holds by its name; None: nothing that is known.

    >>> read_name("state.tau_J[0]", ())
    Reading(quantity='tau', kind='measured', stem='state_tau_j', key=0, unit=None)
    >>> read_name("/joint_states/elbow_joint/velocity", ("elbow_joint",)).key
    'elbow_joint'
    """
    bare, unit = name, None
    if _INDEX.search(name) and (numbered := _numbered(name)):
        return _classified(*numbered, None)
    if bracket := _BRACKET.search(name):
        bare, unit = name[: bracket.start()], bracket[1].strip().lower()
    if joints and not re.fullmatch(r"(q|dq|tau)[0-9]+", bare):
        pattern = "|".join(re.escape(joint) for joint in sorted(joints, key=len, reverse=True))
        found = list(re.finditer(rf"(?<![^\W_])(?:{pattern})(?![^\W_])", bare, re.IGNORECASE))
        if len(found) == 1:
            joint = next(joint for joint in joints if joint.lower() == found[0][0].lower())
            reading = _classified(bare[: found[0].start()] + " " + bare[found[0].end() :], joint, unit)
            if reading is not None:
                return reading
    if numbered := _numbered(bare):
        return _classified(*numbered, unit)
    return _time(words_of(bare), unit)


def _numbered(name: str) -> tuple[str, int] | None:
    """A name without its index, and that: the one in brackets, or the last number."""
    if index := _INDEX.search(name):
        return name[: index.start()], int(index[1])
    number = _LAST_NUMBER.match(name)
    return None if number is None else (f"{number[1]} {number[3]}", int(number[2]))


def words_of(name: str) -> list[str]:
    """A name's words and numbers, in lower case.

    >>> words_of("field.header.stamp"), words_of("jointPos_1")
    (['field', 'header', 'stamp'], ['joint', 'pos', '1'])
    """
    return [word.lower() for word in _WORD.findall(_CAMEL.sub(" ", name))]


def _classified(rest: str, key: int | str, unit: str | None) -> Reading | None:
    words = words_of(rest)
    stem = "_".join(words)
    for tail in _UNIT_TAILS:
        if tuple(words[-len(tail) :]) == tail and len(words) > len(tail):
            unit, words = unit or "/".join(tail), words[: -len(tail)]
            break
    whole = WHOLE.get("_".join(words))
    if whole is not None:
        return Reading(*whole, stem, key, unit)
    if EXTERNAL.intersection(words):
        return Reading("tau", "external", stem, key, unit) if {"tau", "torque", "torques"}.intersection(words) else None
    kind = "desired" if DESIRED.intersection(words) else "measured"
    for k in range(len(words) - 1):  # whatever the topic of a JointState is called, its fields are known
        if words[k] == "joint" and words[k + 1] in ("state", "states"):
            words = words[k + 2 :]
            break
    core = "_".join(word for word in words if word not in NEUTRAL | DESIRED)
    if core in NAMES:
        return Reading("name", kind, stem, key, unit)
    if core in CURRENTS:
        return Reading("tau", "current", stem, key, unit) if kind == "measured" else None
    return Reading(WORDS[core], kind, stem, key, unit) if core in WORDS else None


def wanted_of(name: str) -> tuple[str, int]:
    """Whether a column is the "moment" or the "current" that a controller wants of a joint, and the joint's index.

    >>> wanted_of("target_moment_0"), wanted_of("ROBOT_TARGET_JOINT_CURRENT (J1)"), wanted_of("actual_current_0")
    (('moment', 0), ('current', 1), ('', 0))
    """
    if (numbered := _numbered(name)) is None:
        return "", 0
    rest, index = numbered
    words = words_of(rest)
    core = "_".join(word for word in words if word not in NEUTRAL | DESIRED)
    what = "current" if core in CURRENTS else "moment" if core in MOMENTS or WORDS.get(core) == "tau" else ""
    return (what, index) if what and "target" in words else ("", 0)


def _time(words: list[str], unit: str | None) -> Reading | None:
    stem = "_".join(words)
    if len(words) > 1 and words[-1] in TIME_UNITS:
        unit, words = unit or words[-1], words[:-1]
    if "_".join(words) in TIMES or "_".join(word for word in words if word not in NEUTRAL) in TIMES:
        return Reading("t", "measured", stem, None, unit)
    return None


def is_time(name: str) -> bool:
    """Whether a column's name is one of time.

    >>> is_time("time"), is_time("header.stamp"), is_time("q")
    (True, True, False)
    """
    return _time(words_of(name), None) is not None


def families_of(names: Sequence[str], joints: tuple[str, ...]) -> tuple[list[Family], list[tuple[int, Reading]]]:
    """The families of position, velocity, torque and joint names in a header, and the columns that may be time."""
    families: dict[tuple[str, str, bool], Family] = {}
    times = []
    for place, name in enumerate(names):
        reading = read_name(name, joints)
        if reading is None:
            continue
        if reading.key is None:
            times.append((place, reading))
            continue
        index = (reading.quantity, reading.stem, isinstance(reading.key, str))
        family = families.setdefault(index, Family(reading.quantity, reading.kind, *index[1:]))
        family.places.setdefault(reading.key, []).append(place)
        family.units.add(reading.unit)
    return list(families.values()), times
