"""What a UR arm counts as its payload: read beside the stream, and told by ur-rtde's control script.

The script takes the place of the program that runs, and needs remote control. It is uploaded with the first payload of
a series and ended with the last (`done`), so that the arm is free for others in between.
"""

from __future__ import annotations

from typing import Any

from armload.arms import Arm
from armload.devices.counted import Counted
from armload.devices.guard import flange_of
from armload.devices.load import Load
from armload.devices.ur.source import load_client, load_control, unreachable
from armload.devices.ur.writer import ended_control, set_load, taken_control
from armload.errors import SourceError, one_line
from armload.inertia import InertialParameters, inertia_matrix

_FIELDS = ["timestamp", "actual_qd", "payload", "payload_cog", "payload_inertia"]
_RATE = 125.0  # [Hz] of what is read


class URController:
    """An arm, read over a connection of its own.

    Args:
        address: host name or IP address. arm: it.

    Raises:
        SourceError: ur-rtde is not installed.
    """

    def __init__(self, address: str, arm: Arm) -> None:
        self._address, self._arm, self._flange = address, arm, flange_of(arm)
        self._receives, self._controls = load_client(), load_control()
        self._receive: Any = None
        self._control: Any = None

    def counted(self) -> Counted:
        """Its present state; the arm counts no end effector beside the payload.

        Raises:
            SourceError: it does not answer.
        """
        receive = self._reading()
        try:
            mass, cog, inertia = receive.getPayload(), receive.getPayloadCog(), receive.getPayloadInertia()
            dq = list(receive.getActualQd())
        except Exception as error:
            self._receive = None
            raise SourceError(f"the UR arm at {self._address} was lost: {one_line(error)}") from None
        load = InertialParameters.zero(self._flange)
        if mass > 0.0:
            xx, yy, zz, xy, xz, yz = inertia
            about = inertia_matrix([xx, xy, xz, yy, yz, zz])
            load = InertialParameters.from_com(mass, cog, about, self._flange)
        return Counted(dq, 0.0, load)

    def put(self, load: Load) -> None:
        """Make it count a payload, guarded; one of zero is nothing.

        Raises:
            SinkError: the payload must not be written, or the arm refused it.
        """
        receive = self._reading()
        if self._control is None:
            self._control = taken_control(self._controls, self._address)
        set_load(
            self._control, receive, load, self._arm, write=True, allow_undetermined_inertia=True, allow_nothing=True
        )

    def done(self) -> None:
        """End the script: nothing more is written for a while.

        Raises:
            SinkError: nobody can say whether it has ended.
        """
        control, self._control = self._control, None
        if control is not None:
            ended_control(control, self._address)

    def close(self) -> None:
        """Let go of the arm.

        Raises:
            SinkError: see `done`.
        """
        receive, self._receive = self._receive, None
        try:
            self.done()
        finally:
            if receive is not None:
                receive.disconnect()

    def _reading(self) -> Any:
        if self._receive is not None and not self._receive.isConnected():
            self._receive = None
        if self._receive is None:
            try:
                self._receive = self._receives(self._address, _RATE, _FIELDS)
            except Exception as error:
                raise SourceError(unreachable(self._address, one_line(error))) from None
        return self._receive
