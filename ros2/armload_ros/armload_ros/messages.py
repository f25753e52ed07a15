"""What is known of the payload as messages: armload_msgs/Payload, a ball for RViz, a frame at the centre of mass."""

from __future__ import annotations

import numpy as np
from armload_msgs.msg import Event, Payload
from builtin_interfaces.msg import Time
from geometry_msgs.msg import InertiaStamped, TransformStamped
from visualization_msgs.msg import Marker

from armload.devices.ros2 import message_of, parameters_of
from armload.devices.ros2.joint_states import JointStates
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.payloads.payload import require_consistent
from armload.payloads.units import require_kilogram_square_metres, require_metres

WATER = 1000.0  # [kg/m³] what a ball is as large as: nobody knows the payload's size


def stamp_of(estimate: OnlineEstimate, states: JointStates) -> int:
    """When the newest joint state came that counted in the answer, by the stamps [ns]."""
    return states.stamp(estimate.t - estimate.age + estimate.lag)


def payload_message(
    estimate: OnlineEstimate, robot: str, states: JointStates, body: InertialParameters | None
) -> Payload:
    """All that an answer says; `body` is the one that can exist, None where it is not known."""
    known = message_of(body or InertialParameters.zero(estimate.frame), stamp_of(estimate, states), InertiaStamped)
    message = Payload(header=known.header, inertia=known.inertia, known=body is not None, robot=robot)
    message.header.frame_id = estimate.frame or ""
    message.relative_to = estimate.relative_to
    message.phi, message.low, message.high = estimate.phi, estimate.low, estimate.high
    message.covariance = np.ravel(estimate.covariance)
    message.determined = estimate.determined.tolist()
    message.calibrated = estimate.interval == "calibrated"
    message.held, message.settling, message.moving = bool(estimate.held), bool(estimate.settling), bool(estimate.moving)
    for name in ("p_held", "p_change", "p_contact", "p_drift"):
        value = getattr(estimate, name)
        setattr(message, name, float("nan") if value is None else float(value))
    message.age = float(estimate.age)
    if (event := estimate.event) is not None:
        mass = float("nan") if event.mass is None else float(event.mass)
        noticed, began = (_time(states.stamp(t)) for t in (event.t, event.began))
        message.event = [Event(kind=event.kind, noticed=noticed, began=began, mass=mass)]
    message.notes = list(estimate.notes)
    return message


def tool_of(message: InertiaStamped) -> InertialParameters:
    """The body in a request, about the origin of the frame that it names.

    Raises:
        ArmloadError: its numbers are not finite, no body can have them, or they are in other units.
    """
    tool = parameters_of(message)
    require_consistent(tool, "the tool")
    require_metres(tool.com, "the tool")
    require_kilogram_square_metres(tool, "the tool")
    return tool


def radius(mass: float) -> float:
    """Of a ball of water of this mass [kg] → [m]."""
    return float((3.0 * mass / WATER / (4.0 * np.pi)) ** (1.0 / 3.0))


def marker_of(message: InertiaStamped) -> Marker:
    """A ball at the centre of mass, of the volume that the mass has as water."""
    marker = Marker(header=message.header, ns="payload", type=Marker.SPHERE)
    marker.action = Marker.ADD if message.inertia.m > 0.0 else Marker.DELETE
    com = message.inertia.com
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = com.x, com.y, com.z
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 2.0 * radius(message.inertia.m)
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = 0.9, 0.5, 0.1, 0.8
    return marker


def transform_of(message: InertiaStamped, child: str) -> TransformStamped:
    """The frame `child` at the centre of mass, in the axes of the payload frame."""
    transform = TransformStamped(header=message.header, child_frame_id=child)
    transform.transform.translation = message.inertia.com
    transform.transform.rotation.w = 1.0
    return transform


def _time(nanoseconds: int) -> Time:
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
