"""What the user says about a log's columns: names, units, and what the file does not hold."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from armload.errors import RecordingError, one_line
from armload.recording.aliases import AMPERE, QUANTITIES, UNITS

_COLUMNS = ("t", *QUANTITIES)
_OF_VALUES = (*(f"{key}_unit" for key in QUANTITIES), "torque_constants", "compensated")
NONE = "none"  # of velocities: the log has none that are of use
_HINT = 'expected KEY=VALUE pairs such as "t=time,q=joint_pos_{i},dq=joint_vel_{i},tau=effort_{i}", or a .toml file'


@dataclass(frozen=True)
class ColumnSpec:
    """Names of columns, their units, and what else a table leaves open; None: found out from the header.

    A name may hold `{i}` (0 … n−1 or 1 … n, whichever is there), `{joint}` (the arm's joint names) or a range such as
    `{0..6}`; without any it is the name of a list-valued column. Several names are one per joint.

    >>> ColumnSpec.of("q=pos_{i},t=stamp,t_unit=ms").t_unit
    'ms'

    Args:
        t: the column of time. q, dq, tau: those of position, velocity and torque; dq may be "none".
        t_unit: s, ms, us or ns. q_unit: rad or deg. dq_unit: rad/s or deg/s. tau_unit: Nm, or A for motor currents.
            Joints that slide are in m, m/s and N in any case.
        torque_constants: joint torque per motor current (n,) [N·m/A], where tau is in A.
        compensated: where a controller has taken gravity out of the torque, the payload it was set to carry: a file, or
            "nothing".
        rate: samples per second [Hz] of a file without times.
        episode: which one of a file that holds several.
    """

    t: str | None = None
    q: str | tuple[str, ...] | None = None
    dq: str | tuple[str, ...] | None = None
    tau: str | tuple[str, ...] | None = None
    t_unit: str | None = None
    q_unit: str | None = None
    dq_unit: str | None = None
    tau_unit: str | None = None
    torque_constants: tuple[float, ...] | None = None
    compensated: str | None = None
    rate: float | None = None
    episode: int | None = None

    def __post_init__(self) -> None:
        for key in _COLUMNS:
            unit = getattr(self, f"{key}_unit")
            if unit is not None and unit.strip().lower() not in UNITS[key]:
                raise RecordingError(f"columns: {key}_unit is {unit!r}: expected one of {', '.join(UNITS[key])}")
        if self.torque_constants is not None:
            if self.tau_unit is not None and self.tau_unit.strip().lower() != AMPERE:
                raise RecordingError(
                    f"columns: torque_constants are for motor currents [A], and tau_unit is {self.tau_unit!r}: leave "
                    "one out"
                )
            if not all(0.0 < constant < float("inf") for constant in self.torque_constants):
                raise RecordingError("columns: torque_constants must be positive numbers [N·m/A], one for each joint")
        if self.compensated is not None and self.of_currents:
            raise RecordingError(
                "columns: compensated is of torque, and tau is said to be motor current: leave one out"
            )
        if self.rate is not None and not 0.0 < self.rate < float("inf"):
            raise RecordingError(f"columns: rate is {self.rate:g}: expected a positive number of samples per second")

    @classmethod
    def of(cls, given: ColumnSpec | Mapping[str, Any] | str | Path | None) -> ColumnSpec:
        """From a mapping, from text `t=…,q=…`, or from a TOML file (its table `columns`, or the file itself).

        Raises:
            RecordingError: an unknown key, a value of the wrong kind, or a file that cannot be read.
        """
        if given is None:
            return cls()
        if isinstance(given, ColumnSpec):
            return given
        if isinstance(given, Mapping):
            return cls(**{key: _value(key, value, "columns") for key, value in given.items()})
        if isinstance(given, Path) or (given.endswith(".toml") and "=" not in given):
            table = _toml(Path(given))
            return cls(**{key: _value(key, value, str(given)) for key, value in table.items()})
        return cls(**_pairs(given))

    def given(self) -> dict[str, Any]:
        """What is not left open, as JSON can hold it; `of` reads it back."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {key: value for key, value in values.items() if value is not None}

    @property
    def of_values(self) -> ColumnSpec:
        """What it says of units of position, velocity and torque, and of none: all that a bag leaves open."""
        units = {key: getattr(self, key) for key in _OF_VALUES}
        return ColumnSpec(**units, dq=NONE if self.without_velocities else None)

    @property
    def without_velocities(self) -> bool:
        """Whether it says that there are none."""
        return self.dq == NONE

    @property
    def of_currents(self) -> bool:
        """Whether it says that tau is motor current, by its unit or by constants for it."""
        return self.torque_constants is not None or (self.tau_unit or "").strip().lower() == AMPERE

    def over(self, **more: Any) -> ColumnSpec:
        """These columns, with what is given besides.

        Raises:
            RecordingError: something is given twice, and not the same.
        """
        more = {key: value for key, value in more.items() if value is not None}
        for key, value in more.items():
            if getattr(self, key) not in (None, value):
                raise RecordingError(f"columns: {key} is given twice, as {getattr(self, key)!r} and as {value!r}")
        return replace(self, **more)


def _pairs(text: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for pair in text.split(","):
        key, equals, value = pair.partition("=")
        key, value = key.strip(), value.strip()
        if not equals or not value:
            raise RecordingError(f"columns {text!r}: {pair.strip()!r} is not KEY=VALUE: {_HINT}")
        if key in found:
            raise RecordingError(f"columns {text!r}: {key} is given twice")
        found[key] = _value(key, value, "columns")
    return found


def _toml(path: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors begin a text with a mark
    except OSError as error:
        raise RecordingError(f"columns {path} cannot be read: {error.strerror or error}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise RecordingError(f"columns {path} is not TOML: {one_line(error)[:160]}") from None
    inner = table.get("columns")
    return inner if isinstance(inner, dict) else table


def _value(key: str, value: Any, where: str) -> Any:
    """A value of the right kind; numbers may come as text."""
    known = [field.name for field in fields(ColumnSpec)]
    if key not in known:
        raise RecordingError(f"{where}: unknown key {key!r}: expected {', '.join(known)}")
    try:
        if key == "torque_constants":
            return tuple(float(x) for x in (value.split() if isinstance(value, str) else value))
        if key == "rate":
            return float(value)
        if key == "episode":
            return int(value)
    except (TypeError, ValueError, OverflowError):
        raise RecordingError(f"{where}: {key} is {str(value)[:24]!r}: expected numbers") from None
    if key in QUANTITIES and isinstance(value, (list, tuple)) and value and all(isinstance(x, str) for x in value):
        return tuple(value)
    if not isinstance(value, str) or not value.strip():
        raise RecordingError(f"{where}: {key} is {value!r}: expected the name of a column, or a unit")
    return value
