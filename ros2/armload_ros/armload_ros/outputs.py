"""What the node publishes: the payload, all that is known of it, a ball for RViz, its frame, and diagnostics."""

from __future__ import annotations

from typing import Any

from armload_msgs.msg import Payload
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from armload.inertia import InertialParameters

from .messages import marker_of, transform_of


class Outputs:
    """The publishers of a lifecycle node: silent while it is not active, but for diagnostics."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._payload = node.create_lifecycle_publisher(InertiaStamped, "~/payload", 10)
        self._estimate = node.create_lifecycle_publisher(Payload, "~/estimate", 10)
        self._com = node.create_lifecycle_publisher(Marker, "~/com", 10)
        self._tf = node.create_lifecycle_publisher(TFMessage, "/tf", 10)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def say(self, said: Payload, body: InertialParameters | None, com_frame: str) -> None:
        """An answer; only of a body that is known what others take as they find it."""
        self._estimate.publish(said)
        if body is None:
            return
        message = InertiaStamped(header=said.header, inertia=said.inertia)
        self._payload.publish(message)
        self._com.publish(marker_of(message))
        if com_frame and body.mass > 0.0:
            self._tf.publish(TFMessage(transforms=[transform_of(message, com_frame)]))

    def diagnose(self, status: DiagnosticStatus, hardware: str) -> None:
        """The node's state."""
        status.name, status.hardware_id = self._node.get_fully_qualified_name(), hardware
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def close(self) -> None:
        """Nothing more is published."""
        for publisher in (self._payload, self._estimate, self._com, self._tf, self._diagnostics):
            self._node.destroy_publisher(publisher)
