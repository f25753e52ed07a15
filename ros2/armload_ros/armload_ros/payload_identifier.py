"""The lifecycle node: joint states in, the payload with its error bars, its state and its events out.

    ros2 run armload_ros payload_identifier --ros-args -p robot:=panda -r joint_states:=/franka/joint_states

configure reads the parameters and makes the identifier, activate listens, deactivate stops listening and keeps what is
known, cleanup forgets it. Names below `~` are private to the node, so several arms are several nodes or namespaces.
"""

from __future__ import annotations

import json
import sys
import time
from collections import deque
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import InertiaStamped
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker

from armload import Recording, arm, read_payload, read_recording
from armload.devices.ros2 import announced, message_of
from armload.devices.ros2.joint_states import JointStates
from armload.errors import ArmloadError
from armload.identification import check_usable
from armload.online import OnlineEstimate, OnlineIdentifier
from armload.posterior import load_profile

DEFAULTS: dict[str, Any] = {
    "robot": "panda",
    "frame": "",
    "gravity": [0.0, 0.0, -9.81],
    "method": "",
    "tool": "",
    "tare": "",
    "profile": "",
    "tare_duration": 20.0,
    "rate": 10.0,
    "timeout": 2.0,
}
_KEPT = 1000  # messages that wait while an answer is computed: one second at 1 kHz
_DONE, _FAILED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class PayloadIdentifier(LifecycleNode):
    """Subscribes to `joint_states`; publishes `~/payload`, `~/answer`, `~/com` and `/diagnostics`.

    ~/payload (geometry_msgs/InertiaStamped): a body that can exist, while it is known and samples can be used
        (`armload.devices.ros2.announced`).
    ~/answer (std_msgs/String): the answer as the JSON of `armload live --headless`, and the covariance (10, 10).
    ~/com (visualization_msgs/Marker): the centre of mass in its frame.
    Services (std_srvs/Trigger): ~/reset forgets the stream; ~/tare takes the next `tare_duration` seconds for the arm
        without payload.
    """

    def __init__(self, **how: Any) -> None:
        super().__init__("payload_identifier", **how)
        for name, value in DEFAULTS.items():
            self.declare_parameter(name, value)
        self._identifier: OnlineIdentifier | None = None
        self._estimate: OnlineEstimate | None = None
        self._outputs: dict[str, Any] = {}
        self._others: list[Any] = []
        self._subscription: Any = None
        self._taring: deque[Any] | None = None
        self._said, self._trouble = "", ""

    # ------------------------------------------------------------------ lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Read the parameters; a parameter that is wrong leaves the node unconfigured, and the log says which."""
        try:
            self._begin()
        except (ArmloadError, OSError) as error:
            self.get_logger().error(str(error))
            return _FAILED
        self._outputs = {
            "payload": self.create_lifecycle_publisher(InertiaStamped, "~/payload", 10),
            "answer": self.create_lifecycle_publisher(String, "~/answer", 10),
            "com": self.create_lifecycle_publisher(Marker, "~/com", 10),
            "diagnostics": self.create_publisher(DiagnosticArray, "/diagnostics", 10),
        }
        self._others = [
            self.create_service(Trigger, "~/reset", self._reset),
            self.create_service(Trigger, "~/tare", self._tare),
            self.create_timer(1.0, self._diagnose),
        ]
        return _DONE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen."""
        how = QoSProfile(depth=_KEPT, reliability=ReliabilityPolicy.BEST_EFFORT)  # hears reliable publishers, too
        self._heard = time.monotonic()
        self._subscription = self.create_subscription(JointState, "joint_states", self._take, how)
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen no more; what is known stays."""
        self._silent()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Forget everything."""
        self._silent()
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        for other in self._others:
            (self.destroy_timer if hasattr(other, "cancel") else self.destroy_service)(other)
        self._outputs, self._others = {}, []
        if self._identifier is not None:
            self._identifier.close()
        self._identifier, self._estimate = None, None
        return _DONE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As cleanup."""
        return self.on_cleanup(state)

    def _silent(self) -> None:
        if self._subscription is not None:
            self.destroy_subscription(self._subscription)
        self._subscription, self._taring = None, None

    # ------------------------------------------------------------------ the identifier

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _begin(self) -> None:
        """The arm and the identifier that the parameters ask for."""
        robot = arm(self._value("robot"), self._value("frame") or None, gravity=tuple(self._value("gravity")))
        if tool := self._value("tool"):
            robot = robot.with_payload(robot.in_frame(read_payload(tool).parameters))
        tare = read_recording(self._value("tare"), robot) if self._value("tare") else None
        if tare is not None:
            check_usable(tare, robot)
        self._robot, self._states = robot, JointStates(robot, "joint_states")
        self._identify(tare)

    def _identify(self, tare: Recording | None) -> None:
        profile = load_profile(self._value("profile")) if self._value("profile") else None
        identifier = OnlineIdentifier(self._robot, tare, self._value("method") or None, profile)
        if self._identifier is not None:
            self._identifier.close()
        self._identifier, self._estimate, self._last = identifier, None, -np.inf
        self._tared = tare is not None

    # ------------------------------------------------------------------ messages

    def _take(self, message: JointState) -> None:
        assert self._identifier is not None
        try:
            sample = self._states.sample(message, time.time_ns())
        except ArmloadError as error:
            self._trouble = str(error)
            return
        if sample is None:
            return
        self._heard, self._trouble = time.monotonic(), ""
        if self._taring is not None:
            self._taring.append(sample)
            if sample.t - self._taring[0].t >= self._value("tare_duration"):
                self._end_tare()
            return
        self._estimate = self._identifier.update(*sample)
        if abs(sample.t - self._last) >= 0.999 / self._value("rate"):  # a clock that was set back counts as later
            self._last = sample.t
            self._publish(self._estimate)

    def _publish(self, estimate: OnlineEstimate) -> None:
        assert self._identifier is not None
        said = {"robot": self._robot.name, **estimate.to_dict(), "covariance": estimate.covariance.tolist()}
        self._outputs["answer"].publish(String(data=json.dumps(_finite(said), allow_nan=False)))
        body = None if self._identifier.trouble else announced(estimate)
        if body is None:
            return
        message = message_of(body, self._states.stamp(estimate.t - estimate.age + estimate.lag), InertiaStamped)
        self._outputs["payload"].publish(message)
        self._outputs["com"].publish(_marker(message))

    def _diagnose(self) -> None:
        """Once a second: what the node hears and whether its answer can be believed."""
        active, estimate = self._subscription is not None, self._estimate
        silent = time.monotonic() - self._heard if active else 0.0
        level, text = DiagnosticStatus.OK, "nothing held"
        if not active:
            level, text = DiagnosticStatus.STALE, "not active"
        elif self._trouble or silent > self._value("timeout"):
            level, text = DiagnosticStatus.ERROR, self._trouble or f"no joint states for {silent:.0f} s"
        elif self._taring is not None:
            level, text = DiagnosticStatus.WARN, "taring: keep the payload off and let the arm move"
        elif estimate is None:
            level, text = DiagnosticStatus.WARN, "nothing heard yet"
        elif estimate.notes:
            level, text = DiagnosticStatus.WARN, "; ".join(estimate.notes)
        elif estimate.held:
            text = f"{estimate.phi[0]:.3f} kg, {estimate.interval}"
        values = {"robot": self._robot.name, "tare": "yes" if self._tared else "no", "last service": self._said}
        if estimate is not None:
            values |= {
                "mass [kg]": f"{estimate.phi[0]:.4f}",
                "mass, 95 % [kg]": f"{estimate.low[0]:.4f} … {estimate.high[0]:.4f}",
                "interval": estimate.interval,
                "age [s]": f"{estimate.age:.3f}",
                "event": str(estimate.event or ""),
                "samples left out": str(estimate.health.bad),
            }
        status = DiagnosticStatus(level=level, name=self.get_fully_qualified_name(), message=text)
        status.hardware_id = self._robot.name
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._outputs["diagnostics"].publish(array)

    # ------------------------------------------------------------------ services

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:  # noqa: ARG002
        assert self._identifier is not None
        self._identifier.reset()
        self._estimate, self._last, self._taring = None, -np.inf, None
        return self._told(response, True, "the stream is forgotten; the tare, if there is one, is not")

    def _tare(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:  # noqa: ARG002
        if self._subscription is None:
            return self._told(response, False, "the node is not active: activate it first")
        self._taring = deque()
        return self._told(response, True, f"listening for {self._value('tare_duration'):g} s")

    def _end_tare(self) -> None:
        assert self._taring is not None
        samples, self._taring = list(self._taring), None
        t, q, dq, tau = map(np.array, zip(*samples, strict=True))
        try:
            tare = Recording(t, q, dq, tau, joint_names=self._robot.joint_names)
            check_usable(tare, self._robot)
            self._identify(tare)
        except ArmloadError as error:
            self._said = f"no tare: {error}"
            self.get_logger().error(self._said)
            return
        self._said = f"tared with {tare.duration:.1f} s"
        self.get_logger().info(self._said)

    def _told(self, response: Trigger.Response, success: bool, text: str) -> Trigger.Response:
        self._said = text
        self.get_logger().info(text)
        response.success, response.message = success, text
        return response


def _marker(message: InertiaStamped) -> Marker:
    """A ball at the centre of mass, of the volume that the mass has as water."""
    marker = Marker(header=message.header, ns="payload", type=Marker.SPHERE)
    marker.action = Marker.ADD if message.inertia.m > 0.0 else Marker.DELETE
    com = message.inertia.com
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = com.x, com.y, com.z
    marker.pose.orientation.w = 1.0
    size = 2.0 * (3.0 * message.inertia.m / 1000.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    marker.scale.x = marker.scale.y = marker.scale.z = float(size)
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = 0.9, 0.5, 0.1, 0.8
    return marker


def _finite(value: Any) -> Any:
    """The same, what is not a finite number being null."""
    if isinstance(value, dict):
        return {key: _finite(x) for key, x in value.items()}
    if isinstance(value, list):
        return [_finite(x) for x in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def main(args: list[str] | None = None) -> None:
    """Run until it is shut down."""
    rclpy.init(args=args)
    node = PayloadIdentifier()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv)
