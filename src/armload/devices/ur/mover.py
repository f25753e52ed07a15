"""A UR arm that is moved: `servoJ` of ur-rtde, one target per state, 500 times a second.

Opening reads only. A movement uploads ur-rtde's control script, which replaces the program that runs, and needs remote
control; the script ends with the movement, so that the arm is free for the pendant in between. `set_watchdog` makes the
controller end the script, and so stop the arm, should no target come for `_WATCHDOG`: whatever ends this process or the
network between.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.devices.load import Load
from armload.devices.mover import Movement, StreamedMover
from armload.devices.supervision import Thresholds
from armload.devices.ur import modes, writer
from armload.devices.ur.controller import URController
from armload.devices.ur.source import URSource, load_control
from armload.errors import ArmloadError, SafetyError, SinkError, SourceError, one_line
from armload.motion import Motion
from armload.recording import Sample

_CYCLE = 2e-3  # [s] of an e-series controller
_LOOKAHEAD, _GAIN = 0.1, 300.0  # [s, 1] of servoj: UR's defaults, as in the exported programs
_WATCHDOG = 2.0  # [Hz] least frequency of targets: servoj stands at the last one, 0.5 s later its script ends
_STOPJ = 4.0  # [rad/s²] deceleration of an arm that is at rest already


class URMover(StreamedMover):
    """A UR arm of the e-series that follows motions.

    Args:
        address, arm, torque_constants: see `URSource`.

    Raises:
        SourceError: ur-rtde is not installed, the constants are not known, or the robot cannot be reached.
    """

    writes = True
    # states and targets go on in a protective stop and behind the slider
    see = "see on its pendant whether it is stopped or paused, and that its speed slider is at 100 %"

    def __init__(self, address: str, arm: Arm, torque_constants: Sequence[float] | None = None) -> None:
        super().__init__(arm)
        self._address, self._control = address, None
        load_control()  # what is missing is said before anything moves
        self._source = URSource(address, arm, torque_constants, ("target_q", *modes.FIELDS))
        self.name, self.rate = self._source.name, self._source.rate
        self._sent: float | None = None  # when the newest target was, on our clock [s]

    def __iter__(self) -> Iterator[Sample]:
        for sample in self._source:
            movement = self._took(sample, partial(float, sample.t))
            if movement is not None and movement.begun is not None:
                t = sample.t - movement.begun
                self._brakes(movement, t)
                self._servo(movement.target(t + _CYCLE))
            elif self._control is not None:
                self._release()
            yield sample

    def hindrance(self) -> str | None:
        """What its modes and its speed slider say."""
        return modes.hindrance(self._source.client)

    def commanded(self) -> NDArray[np.float64]:
        """Where the controller holds the arm, q (n,) [rad]."""
        return np.array(self._source.client.getTargetQ())

    def follow(self, motion: Motion, thresholds: Thresholds | None = None) -> None:
        """Begin a movement with the next state."""
        super().follow(motion, thresholds)
        self._sent = None
        try:
            self._control = load_control()(self._address, 1.0 / _CYCLE)
            self._control.setWatchdog(_WATCHDOG)
        except Exception as error:
            self._movement = None
            with contextlib.suppress(ArmloadError):  # why it does not is said, not what came of it
                self._release()
            raise SafetyError(
                f"{self.name} does not take movements ({one_line(error)}): switch it on, release its brakes, and set "
                "it to remote control"
            ) from None

    def write(self, load: Load, *, allow_undetermined_inertia: bool = False) -> Any:
        """Tell the controller the load, guarded (`writer.set_load`), read it back, and return the arguments.

        Raises:
            SinkError: the load must not be written. SentError: it was sent, and the robot may count another one.
        """
        controller = URController(self._address, self.arm)
        try:
            return controller.put_and_read_back(load, allow_undetermined_inertia=allow_undetermined_inertia)
        except SourceError as error:
            raise SinkError(str(error)) from None
        finally:
            controller.close()

    def arrived(self) -> float | None:
        """When the client had the values handed on last."""
        return self._source.arrived()

    def close(self) -> None:
        """Let go of the robot."""
        try:
            self._release()
        finally:
            self._source.close()

    def _servo(self, q: NDArray[np.float64]) -> None:
        if self._control is None:  # it was let go of on its way, by `close`
            raise SourceError(f"{self.name} was closed while the arm was on its way")
        before, now = self._sent, time.monotonic()
        self._sent = now
        if not self._control.servoJ(q.tolist(), 0.0, 0.0, _CYCLE, _LOOKAHEAD, _GAIN):
            silent = time.monotonic() - (now if before is None else before)
            if silent > 1.0 / _WATCHDOG:
                raise SourceError(
                    f"{self.name} was stopped by its watchdog: no target was sent for {silent:.2f} s, expected less "
                    f"than {1.0 / _WATCHDOG:g} s (this process did not run); see what held it up, and give this "
                    "machine less other work"
                )
            raise SourceError(f"{self.name} takes no more targets: its program has stopped; look at its pendant")

    def _went_on(self, movement: Movement, passed: float) -> None:
        """Servoj has stood at the last target: the next one is a cycle along the path, however late it is."""
        assert movement.begun is not None
        movement.begun += passed - _CYCLE

    def _release(self) -> None:
        control, self._control = self._control, None
        if control is None:
            return
        try:
            control.servoStop(_STOPJ)
        except Exception as error:  # the watchdog stops the arm in any case
            raise SourceError(f"{self.name} cannot be told to stand still: {one_line(error)}") from None
        finally:
            writer.ended_control(control, self._address)
