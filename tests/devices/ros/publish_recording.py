"""A robot's driver that does what drivers do: joints in an order of its own, gripper fingers among them, another device
on the same topic. Plain rclpy; run by test_ros2.py.

    publish_recording.py LOG.npz TOPIC START_NS [WITHOUT]

LOG.npz: t, q, dq, tau and names. WITHOUT: "effort", "velocity" or "arm", what the messages lack.
"""

import sys
import time

import numpy as np
import rclpy
from sensor_msgs.msg import JointState

log, topic, start = np.load(sys.argv[1]), sys.argv[2], int(sys.argv[3])
without = sys.argv[4] if len(sys.argv) > 4 else ""
names = ["finger_left", *log["names"].tolist()[::-1], "finger_right"]
zero = np.zeros((len(log["t"]), 1))
q, dq, tau = (np.hstack([zero + 0.02, log[key][:, ::-1], zero]) for key in ("q", "dq", "tau"))

rclpy.init()
node = rclpy.create_node("driver")
publisher = node.create_publisher(JointState, topic, 10)
until = time.monotonic() + 30.0
while not publisher.get_subscription_count() and time.monotonic() < until:
    time.sleep(0.05)
began = time.monotonic()
for k, t in enumerate(log["t"].tolist()):
    time.sleep(max(0.0, began + t - time.monotonic()))
    message = JointState()
    stamp = start + round(t * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    if k % 10 == 5 or without == "arm":
        message.name, message.position = ["finger_left", "finger_right"], [0.02, 0.02]
        message.velocity, message.effort = [0.0, 0.0], [0.0, 0.0]
        publisher.publish(message)
    if without != "arm":
        message.name, message.position, message.velocity = names, q[k].tolist(), dq[k].tolist()
        message.effort = [] if without == "effort" else tau[k].tolist()
        message.velocity = [] if without == "velocity" else message.velocity
        publisher.publish(message)
time.sleep(1.0)
node.destroy_node()
rclpy.shutdown()
