"""Prints what comes on a topic, one JSON line per message. Plain rclpy; run by test_ros2.py.

listen.py inertia|states TOPIC
"""

import json
import sys

import rclpy
from geometry_msgs.msg import InertiaStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def inertia(message):
    i = message.inertia
    six = [i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz]
    fields = {"stamp": stamp(message), "frame": message.header.frame_id, "m": i.m, "com": [i.com.x, i.com.y, i.com.z]}
    print(json.dumps(fields | {"inertia": six}), flush=True)


def states(message):
    fields = {"stamp": stamp(message), "names": list(message.name), "q": list(message.position)}
    print(json.dumps(fields | {"dq": list(message.velocity), "tau": list(message.effort)}), flush=True)


rclpy.init()
node = rclpy.create_node("listener_" + sys.argv[1])
if sys.argv[1] == "inertia":
    node.create_subscription(InertiaStamped, sys.argv[2], inertia, 10)
else:
    node.create_subscription(JointState, sys.argv[2], states, qos_profile_sensor_data)
rclpy.spin(node)
