"""From sensor_msgs/JointState messages to samples of one arm, as they come.

Joints are known by **name**, that of the description or another on the arm's sheet: a message may list them in any
order and others beside them (gripper fingers). Time is the header's stamp, counted from the first; where messages are
not stamped (all zero) it is the time of receipt. `effort` is the joint torque, or what `Effort` makes of it.
What a robot does not measure may be missing, or NaN for every joint, as ros2_control publishes it.
`armload.recording.ros_bag` does the same for whole logs, and refuses what is only suspicious here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, names_among
from armload.devices.ros2.effort import Effort
from armload.errors import SourceError
from armload.recording import Sample
from armload.recording.recording import is_time_of_day
from armload.recording.steadied import AROUND

_MOST_LAYOUTS = 64  # lists of names remembered; a publisher that invents names cannot fill the memory


class JointStates:
    """Reads one arm's samples out of JointState messages.

    Args:
        arm: whose joints, and in which order.
        topic: what errors call the source.
        effort: what the publisher calls effort; None: joint torque, gravity in it.
        needs_velocities: whether a topic without them is refused.

    Attributes:
        others: names of joints seen in messages that did not have all of the arm's.
        has_velocities: whether the first sample had any.
    """

    def __init__(self, arm: Arm, topic: str, effort: Effort | None = None, needs_velocities: bool = True) -> None:
        self.others: set[str] = set()
        self.has_velocities, self._needs_velocities = True, needs_velocities
        self._arm, self._topic, self._effort = arm, topic, effort
        self._called: tuple[str, ...] | None = None  # what the topic calls the arm's joints
        self._layouts: dict[tuple[str, ...], list[int] | None] = {}
        self._first_received: int | None = None  # [ns] since 1970, as all times here
        self._zero: int | None = None  # the stamp at t = 0, once a message was stamped
        self._begun = False

    def sample(self, message: Any, received: int) -> Sample | None:
        """The message as a sample, with NaN where values are missing; None: it has not all joints of the arm.

        Args:
            message: a sensor_msgs/JointState of any ROS client.
            received: when it was received, since 1970 [ns].

        Raises:
            SourceError: the very first sample lacks positions, efforts or velocities that must be there: the rest
                will, too.
        """
        names = tuple(message.name)
        if names not in self._layouts:
            if len(self._layouts) >= _MOST_LAYOUTS:
                self._layouts.clear()
                self.others.clear()
            if self._called is None:
                self._called = names_among(self._arm, names)
            complete = self._called is not None and set(self._called) <= set(names)
            self._layouts[names] = [names.index(name) for name in self._called or ()] if complete else None
            self.others.update(() if complete else names)
        order = self._layouts[names]
        if order is None:
            return None
        rows = (message.position, message.velocity, message.effort)
        q, dq, tau = (_in_order(values, len(names), order) for values in rows)
        if not self._begun and not (len(message.position) == len(names) and np.isnan(q).any()):  # else not ready yet
            self._check(message, (q, dq, tau))
            self._begun = True
        if self._effort is not None:
            tau = self._effort.torque(q, tau)
        return Sample(self._time(message.header.stamp, received), q, dq, tau)

    def stamp(self, t: float) -> int:
        """When t was on the robot's clock, since 1970 (or the start of simulated time) [ns]; 0 before any sample."""
        zero = self._first_received if self._zero is None else self._zero
        return 0 if zero is None else zero + round(t * 1e9)

    @property
    def simulated(self) -> bool:
        """Whether its stamps do not show the time of day, as those of simulated time, which has a pace of its own."""
        return self._zero is not None and not is_time_of_day(self._zero / 1e9)

    def _time(self, stamp: Any, received: int) -> float:
        """Seconds since the first sample: by the stamps from the first stamped message on."""
        nanoseconds = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        if self._first_received is None:
            self._first_received = received
        since = received - self._first_received
        if self._zero is None:
            if nanoseconds == 0:
                return since / 1e9
            self._zero = nanoseconds - since  # a clock that starts late, as simulated time does, goes on from here
        return (nanoseconds - self._zero) / 1e9 if nanoseconds else float("nan")

    def _check(self, message: Any, values: Sequence[NDArray[np.float64]]) -> None:
        """Whether the message has what is needed; values: q, dq and tau of the arm's joints, NaN where it has none."""
        n, sent = len(message.name), (message.position, message.velocity, message.effort)
        nothing = [len(rows) in (0, n) and bool(np.isnan(x).all()) for rows, x in zip(sent, values, strict=True)]
        self.has_velocities = self._needs_velocities or not nothing[1]
        for what, rows, none in zip(("position", "velocity", "effort"), sent, nothing, strict=True):
            if (none or len(rows) != n) and (what != "velocity" or self.has_velocities):
                found = f"no {what}" if none else f"{len(rows)} values of {what}"
                which = " (all are NaN)" if none and len(rows) else ""
                also = " (joint torque); name a topic that carries the torque" if what == "effort" else ""
                raise SourceError(f"{self._topic} has {found} for its {n} joints{which}: expected one per joint{also}")


def velocities_of_positions(topic: str) -> str:
    """What is said of a topic without velocities."""
    late = f"{1e3 * AROUND:.0f} ms"
    return f"{topic} has no velocities: they are those of its positions, and each sample is answered {late} later"


def _in_order(values: Sequence[float], n: int, order: list[int]) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float)[order] if len(values) == n else np.full(len(order), np.nan)
