"""Writing a load to a Franka robot: guarded `set_load`, on top of the end effector its Desk has."""

from __future__ import annotations

from typing import Any, Protocol

from armload.arms import Arm
from armload.errors import SinkError
from armload.identify import Identification
from armload.sinks.franka import FrankaLoad, franka_load
from armload.sinks.guard import check_writable, reason_of, require_standstill
from armload.sinks.load import Load


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
) -> FrankaLoad:
    """Tell a Franka robot what it holds, and return what was told.

    The robot's own state says whether it stands still, and whether it has an end effector of its own: a load relative
    to the bare arm contains that, and the controller would count it twice.

    Args:
        robot: the vendor's client.
        result: what was identified.
        arm: the robot's arm.
        write, flange, allow_undetermined_inertia: see `check_writable`.

    Raises:
        SinkError: the load must not be written (see `check_writable`), or the robot refused it.
    """
    parameters = check_writable(
        result,
        arm,
        moving=False,
        write=write,
        flange=flange,
        allow_undetermined_inertia=allow_undetermined_inertia,
    )
    try:
        state = robot.read_once()
        speed, end_effector = state.dq, float(getattr(state, "m_ee", 0.0))
    except Exception as error:  # the vendor's own exceptions have no common base
        raise SinkError(f"the robot's state cannot be read, so no load is written: {reason_of(error)}") from error
    require_standstill(speed)
    if end_effector > 0 and Load.of(result).relative_to == "arm":
        raise SinkError(
            f"the robot counts an end effector of {end_effector:.3g} kg already, and the load, relative to the bare "
            "arm, contains it: take it off (Load.of(result) - hand), or identify with it as the tool"
        )
    if arm.rated_payload is not None and parameters.mass + end_effector > arm.rated_payload:
        raise SinkError(
            f"the load weighs {parameters.mass:.3f} kg and the end effector {end_effector:.3f} kg: {arm.name} is rated "
            f"for {arm.rated_payload:g} kg together"
        )
    told = franka_load(parameters)
    try:
        robot.set_load(*told)
    except Exception as error:
        raise SinkError(f"the robot refused the load: {reason_of(error)}") from error
    return told
