"""The node that subscribes to joint states and publishes the payload."""

from __future__ import annotations

from collections.abc import Callable

from armload.devices.ros2.announcement import announced
from armload.devices.ros2.messages import message_of
from armload.devices.ros2.source import Ros2Source
from armload.estimators import Estimate
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.recording import Sample


class PayloadNode:
    """Joint states in, geometry_msgs/InertiaStamped out.

    Args:
        source: the joint states; the node publishes through its connection.
        update: takes one sample and returns the estimate so far: the `update` of any `Identifier`, or
            `lambda sample: online.update(*sample)` with an `OnlineIdentifier`.
        topic: where the payload is published.
        rate: at most so many messages per second of the samples' clock [Hz].

    Raises:
        SourceError: the topic's name is not one.
    """

    def __init__(
        self, source: Ros2Source, update: Callable[[Sample], Estimate], topic: str, *, rate: float = 10.0
    ) -> None:
        self._source, self._update, self._period = source, update, 1.0 / rate
        self._kind = source.connection.InertiaStamped
        self._publish = source.connection.publisher(self._kind, topic)

    def run(self, on_published: Callable[[InertialParameters], None] | None = None) -> None:
        """Identify and publish until the source is closed.

        Args:
            on_published: called with each payload that was published.

        Raises:
            SourceError: the joint states ended.
        """
        last = -float("inf")
        for sample in self._source:
            estimate = self._update(sample)
            if abs(estimate.t - last) < 0.999 * self._period:  # a clock that was set back counts as later
                continue
            body = announced(estimate, self._source.arm)
            if body is None:
                continue
            last = estimate.t
            old = estimate.age - estimate.lag if isinstance(estimate, OnlineEstimate) else 0.0  # on the samples' clock
            self._publish(message_of(body, self._source.stamp(estimate.t - old), self._kind))
            if on_published is not None:
                on_published(body)
