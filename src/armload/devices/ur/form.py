"""Universal Robots' forms: URScript's `set_target_payload` and the older `set_payload`.

The payload is everything on the tool flange (`tool0`), the gripper included. `set_target_payload(m, cog, inertia)`
takes the inertia about the centre of gravity, in the flange's axes, as [Ixx, Iyy, Izz, Ixy, Ixz, Iyz];
`set_payload(m, cog)` knows no inertia and is deprecated since software 5.10. Source: the URScript manual (5.20, 10.6).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armload.devices.load import Load, counted_numbers
from armload.inertia import InertialParameters


class URPayload(NamedTuple):
    """`set_target_payload(m, cog, inertia)`: [kg], (3,) [m], (6,) xx yy zz xy xz yz [kg·m²]."""

    mass: float
    cog: list[float]
    inertia: list[float]


def ur_payload(parameters: InertialParameters) -> URPayload:
    """The arguments of `set_target_payload` for parameters about the tool flange.

    >>> load = InertialParameters.from_com(2.0, (0, 0, 0.1), [[1, 2e-1, 0], [2e-1, 2, 0], [0, 0, 2.5]])
    >>> ur_payload(load).inertia
    [1.0, 2.0, 2.5, 0.2, 0.0, 0.0]
    """
    numbers = counted_numbers(parameters, "ur")
    return URPayload(numbers[0], numbers[1:4], numbers[4:])


def set_target_payload_text(load: Load) -> str:
    """One line of URScript, for a program or the script interface (TCP 30002)."""
    mass, cog, inertia = ur_payload(load.parameters)
    return _script(load, f"set_target_payload({_plain(mass)}, {_plain(*cog)}, {_plain(*inertia)})")


def set_payload_text(load: Load) -> str:
    """The same for controllers before software 5.10: mass and centre of gravity only."""
    mass, cog, _ = ur_payload(load.parameters)
    return _script(load, f"set_payload({_plain(mass)}, {_plain(*cog)})")


def _script(load: Load, call: str) -> str:
    return "\n".join([*(f"# {line}" for line in load.description()), call, ""])


def _plain(*numbers: float) -> str:
    """A number, or a list of several, without exponents."""
    text = [np.format_float_positional(x, trim="0") for x in numbers]
    return text[0] if len(text) == 1 else f"[{', '.join(text)}]"
