"""What a log says of an arm beyond its columns: turns that are counted on, gravity that is put back."""

from __future__ import annotations

from dataclasses import replace

from armload.arms import Arm
from armload.errors import RecordingError
from armload.payloads import NOTHING
from armload.recording.column_spec import ColumnSpec
from armload.recording.compensated import arm_as_set, with_gravity
from armload.recording.recording import Recording
from armload.recording.turns import Turns


class OfArm:
    """Makes of the chunks of a log, as they are read, those of an arm.

    Args:
        arm: whose log it is, where known. spec: what the user says of it. where: the file, for messages.

    Raises:
        RecordingError: gravity is to be put back, and nobody says of which arm. PayloadError: the payload that its
            controller was set to carry cannot be read.
    """

    def __init__(self, arm: Arm | None, spec: ColumnSpec, where: str) -> None:
        if spec.compensated is not None and arm is None:
            raise RecordingError(f"{where}: gravity is put back for an arm: name it, or leave `compensated` out")
        self._turns = None if arm is None else Turns(arm)
        self._set = None if arm is None or spec.compensated is None else arm_as_set(arm, spec.compensated)
        self._carries = spec.compensated

    def of(self, recording: Recording) -> Recording:
        """The next chunk."""
        recording = recording if self._turns is None else self._turns.of(recording)
        if self._set is None:
            return recording
        also = "" if self._carries == NOTHING else f" and of {self._carries}"
        note = f"{recording.source}: gravity was put back into the torque, of the arm{also}"
        return replace(with_gravity(recording, self._set), notes=(*recording.notes, note))
