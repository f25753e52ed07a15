"""armload among ROS 2 nodes: joint states in and the payload out; a simulated robot that takes trajectories."""

from armload.ros2.announcement import announced
from armload.ros2.commanded import CommandedMotion
from armload.ros2.messages import message_of, parameters_of
from armload.ros2.payload_node import PayloadNode
from armload.ros2.robot_node import RobotNode
from armload.ros2.trajectory import TrajectoryMotion, read_trajectory

__all__ = [
    "CommandedMotion",
    "PayloadNode",
    "RobotNode",
    "TrajectoryMotion",
    "announced",
    "message_of",
    "parameters_of",
    "read_trajectory",
]
