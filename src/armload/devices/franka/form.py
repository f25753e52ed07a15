"""Franka's forms: the three arguments of `setLoad`, and an end effector for Desk.

Both want the centre of mass in the flange frame (`panda_link8`, `fr3_link8`: link 7 + 0.107 m along z) and the inertia
about the centre of mass in the flange's axes, nine numbers **column by column**. A load counts on top of the end
effector that Desk has: what Desk counts already must be taken off. Sources: libfranka, `Robot::setLoad`; Franka's "End
effector commissioning" (RIDE CLI 1.1.1: `endeffector-config.json` with mass, centerOfMass, inertia and transformation,
matrices column based) and the file of that name in frankaemika/external_gripper_example.
"""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np

from armload.devices.load import Load, counted_numbers
from armload.inertia import InertialParameters


class FrankaLoad(NamedTuple):
    """`setLoad(mass, F_x_Cload, load_inertia)`: [kg], (3,) [m], (9,) column by column [kg·m²]."""

    mass: float
    com: list[float]
    inertia: list[float]


def franka_load(parameters: InertialParameters) -> FrankaLoad:
    """The arguments of `setLoad` for parameters about the flange.

    >>> load = InertialParameters.from_com(2.0, (0, 0, 0.1), [[1, 2e-1, 0], [2e-1, 2, 0], [0, 0, 2.5]])
    >>> franka_load(load).inertia
    [1.0, 0.2, 0.0, 0.2, 2.0, 0.0, 0.0, 0.0, 2.5]
    """
    numbers = counted_numbers(parameters, "franka")
    return FrankaLoad(numbers[0], numbers[1:4], numbers[4:])


def set_load_text(load: Load) -> str:
    """Python for a robot at rest: `robot` is a `Robot` of pylibfranka (FR3) or panda_py.libfranka (Panda)."""
    mass, com, inertia = franka_load(load.parameters)
    return "\n".join(
        [
            *(f"# {line}" for line in load.description()),
            f"mass = {mass!r}  # [kg]",
            f"F_x_Cload = {com!r}  # [m] centre of mass in the flange frame",
            f"load_inertia = {inertia!r}  # [kg·m²] about it, in the flange's axes, column by column",
            "robot.set_load(mass, F_x_Cload, load_inertia)  # at rest only",
            "",
        ]
    )


def desk_text(load: Load) -> str:
    """An end effector as JSON, for Desk's settings: a load about the flange as the end effector itself.

    Its frame, the tool centre point, is the flange: where another one is known, it is entered in Desk.
    """
    mass, com, inertia = franka_load(load.parameters)
    content = {"mass": mass, "centerOfMass": com, "inertia": inertia, "transformation": np.eye(4).ravel().tolist()}
    return json.dumps(content) + "\n"
