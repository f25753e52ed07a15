"""Writing a load to a Franka robot: guarded `set_load`, on top of the end effector its Desk has."""

from __future__ import annotations

import contextlib
from typing import Any, Protocol

from armload.arms import Arm
from armload.devices.franka.form import FrankaLoad, franka_load
from armload.devices.guard import check_writable, stands_still
from armload.devices.load import Load
from armload.errors import SentError, SinkError, one_line
from armload.identification import Identification


class FrankaClient(Protocol):
    """What is needed of a `Robot` of pylibfranka (FR3) or panda_py.libfranka (Panda)."""

    def read_once(self) -> Any:
        """The robot's state, with `dq` and `m_ee`."""

    def set_load(self, mass: float, com: list[float], inertia: list[float], /) -> Any:
        """Tell the controller the load."""


def set_load(
    robot: FrankaClient,
    result: Load | Identification,
    arm: Arm,
    *,
    write: bool = False,
    flange: str | None = None,
    allow_undetermined_inertia: bool = False,
    allow_nothing: bool = False,
) -> FrankaLoad:
    """Tell a Franka robot what it holds, and return the arguments that were sent.

    The robot's own state says whether it stands still, and whether it counts an end effector beside the load: it must
    count nothing twice, and nothing that is mounted not at all.

    Args:
        robot: the vendor's client.
        result: what was identified.
        arm: the robot's arm.
        write, flange, allow_undetermined_inertia, allow_nothing: see `check_writable`.

    Raises:
        SinkError: the load must not be written (see `check_writable`). SentError: the robot refused it, or was lost.
    """
    try:
        end_effector = float(robot.read_once().m_ee)
        moving = not stands_still(lambda: robot.read_once().dq)
    except Exception as error:  # the vendor's own exceptions have no common base
        raise SinkError(f"the robot's state cannot be read, so no load is written: {one_line(error)}") from error
    load = franka_load(
        check_writable(
            result,
            arm,
            moving=moving,
            end_effector=end_effector,
            write=write,
            flange=flange,
            allow_undetermined_inertia=allow_undetermined_inertia,
            allow_nothing=allow_nothing,
        )
    )
    try:
        robot.set_load(*load)
    except Exception as error:
        raise SentError(_not_taken(robot, one_line(error))) from error
    return load


def _not_taken(robot: FrankaClient, why: str) -> str:
    """What to say of a load that was sent, and not confirmed."""
    with contextlib.suppress(Exception):
        robot.read_once()
        return f"the robot refused the load: {why}; see in Desk what stops it, and which load it counts"
    return f"the robot was lost while the load was sent ({why}): see in Desk which load it counts"
