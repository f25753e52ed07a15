"""armload among ROS 2 nodes: joint states in and the payload out; a simulated robot that takes trajectories."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.devices.ros2.announcement import announced
    from armload.devices.ros2.connection import Ros2Connection
    from armload.devices.ros2.effort import Effort
    from armload.devices.ros2.messages import message_of, parameters_of
    from armload.devices.ros2.payload_node import PayloadNode
    from armload.devices.ros2.robot_node import RobotNode
    from armload.devices.ros2.source import Ros2Source
    from armload.devices.ros2.trajectory import TrajectoryMotion, read_trajectory
    from armload.devices.simulator.commanded import CommandedMotion

__all__ = [
    "CommandedMotion",
    "Effort",
    "PayloadNode",
    "RobotNode",
    "Ros2Connection",
    "Ros2Source",
    "TrajectoryMotion",
    "announced",
    "message_of",
    "parameters_of",
    "read_trajectory",
]

__getattr__, __dir__ = on_first_use(__name__)
