"""Writing a payload to a Universal Robots arm: guarded `setTargetPayload`, everything on the flange."""

from __future__ import annotations

import contextlib
from typing import Any, Protocol

from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.devices.guard import check_writable, stands_still
from armload.devices.load import Load
from armload.devices.ur.form import URPayload, ur_payload
from armload.errors import SentError, SinkError, one_line
from armload.identification import Identification


class URControl(Protocol):
    """What is needed of ur-rtde's `RTDEControlInterface`."""

    def setTargetPayload(self, mass: float, cog: list[float], inertia: list[float], /) -> Any:
        """Tell the controller the payload; False if it did not take it."""


class URReceive(Protocol):
    """What is needed of ur-rtde's `RTDEReceiveInterface`."""

    def getActualQd(self) -> ArrayLike:
        """Measured joint velocities [rad/s]."""
        ...

    def isConnected(self) -> bool:
        """Whether the connection is up; if not, the velocities are old."""
        ...


def taken_control(client: Any, address: str) -> Any:
    """A connection that commands an arm: its script is uploaded, and ends with `ended_control`.

    Raises:
        SinkError: the arm is not to be commanded from here.
    """
    try:
        return client(address)
    except Exception as error:  # the vendor's own exceptions have no common base
        raise SinkError(
            f"the UR arm at {address} takes no payload ({one_line(error)}): set it to remote control"
        ) from None


def ended_control(control: Any, address: str) -> None:
    """End the script and the connection.

    Raises:
        SinkError: nobody can say whether it has ended.
    """
    try:
        try:
            control.stopScript()
        finally:
            control.disconnect()
    except Exception as error:
        raise SinkError(
            f"the script on the UR arm at {address} cannot be ended ({one_line(error)}): see whether it runs"
        ) from None


def set_load(
    control: URControl,
    receive: URReceive,
    result: Load | Identification,
    arm: Arm,
    *,
    write: bool = False,
    flange: str | None = None,
    allow_undetermined_inertia: bool = False,
    allow_nothing: bool = False,
) -> URPayload:
    """Tell a Universal Robots arm what is on its flange, and return the arguments that were sent.

    Its controller knows of no tool beside the payload: a load relative to a tool or a tare lacks what was mounted then,
    and is refused until that is added.

    Args:
        control, receive: the vendor's clients.
        result: what was identified.
        arm: the robot's arm.
        write, flange, allow_undetermined_inertia, allow_nothing: see `check_writable`.

    Raises:
        SinkError: the load must not be written (see `check_writable`). SentError: the robot refused it, or was lost.
    """
    payload = ur_payload(
        check_writable(
            result,
            arm,
            moving=moves(receive),
            write=write,
            flange=flange,
            allow_undetermined_inertia=allow_undetermined_inertia,
            allow_nothing=allow_nothing,
        )
    )
    try:
        taken = control.setTargetPayload(*payload)
    except Exception as error:
        raise SentError(_not_taken(receive, one_line(error))) from error
    if taken is False:
        raise SentError(_not_taken(receive, "setTargetPayload returned False"))
    return payload


def moves(receive: URReceive) -> bool:
    """Whether the arm moves, within a tenth of a second.

    Raises:
        SinkError: nobody can say.
    """
    try:
        if not receive.isConnected():  # the client would go on giving its last values
            raise ConnectionError("the connection is lost")
        return not stands_still(receive.getActualQd)
    except Exception as error:  # the vendor's own exceptions have no common base
        raise SinkError(f"the robot's state cannot be read, so no payload is written: {one_line(error)}") from error


def _not_taken(receive: URReceive, why: str) -> str:
    """What to say of a payload that was sent, and not confirmed."""
    with contextlib.suppress(Exception):
        if receive.isConnected():
            return (
                f"the robot refused the payload: {why}; see on its pendant what stops it, and which payload it counts"
            )
    return f"the robot was lost while the payload was sent ({why}): see on its pendant which payload it counts"
