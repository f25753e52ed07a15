"""A robot (or a simulator, or a bag that is played) on ROS 2: the sensor_msgs/JointState messages of one topic."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.devices.ros2.connection import SENSOR_DEPTH, Ros2Connection
from armload.devices.ros2.effort import Effort
from armload.devices.ros2.joint_states import JointStates, velocities_of_positions
from armload.devices.ros2.receipt import Receipt
from armload.devices.source import Source
from armload.errors import SourceError
from armload.recording import GAP, Sample, Steadying
from armload.recording.steadied import AROUND, STEPS

_LOOK = 0.1  # [s] at most between two looks at whether the source was closed or interrupted
_TO_TELL_THE_RATE = 5  # samples


class Ros2Source(Source):
    """The joint states of an arm on a ROS 2 topic.

    The subscription is best effort, so that it hears reliable publishers too, and keeps the last 1000 messages while
    an identifier is busy. Joints are mapped by name; see `JointStates` for times and for what is missing. Where the
    topic has no velocities they are those of its positions (`Steadying`): each sample then comes 75 ms later, and
    `notes` say so.

    Args:
        topic: of sensor_msgs/JointState messages, such as /joint_states.
        arm: whose joints.
        rate: samples per second [Hz]; None: measured from the first five, which opening then waits for.
        timeout: longest time without a sample [s]; None: wait for ever.
        node: name of the ROS 2 node.
        effort: what the publisher calls effort; None: joint torque, gravity in it.
        needs_velocities: whether a topic without them is refused: who moves the arm cannot wait for the positions'.

    Attributes:
        connection: the node, for whoever has something to publish. arm: as given.

    Raises:
        SourceError: no ROS 2, no such topic name, nothing to hear in time, joints or efforts missing; no velocities,
            and fewer than 28 samples a second.
    """

    def __init__(
        self,
        topic: str,
        arm: Arm,
        *,
        rate: float | None = None,
        timeout: float | None = 10.0,
        node: str = "armload",
        effort: Effort | None = None,
        needs_velocities: bool = False,
    ) -> None:
        self.name, self.n = topic, arm.n
        self.arm, self._timeout, self._closed = arm, timeout, False
        self._states = JointStates(arm, topic, effort, needs_velocities)
        self._received: deque[tuple[Any, int]] = deque(maxlen=SENSOR_DEPTH)
        self._receipt = Receipt()
        self._steadying: Steadying | None = None  # tells velocities, where the topic has none
        self._ready: deque[tuple[Sample, float]] = deque()
        self._arrived: float | None = None
        self.connection = Ros2Connection(node)
        try:
            self.connection.subscribe(self.connection.JointState, topic, self._receive, sensor=True)
            self.rate = float("nan") if rate is None else float(rate)
            if rate is None:
                self.rate = self._measured_rate()
                self._check_rate()
            self.paced = not self._states.simulated
        except BaseException:
            self.close()
            raise

    def __iter__(self) -> Iterator[Sample]:
        """The samples as they come; ends after `close`.

        Raises:
            SourceError: nothing was heard for `timeout` seconds, or the first message lacks efforts.
        """
        return (sample for sample in self.ticking(None) if sample is not None)

    def ticking(self, tick: float | None) -> Iterator[Sample | None]:
        """The same, and None whenever none has come for `tick` seconds; tick None: never."""
        since = time.monotonic()
        while not self._closed:
            heard = self._next(since, tick)
            if heard is not None:
                sample, self._arrived = heard
                yield sample
                since = time.monotonic()
            elif not self._closed:
                yield None

    def arrived(self) -> float | None:
        """When the middleware had taken in the message handed on last."""
        return self._arrived

    def stamp(self, t: float) -> int:
        """The header's stamp of the sample at time t, since 1970 [ns]."""
        return self._states.stamp(t)

    def close(self) -> None:
        """Leave the topic; nothing happens the second time."""
        self._closed = True
        self.connection.close()

    def _receive(self, message: Any, received: int) -> None:
        self._received.append((message, received))

    def _next(self, since: float, tick: float | None = None) -> tuple[Sample, float] | None:
        """The next sample of the arm and when it arrived, on the monotonic clock [s].

        None: closed meanwhile, or none came within `tick` [s]. since: when the one before had been dealt with.
        """
        heard, asked = since, time.monotonic()
        while not self._closed:
            while self._received and not self._ready:
                message, received = self._received.popleft()
                sample = self._states.sample(message, received)
                if sample is not None:
                    heard = time.monotonic()
                    waited = self._receipt.waited(received, time.time_ns(), time.monotonic_ns())
                    self._ready.extend(self._told(sample, heard - waited))
            silent = time.monotonic() - heard
            if self._steadying is not None and silent > GAP and not self._ready:
                self._ready.extend(self._steadying.flush())
            if self._ready:
                return self._ready.popleft()
            if self._timeout is not None and silent > self._timeout:
                raise SourceError(self.silence(self._timeout))
            waited = time.monotonic() - asked
            if tick is not None and waited > tick:
                return None
            self.connection.spin(_LOOK if tick is None else min(_LOOK, max(0.0, tick - waited)))
        return None

    def _told(self, sample: Sample, arrived: float) -> list[tuple[Sample, float]]:
        """The samples that can be handed on now that this one has come, with velocities, and when they arrived."""
        if self._states.has_velocities:
            return [(sample, arrived)]
        if self._steadying is None:
            self._steadying = Steadying(self.n, alone=True)
            self.notes = (velocities_of_positions(self.name),)
            self._check_rate()
        return self._steadying.take(sample, arrived)

    def _measured_rate(self) -> float:
        first = []
        while len(first) < _TO_TELL_THE_RATE:
            heard = self._next(time.monotonic())
            assert heard is not None  # nobody can close what is still being opened
            first.append(heard)
        self._ready.extendleft(reversed(first))
        steps = np.diff([sample.t for sample, _ in first])
        steps = steps[steps > 0]
        return float(1.0 / np.median(steps)) if len(steps) else float("nan")

    def _check_rate(self) -> None:
        least = STEPS / AROUND
        if self._steadying is not None and self.rate < least:  # one that is not known yet is not
            raise SourceError(
                f"{self.name} has no velocities and {self.rate:.3g} samples a second: expected velocities, or at least "
                f"{least:.0f} samples a second, from whose positions they can be told"
            )

    def silence(self, seconds: float) -> str:
        """What to say where no sample of the arm came for so many seconds."""
        missing = [name for name in self.arm.joint_names if name not in self._states.others]
        if not self._states.others:
            return (
                f"no joint states on {self.name} for {seconds:g} s: expected a publisher of "
                "sensor_msgs/JointState; check the topic's name, ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE"
            )
        found = ", ".join(sorted(self._states.others)[:20])
        lacking = f"without {', '.join(missing)}" if missing else "that never come in one message"
        return (
            f"{self.name} had only the joints {found} for {seconds:g} s, {lacking}: expected all of "
            f"{self.arm.name}'s; name the right robot or topic"
        )
