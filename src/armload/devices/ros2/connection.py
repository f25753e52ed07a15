"""One process's place in a ROS 2 network: a node with its own context, its subscriptions and its publishers.

rclpy comes with ROS 2, not with armload, and is imported only here, when a connection is opened.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from armload.errors import SourceError, SourceSetupError

# Samples wait in the reader's history while an identifier computes: one second at 1 kHz.
SENSOR_DEPTH = 1000
_COMMAND_DEPTH = 10
INSTALL = (
    "install ROS 2 (https://docs.ros.org/en/kilted/Installation.html), source its setup.bash and run armload with the "
    "Python that ROS was built for"
)


class Ros2Connection:
    """A ROS 2 node with armload's publishers and subscriptions.

    Discovery is ROS 2's own affair: ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE count as for every other node.
    Ctrl-C stays Python's.

    Args:
        name: of the node: letters, digits and underscores.

    Attributes:
        JointState, InertiaStamped, JointTrajectory, JointTrajectoryPoint: the message types.

    Raises:
        SourceError: ROS 2 is not installed for this Python, or does not start.
    """

    def __init__(self, name: str = "armload") -> None:
        try:
            import rclpy  # type: ignore[import-not-found]
            import rclpy.context  # type: ignore[import-not-found]
            import rclpy.executors  # type: ignore[import-not-found]
            import rclpy.signals  # type: ignore[import-not-found]
            from geometry_msgs.msg import InertiaStamped  # type: ignore[import-not-found]
            from sensor_msgs.msg import JointState  # type: ignore[import-not-found]
            from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # type: ignore[import-not-found]
        except ImportError as error:
            raise SourceSetupError(f"ROS 2 is not there for this Python ({error}): {INSTALL}") from None
        self.JointState, self.InertiaStamped, self.JointTrajectory = JointState, InertiaStamped, JointTrajectory
        self.JointTrajectoryPoint = JointTrajectoryPoint
        self._publishers: dict[Callable[[Any], None], Any] = {}
        self._context = rclpy.context.Context()
        try:
            rclpy.init(args=[], context=self._context, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
            self._node = rclpy.create_node(name, context=self._context, start_parameter_services=False)
            self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
            self._executor.add_node(self._node)
        except Exception as error:  # a middleware that is missing or a wrong setting: each has an exception of its own
            raise SourceError(f"ROS 2 does not start: {_first_line(error)}; check RMW_IMPLEMENTATION") from None

    def subscribe(self, kind: type, topic: str, callback: Callable[[Any, int], None], *, sensor: bool = False) -> None:
        """Call callback(message, received) for every message of a topic, from within `spin`.

        Args:
            kind: the message's type.
            callback: `received` is when the middleware took the message in, since 1970 [ns].
            sensor: best effort, the last `SENSOR_DEPTH` messages: hears every publisher, reliable or not. Otherwise
                reliable, the last 10.

        Raises:
            SourceError: the topic's name is not one.
        """
        from rclpy.qos import QoSProfile, ReliabilityPolicy  # type: ignore[import-not-found]

        how = ReliabilityPolicy.BEST_EFFORT if sensor else ReliabilityPolicy.RELIABLE
        profile = QoSProfile(depth=SENSOR_DEPTH if sensor else _COMMAND_DEPTH, reliability=how)

        def take(message: Any, info: Any) -> None:  # rclpy looks at the number of arguments
            callback(message, int(info["received_timestamp"]))
            with subscription.handle:  # and all that wait behind it: the executor takes 0.3 ms to give one
                while (waiting := subscription.handle.take_message(kind, False)) is not None:
                    callback(waiting[0], int(waiting[1]["received_timestamp"]))

        subscription = self._named(topic, lambda: self._node.create_subscription(kind, topic, take, profile))

    def publisher(self, kind: type, topic: str) -> Callable[[Any], None]:
        """What publishes a message on a topic, reliably, the last 10 kept for who is slow.

        Raises:
            SourceError: the topic's name is not one.
        """
        made = self._named(topic, lambda: self._node.create_publisher(kind, topic, _COMMAND_DEPTH))
        self._publishers[made.publish] = made
        return made.publish

    def listeners(self, publish: Callable[[Any], None]) -> int:
        """How many subscriptions hear what `publisher` gave."""
        return int(self._publishers[publish].get_subscription_count())

    def spin(self, timeout: float) -> None:
        """Wait up to `timeout` seconds for the next message and hand it to its callback."""
        self._executor.spin_once(timeout_sec=max(0.0, timeout))

    def now(self) -> int:
        """ROS time, since 1970 [ns]."""
        return int(self._node.get_clock().now().nanoseconds)

    def close(self) -> None:
        """Leave the network; nothing happens the second time."""
        if self._context.ok():
            self._executor.shutdown()
            self._node.destroy_node()
            self._context.try_shutdown()

    def _named(self, topic: str, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except Exception as error:  # rclpy has an exception for each way in which a name can be wrong
            raise SourceError(f"{topic!r} cannot be a ROS 2 topic here: {_first_line(error)}") from None


def _first_line(error: Exception) -> str:
    return next((line.strip(" :") for line in str(error).splitlines() if line.strip()), type(error).__name__)
