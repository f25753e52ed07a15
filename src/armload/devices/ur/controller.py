"""What a UR arm counts as its payload: read beside the stream, and told by ur-rtde's control script.

The script takes the place of the program that runs, and needs remote control. It is uploaded with the first payload of
a series and ended with the last (`done`), so that the arm is free for others in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from armload.arms import Arm
from armload.devices.counted import Counted, read_back
from armload.devices.guard import check_writable, flange_of
from armload.devices.load import Load
from armload.devices.ur.form import URPayload
from armload.devices.ur.source import load_client, load_control, unreachable
from armload.devices.ur.writer import ended_control, moves, set_load, taken_control
from armload.errors import SentError, SinkError, SourceError, one_line
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
        return Counted(dq, 0.0, self._body(mass, cog, inertia))

    def put(self, load: Load) -> None:
        """Make it count a payload, guarded; one of zero is nothing.

        Raises:
            SinkError: the payload must not be written, or the arm refused it. SentError: it was sent, and may count.
        """
        self._put(load, allow_undetermined_inertia=True, allow_nothing=True)

    def put_and_read_back(self, load: Load, *, allow_undetermined_inertia: bool) -> URPayload:
        """The same for a single payload, which the arm has to count then; what was sent. The script is ended.

        Raises:
            SinkError: nothing was sent. SentError: it was sent, and the arm counts another one or does not say.
        """
        failed: SinkError | None = None
        try:
            sent = self._put(load, allow_undetermined_inertia=allow_undetermined_inertia)
            read_back(self._body(*sent), lambda: self.counted().load)
        except SinkError as error:
            failed = error
        try:
            self.done()
        except SinkError as error:
            if failed is None:
                raise SentError(f"the arm counts the payload, but {error}") from None
            failed = type(failed)(f"{failed}; {error}")
        if failed is not None:
            raise failed
        return sent

    def _body(self, mass: float, cog: Sequence[float], inertia: Sequence[float]) -> InertialParameters:
        """A payload in the arm's own numbers, about the flange."""
        if mass <= 0.0:
            return InertialParameters.zero(self._flange)
        xx, yy, zz, xy, xz, yz = inertia
        return InertialParameters.from_com(mass, cog, inertia_matrix([xx, xy, xz, yy, yz, zz]), self._flange)

    def _put(self, load: Load, *, allow_undetermined_inertia: bool, allow_nothing: bool = False) -> URPayload:
        receive = self._reading()
        allowed: dict[str, Any] = {"write": True, "allow_undetermined_inertia": allow_undetermined_inertia}
        allowed["allow_nothing"] = allow_nothing
        if self._control is None:  # what is refused anyway must not end the program that runs
            check_writable(load, self._arm, moving=moves(receive), **allowed)
            self._control = taken_control(self._controls, self._address)
        return set_load(self._control, receive, load, self._arm, **allowed)

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
