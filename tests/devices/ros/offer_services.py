"""What a driver or MoveIt offers to whoever knows the load: takes it, prints it, refuses it if told so.

    offer_services.py franka_ros2|ur_robot_driver|moveit [REFUSAL [TAKEN]]

It refuses after TAKEN loads (0); a REFUSAL of "gone" is no answer: it takes a load and ends.

The names and types are those of franka_ros2, ur_robot_driver and MoveIt. Plain rclpy; run by test_ros2_package.py.
"""

import json
import os
import sys
from importlib import import_module

import rclpy

OFFERED = {
    "franka_ros2": ("franka_msgs", "SetLoad", "/service_server/set_load"),
    "ur_robot_driver": ("ur_msgs", "SetPayload", "/io_and_status_controller/set_payload"),
    "moveit": ("moveit_msgs", "ApplyPlanningScene", "/apply_planning_scene"),
}
package, kind, service = OFFERED[sys.argv[1]]
refusal = sys.argv[2] if len(sys.argv) > 2 else None
taken = int(sys.argv[3]) if len(sys.argv) > 3 else 0
requests = []


def plain(value):
    """A message as JSON."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return int.from_bytes(value, "little")
    if isinstance(value, str | bool | int | float):
        return value
    return [plain(each) for each in value]


def take(request, response):
    print(json.dumps(plain(request)), flush=True)
    requests.append(request)
    response.success = refusal is None or len(requests) <= taken
    if not response.success and refusal == "gone":
        os._exit(0)
    if not response.success and hasattr(response, "error"):
        response.error = refusal
    return response


rclpy.init()
node = rclpy.create_node("offers")
node.create_service(getattr(import_module(f"{package}.srv"), kind), service, take)
rclpy.spin(node)
