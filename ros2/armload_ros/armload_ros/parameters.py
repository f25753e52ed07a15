"""The node's parameters, and the arm, tool and tare that they name."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from armload import Recording, arm, read_payload, read_recording
from armload.arms import Arm
from armload.devices.ros2 import Effort
from armload.errors import UsageError
from armload.identification import check_usable, plausible_tool, with_tool
from armload.identification.known_options import KnownOptions
from armload.identification.tare_age import age_of, seconds_of
from armload.inertia import InertialParameters
from armload.payloads import NOTHING
from armload.posterior import Known, Profile, load_profile
from armload.recording import has_topics

DEFAULTS: dict[str, Any] = {
    "robot": "panda",
    "frame": "",
    "gravity": [0.0, 0.0, -9.81],
    "method": "",
    "tool": "",
    "tare": "",
    "tare_age": "",
    "profile": "",
    "mass": "",
    "com": "",
    "body": "",
    "family": "",
    "steady": False,
    "torque_constants": [0.0],
    "compensated": "",
    "tare_duration": 20.0,
    "rate": 10.0,
    "timeout": 2.0,
    "com_frame": "payload_com",
    "apply": "",
    "apply_auto": False,
    "mounted": "",
    "counted": "",
    "end_effector": 0.0,
    "touch_links": [""],
}


_ABOVE_ZERO = ("tare_duration", "rate", "timeout")


def as_declared(given: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as given, each of its default's kind: YAML takes 10 for an integer, and a mass of 1.2 for a number.

    Raises:
        UsageError: one is of another kind or cannot be; it says which.
    """
    return {name: _as_declared(name, given[name], default) for name, default in DEFAULTS.items()}


def _as_declared(name: str, value: Any, default: Any) -> Any:
    if isinstance(default, bool):
        fits, expected, made = isinstance(value, bool), "true or false", bool
    elif isinstance(default, str):  # a mass of 1.2 lacks its error, and is refused as such later
        fits, expected, made = isinstance(value, str) or _is_number(value), "text", str
    elif isinstance(default, float):
        above = name in _ABOVE_ZERO
        fits = _is_number(value) and (value > 0.0 if above else value >= 0.0)
        expected, made = "a number above 0" if above else "a number of 0 or more", float
    elif isinstance(default[0], float):
        fits = _is_list(value) and all(map(_is_number, value))
        expected, made = "a list of numbers", lambda values: [float(x) for x in values]
    else:
        fits = _is_list(value) and all(isinstance(x, str) for x in value)
        expected, made = "a list of texts", list
    if not fits:
        raise UsageError(f"the parameter {name} is {value!r}: expected {expected}")
    return made(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


class Parameters:
    """Makes what they name.

    Args:
        value: gives one by its name.
    """

    def __init__(self, value: Callable[[str], Any]) -> None:
        self.value = value

    def bare_arm(self) -> Arm:
        """The arm without a tool, a new one each time."""
        return arm(self.value("robot"), self.value("frame") or None, gravity=tuple(self.value("gravity")))

    def with_tool(self, bare: Arm) -> Arm:
        """The arm with what is mounted and known."""
        path = self.value("tool")
        return bare if path in ("", NOTHING) else with_tool(bare, read_payload(path))

    def mounted(self, bare: Arm) -> InertialParameters | None:
        """What answers lack; None: nobody says."""
        return self._body("mounted" if self.value("mounted") else "tool", bare)

    def counted(self, bare: Arm) -> InertialParameters | None:
        """What the controller counts before it is told anything."""
        return self._body("counted", bare)

    def effort(self, robot: Arm) -> Effort:
        """What `effort` is on the topic of the joint states."""
        return Effort(robot, **self._of_effort())

    def tare(self, robot: Arm) -> Recording | None:
        """The log of the arm before the payload was mounted."""
        if not (path := self.value("tare")):
            return None
        tare = read_recording(path, robot, columns=self._of_effort() if has_topics(path) else None)
        check_usable(tare, robot)  # also whether gravity was in it, as in what armload has recorded of such a topic
        return tare

    def tare_age(self, tare: Recording | None) -> tuple[float, tuple[str, ...]]:
        """How old that is [s] as the stream begins, and what is to be said of it."""
        stated = self.value("tare_age")
        if stated and tare is None:
            raise UsageError("tare_age says how old a tare is, but there is no tare")
        return age_of(tare, time.time(), seconds_of(stated) if stated else None)

    def profile(self) -> Profile | None:
        """What was learned of the arm from many logs."""
        return load_profile(self.value("profile")) if self.value("profile") else None

    def known(self, robot: Arm) -> Known | None:
        """What is known of a payload apart from the stream."""
        said = {name: self.value(name) or None for name in ("mass", "com", "body", "family")}
        return KnownOptions(**said).known_on(robot)

    def _of_effort(self) -> dict[str, Any]:
        """What the parameters say of it, of the topic and of a bag of it."""
        constants, compensated = tuple(self.value("torque_constants")), self.value("compensated")
        given = {"torque_constants": constants if any(constants) else None, "compensated": compensated or None}
        return {key: value for key, value in given.items() if value is not None}

    def _body(self, name: str, bare: Arm) -> InertialParameters | None:
        path = self.value(name)
        if not path:
            return None
        if path == NOTHING:
            return InertialParameters.zero(bare.frame)
        return plausible_tool(bare.in_frame(read_payload(path).parameters), bare)
