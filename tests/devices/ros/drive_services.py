"""Activates the node armload_ros and does what standard input says, one line of JSON each; prints what came of it.

    drive_services.py NODE

{"apply": {}}, {"apply_twice": {}} at once, {"set_mass": {"mass": …, "std": …}}, {"set_tool": {"m": …, "z": …, "i": …}},
{"measure": {"mass": …}}, {"cancel": {…}}: a measurement that is cancelled after its first feedback,
{"step": {"transition": …}}, {"leave": {"mass": …}}: a measurement whose
node is deactivated and cleaned up at once. Every answer and frame is printed, too.
"""

import json
import sys
import threading
import time

import rclpy
from armload_msgs.action import Measure
from armload_msgs.msg import Payload
from armload_msgs.srv import SetMass, SetTool
from lifecycle_msgs.srv import ChangeState
from rclpy.action import ActionClient
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

name = sys.argv[1]
rclpy.init()
node = rclpy.create_node("driver")


speaking = threading.Lock()


def say(**what):
    with speaking:
        print(json.dumps(what), flush=True)


def numbers(message):
    keep = ("known", "held", "calibrated", "settling", "p_held", "relative_to", "robot")
    said = {key: getattr(message, key) for key in keep}
    arrays = {key: getattr(message, key).tolist() for key in ("phi", "low", "high", "covariance")}
    stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
    body = [message.inertia.m, message.inertia.com.x, message.inertia.com.y, message.inertia.com.z]
    events = [{"kind": event.kind, "mass": event.mass} for event in message.event]
    return {**said, **arrays, "stamp": stamp, "frame": message.header.frame_id, "body": body, "events": events}


def frames(message):
    for each in message.transforms:
        at = each.transform.translation
        say(tf=[at.x, at.y, at.z], child=each.child_frame_id, parent=each.header.frame_id)


def wait(future, seconds=60.0):
    until = time.monotonic() + seconds
    while not future.done() and time.monotonic() < until:
        time.sleep(0.01)
    return future.result()


def call(kind, service, request):
    client = node.create_client(kind, f"{name}/{service}")
    if not client.wait_for_service(60.0):
        raise SystemExit(f"{service} is not there")
    return wait(client.call_async(request))


def step(transition):
    request = ChangeState.Request()
    request.transition.id = transition
    say(step=transition, success=call(ChangeState, "change_state", request).success)


def measure(goal, cancel):
    client = ActionClient(node, Measure, f"{name}/measure")
    client.wait_for_server(60.0)
    heard = threading.Event()
    seen = []

    def feedback(message):
        seen.append(list(message.feedback.left))
        heard.set()

    handle = wait(client.send_goal_async(Measure.Goal(**goal), feedback))
    if not handle.accepted:
        say(measure="rejected")
        return
    if cancel:
        heard.wait(30.0)
        wait(handle.cancel_goal_async())
    result = wait(handle.get_result_async())
    said = result.result
    say(measure=said.message, success=said.success, status=result.status, left=seen, payload=numbers(said.payload))


def leave(goal):
    client = ActionClient(node, Measure, f"{name}/measure")
    client.wait_for_server(60.0)
    result = wait(client.send_goal_async(Measure.Goal(**goal))).get_result_async()
    change = node.create_client(ChangeState, f"{name}/change_state")
    requests = [ChangeState.Request() for _ in range(2)]
    requests[0].transition.id, requests[1].transition.id = 4, 2
    both = [change.call_async(request) for request in requests]
    steps, ended = [wait(each).success for each in both], wait(result, 10.0)
    say(leave=None if ended is None else ended.result.message, steps=steps)


def tool(given):
    request = SetTool.Request()
    request.tool.inertia.m = given["m"]
    request.tool.inertia.com.z = given["z"]
    request.tool.inertia.ixx = request.tool.inertia.iyy = request.tool.inertia.izz = given["i"]
    return call(SetTool, "set_tool", request)


node.create_subscription(Payload, f"{name}/estimate", lambda m: say(estimate=numbers(m)), 10)
node.create_subscription(TFMessage, "/tf", frames, 10)
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
step(1)
step(3)
for line in sys.stdin:
    ((what, given),) = json.loads(line).items()
    if what in ("measure", "cancel"):
        measure(given, what == "cancel")
        continue
    if what == "leave":
        leave(given)
        continue
    if what == "step":
        step(given["transition"])
        continue
    if what == "apply_twice":
        client = node.create_client(Trigger, f"{name}/apply")
        both = [client.call_async(Trigger.Request()) for _ in range(2)]
        say(apply_twice=[(said.message, said.success) for said in map(wait, both)])
        continue
    if what == "apply":
        said = call(Trigger, "apply", Trigger.Request())
    elif what == "set_mass":
        said = call(SetMass, "set_mass", SetMass.Request(**given))
    else:
        said = tool(given)
    say(**{what: said.success, "message": said.message})
