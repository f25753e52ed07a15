"""A ROS 2 arm that is moved: short trajectories to a joint trajectory controller, each of which ends at rest.

Every `_EVERY` seconds the controller gets the next `_AHEAD` seconds of the motion and, behind them, the way to rest
along the path (`Course.brake`), on the topic `joint_trajectory` that ROS 2's joint trajectory controllers have, the
scaled one of Universal Robots among them. The next one replaces it before it gets there. So the arm comes to rest on
its path whatever becomes of this process or the network, and nothing has to notice. Each message has the stamp of the
movement's start on the clock of the joint states, which is the controller's.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.arms.units import unit_of
from armload.devices.mover import Movement, StreamedMover
from armload.devices.ros2.effort import Effort
from armload.devices.ros2.source import Ros2Source
from armload.devices.supervision import Thresholds
from armload.errors import SafetyError, SourceError
from armload.motion import Course, Motion
from armload.recording import Sample

CONTROLLER = "/joint_trajectory_controller"
_EVERY = 0.15  # [s] between two trajectories
_AHEAD = 0.6  # [s] of motion in each: three may be lost
_LEAD = 0.1  # [s] before a change reaches the arm: the message's way, and a controller's cycles
_BEGIN = 0.5  # [s] before a movement begins, which is announced several times meanwhile
_APART = 0.02  # [s] between points
_TO_DISCOVER = 5.0  # [s] until a controller counts as absent
_SAME = 0.03  # [rad] a controller lets an arm hang below where it was sent


class Ros2Mover(StreamedMover):
    """An arm behind a joint trajectory controller.

    Args:
        topic: of its sensor_msgs/JointState messages.
        arm: whose joints.
        controller: the controller's name, under which its topic is.
        effort: as of `Ros2Source`.

    Raises:
        SourceError: no ROS 2, no such topic name, nothing to hear in time, joints or efforts missing.
    """

    def __init__(self, topic: str, arm: Arm, controller: str = CONTROLLER, effort: Effort | None = None) -> None:
        super().__init__(arm)
        self._source = Ros2Source(topic, arm, effort=effort, needs_velocities=True)
        self.name, self.rate = topic, self._source.rate
        self._connection = self._source.connection
        try:
            self._commands = f"{controller.rstrip('/')}/joint_trajectory"
            self._publish = self._connection.publisher(self._connection.JointTrajectory, self._commands)
        except BaseException:
            self._source.close()
            raise
        self.see = (  # a topic brings no refusal
            f"see that the controller of {self._commands} is active, and whether it refuses what it is sent, or is "
            "slowed down (a speed slider below 100 %)"
        )
        self._start, self._sent = 0, -np.inf  # of the movement [ns since 1970], and the last message, on its clock [s]
        self._seen: NDArray[np.float64] | None = None
        self._goal: NDArray[np.float64] | None = None

    def __iter__(self) -> Iterator[Sample]:
        return (sample for sample in self.ticking(None) if sample is not None)

    def ticking(self, tick: float | None) -> Iterator[Sample | None]:
        """See `Ros2Source.ticking`; the arm's commands go out as its samples come."""
        for sample in self._source.ticking(tick):
            if sample is not None:
                self._command(sample)
            yield sample

    def _command(self, sample: Sample) -> None:
        """Send what is due now that this sample has come."""
        if np.all(np.isfinite(sample.q)):
            self._seen = sample.q
        under_way = self._movement
        movement = self._took(sample, lambda at=sample.t: self._begins(at))
        if movement is not None:
            assert movement.begun is not None
            t = self._heard.newest - movement.begun + self._waited()
            self._late(movement.course, t)
            known = copy(movement.course)
            self._brakes(movement, t + _LEAD)
            changed = movement.course.braked != known.braked
            if (changed or t - self._sent >= _EVERY) and not self._send(movement.course, t):
                movement.course = known
        elif under_way is not None and self.why is None:
            self.why = self._left()

    def _waited(self) -> float:
        """How far the controller's clock has gone on since its newest sample [s], as far as can be told.

        Where simulated time runs slower than ours, what it is behind does not tell that samples wait.
        """
        return max(self._source.lag(), self._heard.behind if self._source.paced else 0.0)

    def _late(self, course: Course, t: float) -> None:
        """Brake where the newest trajectory does, if it is too late for another: from there on the arm is elsewhere."""
        braking = max(self._sent, 0.0) + _AHEAD
        if course.braked is None and np.isfinite(self._sent) and braking < min(t + _LEAD, course.duration):
            course.brake(braking)
            self._halt(
                f"no trajectory could be sent for {t - self._sent:.2f} s (expected less than {_AHEAD - _LEAD:g} s): "
                "this process did not run; see what held it up, and give this machine less other work"
            )

    def _left(self) -> str | None:
        """What is left to where a movement has ended, if that is more than a controller lets an arm hang."""
        if self._goal is None or self._seen is None:
            return None
        away = np.abs(self._goal - self._seen)
        j = int(np.argmax(away))
        unit = unit_of("position", self.arm.limits.slides[j])
        return (
            None if away[j] < _SAME else f"{self.arm.joint_names[j]} is {away[j]:.3f} {unit} from its end ({self.see})"
        )

    def silence(self, seconds: float) -> str:
        """What to say where no sample came for so many seconds while the arm was on its way."""
        return f"{self._source.silence(seconds)}; the arm was on its way, and its controller lets it come to rest there"

    def commanded(self) -> NDArray[np.float64]:
        """Where it was sent last, q (n,) [rad]; where it is, if that is elsewhere or nobody sent it."""
        if self._seen is None:
            self._seen = self._first_seen()
        near = self._goal is not None and np.abs(self._goal - self._seen).max() < _SAME
        return np.array(self._goal if near else self._seen)

    def _first_seen(self) -> NDArray[np.float64]:
        """Where the arm is, before its samples are asked for.

        Raises:
            SourceError: none of them says so for some seconds.
        """
        until = time.monotonic() + _TO_DISCOVER
        for sample in self._source:
            if np.all(np.isfinite(sample.q)):
                return sample.q
            if time.monotonic() > until:
                break
        raise SourceError(
            f"{self.name} has had no position of every joint for {_TO_DISCOVER:g} s: expected finite numbers; see what "
            "its driver publishes"
        )

    def follow(self, motion: Motion, thresholds: Thresholds | None = None) -> None:
        """Begin a movement, a moment after the next sample."""
        until = time.monotonic() + _TO_DISCOVER
        while not self._connection.listeners(self._publish):
            if time.monotonic() > until:
                raise SafetyError(
                    f"nobody listens on {self._commands}: expected a joint trajectory controller that is active; name "
                    f"it with {self.name}?controller=/NAME"
                )
            self._connection.spin(_LEAD)
        super().follow(motion, thresholds)
        self._goal = motion.position([motion.duration])[0]

    def arrived(self) -> float | None:
        """When the middleware had taken in the message handed on last."""
        return self._source.arrived()

    def close(self) -> None:
        """Leave the network; an arm on its way comes to rest."""
        self._source.close()

    def _silent(self, movement: Movement, passed: float) -> None:
        """Nothing: the controller has followed its newest trajectory meanwhile, and `_late` brakes where that does."""

    def _jumped(self, movement: Movement, passed: float) -> None:
        """The controller's clock is the samples': stamps go with it."""
        super()._jumped(movement, passed)
        self._start += round(1e9 * passed)

    def _begins(self, t: float) -> float:
        """The start of a movement, on the samples' clock [s]."""
        wait = self._waited() + _BEGIN
        self._start, self._sent = self._source.stamp(t) + round(1e9 * wait), -np.inf
        return t + wait

    def _send(self, course: Course, t: float) -> bool:
        """Send the piece of the motion that is ahead at t [s] on its clock; False: it was not ready in time."""
        begun = time.monotonic()
        piece = copy(course)
        if piece.braked is None:
            piece.brake(max(t, 0.0) + _AHEAD)
        first = max(t, 0.0) + 0.5 * _LEAD
        times = np.append(np.arange(first, piece.duration, _APART), max(piece.duration, first) + _APART)
        message = self._connection.JointTrajectory()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self._start, 1_000_000_000)
        message.joint_names = list(self.arm.joint_names)
        message.points = [self._point(*row) for row in zip(times.tolist(), *piece(times), strict=True)]
        if time.monotonic() - begun > 0.5 * _LEAD:  # this process did not run: the arm is past the first point
            return False
        self._publish(message)
        self._sent, self._goal = t, piece.position([piece.duration])[0]
        return True

    def _point(self, t: float, q: NDArray, dq: NDArray, ddq: NDArray) -> Any:
        point = self._connection.JointTrajectoryPoint()
        nanoseconds = round(t * 1e9)
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(nanoseconds, 1_000_000_000)
        point.positions, point.velocities, point.accelerations = q.tolist(), dq.tolist(), ddq.tolist()
        return point
