"""Takes the node armload_ros through its states and services, and prints what it says as lines of JSON.

    python drive_lifecycle.py NODE SECONDS

configure, activate, then for so many seconds what the node publishes; ~/tare and ~/reset are called on the way.
"""

import json
import sys
import time

import rclpy
from armload_msgs.msg import Payload
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from lifecycle_msgs.srv import ChangeState, GetState
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker

STEPS = {"configure": 1, "cleanup": 2, "activate": 3, "deactivate": 4}


def main(name: str, seconds: float) -> None:
    rclpy.init()
    node = rclpy.create_node("driver")

    def say(**what):
        print(json.dumps(what), flush=True)

    def call(kind, service, request):
        client = node.create_client(kind, service)
        if not client.wait_for_service(30.0):
            raise SystemExit(f"{service} is not there")
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=60.0)
        return future.result()

    def step(what):
        request = ChangeState.Request()
        request.transition.id = STEPS[what]
        done = call(ChangeState, f"{name}/change_state", request).success
        state = call(GetState, f"{name}/get_state", GetState.Request()).current_state.label
        say(step=what, success=done, state=state)

    def listen(seconds):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            rclpy.spin_once(node, timeout_sec=0.1)

    def inertia(message):
        say(
            payload=message.inertia.m, frame=message.header.frame_id, com=[message.inertia.com.x, message.inertia.com.z]
        )

    node.create_subscription(InertiaStamped, f"{name}/payload", inertia, 10)
    node.create_subscription(
        Payload,
        f"{name}/estimate",
        lambda m: say(estimate={"low": m.low[0], "high": m.high[0], "relative_to": m.relative_to, "held": m.held}),
        10,
    )
    node.create_subscription(Marker, f"{name}/com", lambda m: say(marker=m.scale.x, action=m.action), 10)
    node.create_subscription(
        DiagnosticArray,
        "/diagnostics",
        lambda m: say(diagnostics=m.status[0].message, level=int.from_bytes(bytes(m.status[0].level), "little")),
        10,
    )
    step("configure")
    say(tare=call(Trigger, f"{name}/tare", Trigger.Request()).success)
    step("activate")
    listen(seconds)
    say(reset=call(Trigger, f"{name}/reset", Trigger.Request()).success)
    say(tare=call(Trigger, f"{name}/tare", Trigger.Request()).success)
    listen(seconds)
    step("deactivate")
    step("cleanup")
    rclpy.shutdown()


main(sys.argv[1], float(sys.argv[2]))
