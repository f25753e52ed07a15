"""Sends one trajectory_msgs/JointTrajectory. Plain rclpy; run by test_ros2.py.

send_trajectory.py TOPIC TRAJECTORY.json

TRAJECTORY.json: {"names": [...], "points": [{"t": s, "q": [...], "dq": [...], "ddq": [...]}]}
"""

import json
import sys
import time
from pathlib import Path

import rclpy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

wanted = json.loads(Path(sys.argv[2]).read_text())
message = JointTrajectory(joint_names=wanted["names"])
for point in wanted["points"]:
    p = JointTrajectoryPoint(positions=point["q"], velocities=point["dq"], accelerations=point["ddq"])
    p.time_from_start.sec, p.time_from_start.nanosec = divmod(round(point["t"] * 1e9), 10**9)
    message.points.append(p)

rclpy.init()
node = rclpy.create_node("commander")
publisher = node.create_publisher(JointTrajectory, sys.argv[1], 10)
until = time.monotonic() + 30.0
while not publisher.get_subscription_count() and time.monotonic() < until:
    time.sleep(0.05)
publisher.publish(message)
publisher.wait_for_all_acked()
node.destroy_node()
rclpy.shutdown()
