"""A Franka robot that is moved: joint positions, one a millisecond, to its own joint impedance controller.

An FR3 through pylibfranka's `start_joint_position_control`, a Panda through panda-python's `control_joint_position`,
which calls back for each command and is turned inside out here (`_Called`). The robot ends a motion by itself, with its
brake ramp, when commands stay away for 20 ms, jump, or pass a limit; a movement of armload's keeps the limits of
acceleration and jerk (`Course`), but a busy machine may be late: use a real-time kernel.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.devices.counted import read_back
from armload.devices.franka import writer
from armload.devices.franka.controller import body_of
from armload.devices.franka.source import FrankaSource, load_client
from armload.devices.guard import flange_of
from armload.devices.load import Load
from armload.devices.mover import StreamedMover
from armload.devices.supervision import Thresholds
from armload.errors import SafetyError, SourceError, one_line
from armload.inertia import InertialParameters
from armload.motion import Motion
from armload.recording import Sample

_CYCLE = 1e-3  # [s]
_LATE = 0.01  # [s] a target may be late, half of what the robot bears
_SILENCE = 1.0  # [s] without a state after which the robot counts as lost
# robot modes, by the end of their names in both clients, in which no motion is taken
_HELD = {
    "Guiding": "it is guided by hand; let go of its buttons, and switch Desk to execution",
    "Reflex": "a reflex has stopped it; acknowledge it in Desk",
    "UserStopped": "its user stop is pressed; release it",
    "AutomaticErrorRecovery": "it recovers from an error; wait until that is over",
}
_UNFILTERED = 1000.0  # [Hz] cut-off frequency at which libfranka leaves commands as they are


class FrankaMover(StreamedMover):
    """A Franka robot that follows motions.

    Args:
        address, arm, system: see `FrankaSource`.

    Raises:
        SourceError: the client is not installed, or the robot cannot be reached.
    """

    writes = True

    def __init__(self, address: str, arm: Arm, system: str = "fr3") -> None:
        super().__init__(arm)
        self._client = load_client(system)
        self._source = FrankaSource(address, arm, system, realtime=True)
        self.name, self.rate = self._source.name, self._source.rate
        self._control: Any = None
        self._target: NDArray[np.float64] | None = None
        self._mode: str | None = None
        self._arrived: float | None = None
        self._closed = False

    def __iter__(self) -> Iterator[Sample]:
        while not self._closed:
            state = self._state()
            self._arrived, self._target = time.monotonic(), np.array(state.q_d)
            self._mode = state.robot_mode.name
            sample = Sample(state.time.to_sec(), np.array(state.q), np.array(state.dq), np.array(state.tau_J))
            movement = self._took(sample, partial(float, sample.t))
            if self._control is not None:
                if movement is None or movement.begun is None:
                    self._write(self._goal, finished=True)
                else:
                    t = sample.t - movement.begun
                    self._brakes(movement, t)
                    self._write(movement.target(t + _CYCLE))
            yield sample

    def hindrance(self) -> str | None:
        """What its mode says."""
        mode: str = self._mode or self._source.state().robot_mode.name
        return _HELD.get(mode.removeprefix("k"))

    def commanded(self) -> NDArray[np.float64]:
        """Where the controller holds the arm, q (n,) [rad]."""
        if self._target is None:
            self._target = np.array(self._source.state().q_d)
        return self._target

    def follow(self, motion: Motion, thresholds: Thresholds | None = None) -> None:
        """Begin a movement with the next state."""
        super().follow(motion, thresholds)
        self._goal = self.commanded()
        try:
            robot = self._source.robot
            if hasattr(robot, "start_joint_position_control"):
                self._control = robot.start_joint_position_control(self._client.ControllerMode.JointImpedance)
            else:
                self._control = _Called(robot, self._client)
        except Exception as error:
            self._movement = None
            raise SafetyError(
                f"{self.name} does not take movements ({one_line(error)}): unlock its joints, activate FCI, and "
                "acknowledge errors in Desk"
            ) from None

    def write(self, load: Load, *, allow_undetermined_inertia: bool = False) -> Any:
        """Tell the controller the load, guarded (`writer.set_load`), read it back, and return the arguments.

        Raises:
            SinkError: the load must not be written. SentError: it was sent, and the robot may count another one.
        """
        robot, allowed = self._source.robot, allow_undetermined_inertia
        sent = writer.set_load(robot, load, self.arm, write=True, allow_undetermined_inertia=allowed)
        flange = flange_of(self.arm)

        def counted() -> InertialParameters:
            status = self._source.read_once()
            return body_of(status.m_load, status.com_load, status.inertia_load, flange)

        read_back(body_of(*sent, flange), counted)
        return sent

    def arrived(self) -> float | None:
        """When the client had the state handed on last."""
        return self._arrived

    def close(self) -> None:
        """Let go of the robot; one that moves still brakes by itself."""
        self._closed = True
        self._control = None
        self._source.close()

    def _state(self) -> Any:
        if self._control is None:
            return self._source.state()
        try:
            return self._control.readOnce()[0]
        except Exception as error:
            raise self._ended(error) from None

    def _ended(self, error: Exception) -> SourceError:
        """What to say where the client reports that the robot moves no more: a reflex, a button, a lost connection."""
        return SourceError(
            f"{self.name} stopped by itself: {one_line(error)}; see in Desk what stopped it and acknowledge it "
            "there, or see to its cable where it is not heard any more"
        )

    def _write(self, q: NDArray[np.float64], finished: bool = False) -> None:
        self._goal = q
        target = self._client.JointPositions(q.tolist())
        target.motion_finished = finished
        try:
            self._control.writeOnce(target)
        except Exception as error:
            raise self._ended(error) from None
        if finished:
            self._control = None


class _Called:
    """panda-python's control, which calls back for each command, as pylibfranka's, which is asked and told.

    The call runs in a thread of its own; what is called waits for the next target, and holds the last one should none
    come in time.
    """

    def __init__(self, robot: Any, client: Any) -> None:
        self._robot, self._client = robot, client
        self._states: queue.Queue[Any] = queue.Queue()
        self._targets: queue.Queue[Any] = queue.Queue()
        self._last: Any = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def readOnce(self) -> tuple[Any, None]:
        """The newest state; what ended the control is raised."""
        try:
            first = self._states.get(timeout=_SILENCE)
        except queue.Empty:
            raise SourceError(f"no state for {_SILENCE:g} s") from None
        state = _newest(self._states, first)
        if isinstance(state, Exception):
            raise state
        return state, None

    def writeOnce(self, target: Any) -> None:
        """The command for that state; returns when the robot has taken the last one."""
        _newest(self._targets, None)  # what came too late for its state would delay all that follow
        self._targets.put(target)
        if target.motion_finished:
            self._thread.join(_SILENCE)

    def _run(self) -> None:
        try:
            mode = self._client.ControllerMode.kJointImpedance
            self._robot.control_joint_position(self._next, mode, False, _UNFILTERED)
        except Exception as error:
            self._states.put(error)

    def _next(self, state: Any, _: Any) -> Any:
        self._states.put(state)
        try:
            self._last = self._targets.get(timeout=_LATE)
        except queue.Empty:
            if self._last is None:
                self._last = self._client.JointPositions(list(state.q_d))
        return self._last


def _newest(waiting: queue.Queue[Any], first: Any) -> Any:
    """The last of what waits, which is empty then; `first` where nothing does."""
    while True:
        try:
            first = waiting.get_nowait()
        except queue.Empty:
            return first
