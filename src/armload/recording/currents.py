"""Units that are said of a log, and motor currents: the torque of an ampere, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload.arms import ARMS, Arm
from armload.errors import RecordingError
from armload.recording.aliases import QUANTITIES, UNITS
from armload.recording.column_spec import ColumnSpec


def of_currents(where: str, constants: Sequence[float], by: str = "") -> str:
    """A note of what the torque was made of; `by`: where the constants come from."""
    shown = " ".join(f"{constant:.4g}" for constant in constants)
    return f"{where}: torque is motor current times {shown} N·m/A{by}, with the gears' friction in it"


def torque_constants(spec: ColumnSpec, arm: Arm | None, n: int, where: str) -> tuple[float, ...] | None:
    """Joint torque per motor current (n,) [N·m/A]: the user's, or those of the arm's sheet; None: not known.

    Raises:
        RecordingError: the user's are not one per joint.
    """
    facts = None if arm is None else ARMS.get(arm.known_as or arm.name)
    constants = spec.torque_constants or (None if facts is None else facts.torque_constants)
    if constants is not None and len(constants) != n:
        raise RecordingError(f"{where}: {len(constants)} torque constants for {n} joints: expected one per joint")
    return constants


def no_constants(where: str, what: str, arm: Arm | None, n: int, instead: str = "") -> RecordingError:
    """That nobody knows the torque of an ampere; `instead`: what else would tell it."""
    called = "this arm" if arm is None else arm.name
    return RecordingError(
        f"{where}: {what} motor currents [A], and no torque constants are known for {called}: {instead}give {n} "
        "numbers in N·m/A, from a scale test with a known load, with "
        f'--columns "torque_constants=K1 … K{n}"'
    )


def factors(key: str, unit: str | None, arm: Arm | None, n: int) -> tuple[float, ...]:
    """What a quantity of n joints in a unit is multiplied with (n,) to be in rad, rad/s or N·m.

    What is said of angles holds of the joints that turn: those of the arm that slide are in m and m/s.
    """
    factor = 1.0 if unit is None else UNITS[key][unit.strip().lower()]
    if arm is None or arm.n != n or key == "tau":
        return (factor,) * n
    return tuple(1.0 if slides else factor for slides in arm.limits.slides)


def in_si(spec: ColumnSpec, arm: Arm | None, n: int, where: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """What the values of a message (3n,) are multiplied with to be in rad, rad/s, N·m, and a note on currents.

    Raises:
        RecordingError: they are motor currents, of constants that nobody knows.
    """
    scale = np.ones((3, n))
    for row, key in zip(scale, QUANTITIES, strict=True):
        row *= factors(key, getattr(spec, f"{key}_unit"), arm, n)
    if not spec.of_currents:
        return scale.ravel(), ()
    constants = torque_constants(spec, arm, n, where)
    if constants is None:
        raise no_constants(where, "efforts are", arm, n)
    scale[2] = constants
    return scale.ravel(), (of_currents(where, constants),)
