"""The ROS 2 packages: a lifecycle node with services and an action, and whom it tells what is held.

The tests marked full run the node beside nodes that offer what franka_ros2, ur_robot_driver and MoveIt do; they need
armload_msgs in the ROS 2 environment (tests/devices/ros/build_messages.py).
"""

import ast
import importlib
import json
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from tests.recording.test_recording_bags import write_bag

from armload.errors import RecordingError, UsageError
from armload.inertia import InertialParameters
from armload.motion import random_motion, taie2024
from armload.payloads import Payload, write_payload
from armload.payloads import test_payload as example_payload
from armload.payloads.uncertainty import Uncertainty
from armload.recording import Sample
from armload.service.tare import Tare
from armload.simulation import simulate

ROOT = Path(__file__).resolve().parents[2]
ARMLOAD = ("-m", "armload", "ros2")
NODE = ("-m", "armload_ros.payload_identifier")
PROGRAMS = ROOT / "tests" / "devices" / "ros"


@pytest.fixture(scope="module")
def messages(ros_python):
    """The interfaces that are built, not installed."""
    look = "import armload_msgs.msg, franka_msgs.srv, ur_msgs.srv, moveit_msgs.srv, tf2_msgs.msg"
    done = subprocess.run([ros_python, "-c", look], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"messages are not built: {done.stderr.strip().splitlines()[-1]}")


@pytest.mark.full
@pytest.mark.usefixtures("messages")
@pytest.mark.parametrize("steady", ["false", "true"])
def test_the_lifecycle_node_has_states_services_remapping_and_a_namespace(ros, wait_until, steady):
    names = ("__ns:=/left", "joint_states:=/joint_states")
    renamed = [word for name in names for word in ("-r", name)]
    given = [word for name in ("robot:=panda", "tare_duration:=4.0", f"steady:={steady}") for word in ("-p", name)]
    held = example_payload().parameters
    with (
        ros(*ARMLOAD, "simulate", "--robot", "panda", "--payload", "test", "--motion", "taie2024") as robot,
        ros(*NODE, "--ros-args", *renamed, *given) as node,
        ros(ROOT / "tests/devices/ros/drive_lifecycle.py", "/left/payload_identifier", 8) as driver,
    ):
        wait_until(lambda: driver.poll() is not None, 120, driver, node, robot)
        said = [json.loads(line) for line in driver.printed_lines()]
    steps = {line["step"]: (line["success"], line["state"]) for line in said if "step" in line}
    assert steps == {
        "configure": (True, "inactive"),
        "activate": (True, "active"),
        "deactivate": (True, "inactive"),
        "cleanup": (True, "unconfigured"),
    }
    assert [line["tare"] for line in said if "tare" in line] == [False, True]  # nobody listens before it is active
    reset = said.index({"reset": True})
    before, after = said[:reset], said[reset:]
    *_, body = (line for line in before if "payload" in line)
    assert body["frame"] == "panda_link8"
    assert abs(body["payload"] - held.mass) < 0.05
    *_, estimate = (line["estimate"] for line in before if "estimate" in line)
    assert estimate["low"] < held.mass < estimate["high"]
    assert any(line.get("level") == 0 and "kg, calibrated" in line["diagnostics"] for line in before)
    assert any("taring" in line.get("diagnostics", "") for line in after)
    *_, tared = (line["estimate"] for line in after if "estimate" in line)
    assert (tared["relative_to"], tared["held"]) == ("tare", False)  # what was mounted at the tare is the arm's


@pytest.mark.full
@pytest.mark.usefixtures("messages")
def test_the_lifecycle_node_tells_velocities_by_the_positions_where_there_are_none(ros, wait_until, panda, tmp_path):
    held = example_payload().parameters
    log = simulate(panda, random_motion(panda, 3, duration=40.0), held, rate=200.0)
    file = tmp_path / "log.npz"
    np.savez(file, t=log.t, q=log.q, dq=log.dq, tau=log.tau, names=list(panda.joint_names))
    with (
        ros(PROGRAMS / "publish_recording.py", file, "/joint_states", START, "velocity"),
        ros(*NODE, "--ros-args", "-r", "joint_states:=/joint_states", "-p", "robot:=panda") as node,
        ros(PROGRAMS / "drive_lifecycle.py", "/payload_identifier", 8) as driver,
    ):
        wait_until(lambda: driver.poll() is not None, 120, driver, node)
        said = [json.loads(line) for line in driver.printed_lines()]
        assert "joint_states has no velocities" in node.noted()
    *_, estimate = (line["estimate"] for line in said[: said.index({"reset": True})] if "estimate" in line)
    assert estimate["low"] < held.mass < estimate["high"] < held.mass + 0.2


@pytest.mark.full
@pytest.mark.usefixtures("messages")
def test_the_lifecycle_node_stays_unconfigured_with_a_wrong_parameter_and_says_which(ros, wait_until):
    with (
        ros(*NODE, "--ros-args", "-p", "robot:=pandas") as node,
        ros(ROOT / "tests/devices/ros/drive_lifecycle.py", "/payload_identifier", 1) as driver,
    ):
        wait_until(lambda: any("configure" in line for line in driver.printed_lines()), 60, driver, node)
        (line,) = driver.printed_lines()[:1]
        assert json.loads(line) == {"step": "configure", "success": False, "state": "unconfigured"}
        assert "unknown robot 'pandas'" in node.noted()


HELD = InertialParameters(0.35 * example_payload().parameters.phi, "panda_link8")  # 0.5 kg
START = 1_700_000_000 * 10**9


@pytest.fixture(scope="module")
def moved_and_at_rest(panda, tmp_path_factory):
    """A log of 6 s of motion with the payload, and of two minutes of rest after it."""
    log = simulate(panda, taie2024(), HELD, rate=100.0)
    still = 12_000
    noise = np.random.default_rng(1).normal(0.0, 0.02, (still, 7))
    rest = panda.with_payload(HELD).torque(log.q[-1]) + noise
    path = tmp_path_factory.mktemp("log") / "log.npz"
    np.savez(
        path,
        t=np.concatenate([log.t, log.t[-1] + 0.01 * np.arange(1, still + 1)]),
        q=np.vstack([log.q, np.repeat(log.q[-1:], still, axis=0)]),
        dq=np.vstack([log.dq, np.zeros((still, 7))]),
        tau=np.vstack([log.tau, rest]),
        names=np.array(panda.joint_names),
    )
    return path


@pytest.fixture
def scene(request, ros, wait_until, moved_and_at_rest):
    """The node, whom it may tell, the arm's driver, and who gives orders; what came of an order."""
    request.getfixturevalue("messages")

    @contextmanager
    def opened(*given, offers=()):
        parameters = [word for each in ("robot:=panda", *given) for word in ("-p", each)]
        with (
            ros(PROGRAMS / "offer_services.py", *(offers or ("franka_ros2",))) as offered,
            ros(*NODE, "--ros-args", *parameters) as node,
            ros(PROGRAMS / "drive_services.py", "/payload_identifier", orders=True) as client,
            ros(PROGRAMS / "publish_recording.py", moved_and_at_rest, "/joint_states", START) as driver,
        ):

            def said(key):
                return [line for line in map(json.loads, client.printed_lines()) if key in line]

            def order(what, seconds=120.0, **how):
                before = len(said("measure" if what == "cancel" else what))
                client.stdin.write(json.dumps({what: how}) + "\n")
                client.stdin.flush()
                key = "measure" if what == "cancel" else what
                wait_until(lambda: len(said(key)) > before, seconds, client, node, driver)
                return said(key)[-1]

            order.said = said
            order.wait = lambda true: wait_until(true, 90.0, client, node, driver)
            order.silence = driver.terminate
            order.offered = lambda: [json.loads(line) for line in offered.printed_lines()]
            yield order

    return opened


def last(lines):
    return lines[-1] if lines else None


def at_rest(order):
    """Wait until the arm rests, its payload known."""

    def resting():
        said = order.said("estimate")
        return len(said) > 70 and said[-1]["estimate"]["known"]  # 7 s, ten times a second

    order.wait(resting)
    return last(order.said("estimate"))["estimate"]


@pytest.mark.full
def test_the_payload_has_covariance_probabilities_and_a_frame_at_its_centre_of_mass(scene):
    with scene("com_frame:=left_payload") as order:
        measured = order("measure", mass=0.1, timeout=60.0)
        assert (measured["measure"], measured["success"], measured["status"]) == ("known as well as asked", True, 4)
        payload = measured["payload"]
        assert abs(payload["phi"][0] - HELD.mass) < 0.1
        assert 0.5 * (payload["high"][0] - payload["low"][0]) <= 0.1
        assert measured["left"][-1][0] <= 1.0
        said = at_rest(order)
        covariance = np.reshape(said["covariance"], (10, 10))
        np.testing.assert_allclose(covariance, covariance.T)
        assert (np.array(said["low"]) <= said["phi"]).all()
        assert (np.array(said["high"]) >= said["phi"]).all()
        assert said["p_held"] > 0.9
        assert (said["held"], said["relative_to"], said["robot"], said["frame"]) == (
            True,
            "arm",
            "panda",
            "panda_link8",
        )
        np.testing.assert_allclose(said["body"][1:], HELD.com, atol=0.02)
        frame = last(order.said("tf"))
        assert (frame["child"], frame["parent"]) == ("left_payload", "panda_link8")
        np.testing.assert_allclose(frame["tf"], HELD.com, atol=0.02)
        assert said["stamp"] > START / 1e9  # by the driver's stamps
        refused = order("measure")  # nothing is asked
        assert refused["measure"] == "rejected"
        late = order("measure", inertia=1e-9, timeout=1.0)
        assert (late["measure"], late["success"], late["status"]) == ("the time is over", False, 6)
        cancelled = order("cancel", inertia=1e-9, timeout=60.0)
        assert (cancelled["measure"], cancelled["status"]) == ("cancelled", 5)
        order.silence()
        time.sleep(0.5)
        forgotten = order("measure", mass=0.1, forget=True, timeout=0.5)
        assert (forgotten["measure"], forgotten["payload"]["known"]) == ("the time is over", False)


@pytest.mark.full
def test_a_known_mass_and_a_known_tool_begin_the_stream_anew(scene):
    with scene() as order:
        at_rest(order)
        wrong = order("set_mass", mass=0.5, std=-1.0)
        assert not wrong["set_mass"]
        assert "standard deviation above zero" in wrong["message"]
        told = order("set_mass", mass=HELD.mass, std=0.001)
        assert told["set_mass"], told["message"]
        heavy = order("set_tool", m=700.0, z=0.05, i=0.001)
        assert not heavy["set_tool"]
        assert "give kilograms" in heavy["message"]
        for impossible, said in (
            ({"m": -1.0, "z": 0.05, "i": 0.001}, "the tool has a mass of -1 kg"),
            ({"m": 0.2, "z": 0.05, "i": -0.001}, "the tool cannot exist"),
            ({"m": 0.2, "z": 50.0, "i": 0.001}, "is it in millimetres?"),
            ({"m": 0.2, "z": 0.05, "i": 9.0}, "is it in kg·m²?"),
        ):
            told = order("set_tool", **impossible)
            assert not told["set_tool"]
            assert said in told["message"]
        told = order("set_tool", m=0.2, z=0.05, i=0.0002)
        assert told["set_tool"], told["message"]
        order.wait(lambda: last(order.said("estimate"))["estimate"]["relative_to"] == "tool")
        assert order("apply")["apply"] is False  # nobody was named


@pytest.mark.full
def test_a_drawing_that_the_parameters_name_stays_known_when_a_mass_is_said(scene, tmp_path):
    drawn = Payload("part", HELD, uncertainty=Uncertainty(mass=0.05, com=0.002, inertia=0.05))
    write_payload(tmp_path / "part.json", drawn)
    inertia = HELD.phi[4:]
    widths = {}
    with scene(f"body:={tmp_path / 'part.json'}") as order:
        for name in ("drawn", "weighed, too"):
            if name != "drawn":
                told = order("set_mass", mass=HELD.mass, std=0.001)
                assert told["set_mass"], told["message"]
                before = len(order.said("estimate"))
                order.wait(
                    lambda n=before: (
                        len(order.said("estimate")) > n + 30 and last(order.said("estimate"))["estimate"]["known"]
                    )
                )
            said = at_rest(order)
            low, high = np.array(said["low"]), np.array(said["high"])
            assert np.sum((low[4:] <= inertia) & (inertia <= high[4:])) >= 5
            widths[name] = high - low
    known = 4.0 * 0.05 * np.abs(inertia[[0, 3, 5]])  # 95 % of what the drawing says, about its centre of mass
    for name, width in widths.items():
        assert (width[[4, 7, 9]] < 3.0 * known).all(), name
    assert widths["weighed, too"][0] < 0.01 < widths["drawn"][0]


@pytest.mark.full
def test_a_franka_driver_is_told_in_steps_at_rest_and_its_refusal_is_said(scene):
    with scene("apply:=franka_ros2", offers=("franka_ros2",)) as order:
        known = at_rest(order)
        told = order("apply")
        assert told["apply"], told["message"]
        loads = order.offered()
        masses = [load["mass"] for load in loads]
        assert len(masses) > 3
        assert masses == sorted(masses)
        assert masses[-1] == pytest.approx(known["phi"][0], abs=0.02)
        np.testing.assert_allclose(loads[-1]["center_of_mass"], HELD.com, atol=0.02)
        inertia = np.reshape(loads[-1]["load_inertia"], (3, 3))
        np.testing.assert_allclose(inertia, inertia.T)
        assert (np.linalg.eigvalsh(inertia) > 0.0).all()
    with scene("apply:=franka_ros2", offers=("franka_ros2", "a motion is running")) as order:
        at_rest(order)
        told = order("apply")
        assert not told["apply"]
        assert "a motion is running" in told["message"]


@pytest.mark.full
@pytest.mark.parametrize("words", ["a motion is running", "gone"])
def test_a_driver_that_fails_between_two_steps_is_told_no_more_and_what_it_counts_is_said(scene, words):
    with scene("apply:=franka_ros2", offers=("franka_ros2", words, 2)) as order:
        at_rest(order)
        told = order("apply")
        assert not told["apply"]
        assert len(order.offered()) == 3
        counted = order.offered()[1]["mass"]
        if words == "gone":
            assert (
                "does not answer within 5 s, and may have taken the load: see that the driver runs" in told["message"]
            )
        else:
            assert f"{words}; it counts {counted:.3f} of " in told["message"]


@pytest.mark.full
def test_a_ur_driver_is_told_inertia_and_a_transition_and_by_itself_where_that_is_asked(scene):
    with scene("apply:=ur_robot_driver", "apply_auto:=true", offers=("ur_robot_driver",)) as order:
        known = at_rest(order)
        order.wait(lambda: order.offered() and abs(order.offered()[-1]["mass"] - known["phi"][0]) < 0.05)
        load = order.offered()[-1]
        gravity = load["center_of_gravity"]
        np.testing.assert_allclose([gravity["x"], gravity["y"], gravity["z"]], HELD.com, atol=0.02)
        assert min(load["ixx"], load["iyy"], load["izz"]) > 0.0
        assert load["transition_time"] == {"sec": 0, "nanosec": 200_000_000}
        told = order("apply")
        assert (told["apply"], told["message"]) == (False, "apply_auto is set: it is told by itself")


@pytest.mark.full
def test_moveit_gets_an_object_attached_to_the_link_with_its_weight(scene):
    links = 'touch_links:=["panda_hand"]'
    with scene("apply:=moveit", links, offers=("moveit",)) as order:
        known = at_rest(order)
        told = order("apply")
        assert told["apply"], told["message"]
        (request,) = order.offered()
        assert request["scene"]["is_diff"]
        assert request["scene"]["robot_state"]["is_diff"]
        (attached,) = request["scene"]["robot_state"]["attached_collision_objects"]
        assert attached["link_name"] == attached["object"]["header"]["frame_id"] == "panda_link8"
        assert attached["touch_links"] == ["panda_hand"]
        assert attached["weight"] == pytest.approx(known["phi"][0], abs=0.05)
        assert attached["object"]["operation"] == 0  # ADD
        (ball,), (pose,) = attached["object"]["primitives"], attached["object"]["primitive_poses"]
        volume = 4.0 / 3.0 * np.pi * ball["dimensions"][0] ** 3
        assert volume * 1000.0 == pytest.approx(attached["weight"], rel=1e-6)
        np.testing.assert_allclose([pose["position"][k] for k in "xyz"], HELD.com, atol=0.02)
        assert order("step", transition=4)["success"]
        time.sleep(1.0)
        told = order("apply")  # of a node that does not listen
        assert (told["apply"], told["message"]) == (False, "the answer is unknown")
        assert len(order.offered()) == 1


@pytest.mark.full
def test_a_controller_is_told_nothing_that_is_in_doubt(scene):
    with scene("apply:=franka_ros2", "gravity:=[1.3,0.0,-9.7]", offers=("franka_ros2",)) as order:
        at_rest(order)
        told = order("apply")
        assert not told["apply"]
        assert told["message"].startswith("the answer is in doubt: "), told["message"]
        assert not order.offered()


@pytest.mark.full
def test_two_requests_at_once_tell_a_controller_one_load(scene):
    with scene("apply:=franka_ros2", offers=("franka_ros2",)) as order:
        at_rest(order)
        told = dict(order("apply_twice")["apply_twice"])
        assert told.pop("it is being told already") is False
        assert list(told.values()) == [True], told


@pytest.mark.full
def test_whoever_waits_for_a_measurement_hears_of_its_end_when_the_node_is_cleaned_up(scene):
    with scene() as order:
        assert order("leave", inertia=1e-9, timeout=60.0) == {
            "leave": "the node is not active any more",
            "steps": [True, True],
        }


_ENDING = """
import sys
import rclpy
from armload_ros import payload_identifier

def fail(node):
    if sys.argv[1] == "ended":
        rclpy.shutdown()
    raise RuntimeError("publisher's context is invalid")

rclpy.spin = fail
payload_identifier.main()
"""


@pytest.mark.full
@pytest.mark.usefixtures("messages")
@pytest.mark.parametrize("ended", [True, False])
def test_a_message_that_a_signal_cuts_off_is_no_failure(ros, ended):
    with ros("-c", _ENDING, "ended" if ended else "") as node:
        assert node.wait(60) == (0 if ended else 1)
        assert ("Traceback" in node.noted()) is not ended


_WAITED = """
import time
import rclpy
from armload import arm
from armload_ros.payload_identifier import PayloadIdentifier
from sensor_msgs.msg import JointState

rclpy.init()
node, panda = PayloadIdentifier(), arm("panda")
node.trigger_configure()
node.trigger_activate()
q = panda.limits.middle
message = JointState(name=panda.joint_names, position=q, velocity=[0.0] * 7, effort=panda.torque(q))
message.header.stamp.sec = 1
for waited in (0.0, 1.5):
    message.header.stamp.nanosec += 10_000_000
    node._take(message, {"received_timestamp": time.time_ns() - round(waited * 1e9)})
    print(node._stream.estimate.age, flush=True)
"""


@pytest.mark.full
@pytest.mark.usefixtures("messages")
def test_what_a_busy_lifecycle_node_says_is_as_old_as_the_message_that_waited(ros):
    with ros("-c", _WAITED) as node:
        node.wait(60)
        soon, late = map(float, node.printed_lines())
    assert 0.0 <= soon < 1.0
    assert late == pytest.approx(1.5, abs=0.5)


_DIAGNOSED = """
from types import SimpleNamespace
from armload_ros.diagnostics import status_of

print(status_of(None, SimpleNamespace(notes=["no sample", "a hint"]), "no sample").message)
"""


@pytest.mark.full
@pytest.mark.usefixtures("messages")
def test_diagnostics_say_a_reason_once_that_is_also_a_note(ros):
    with ros("-c", _DIAGNOSED) as diagnosed:
        assert diagnosed.wait(60) == 0
        assert diagnosed.printed_lines() == ["no sample; a hint"]


@pytest.mark.full
@pytest.mark.usefixtures("messages")
def test_a_parameter_of_another_kind_leaves_the_lifecycle_node_unconfigured_and_it_says_which(ros, wait_until):
    with (
        ros(*NODE, "--ros-args", "-p", "rate:=10", "-p", "steady:=1") as node,
        ros(PROGRAMS / "drive_lifecycle.py", "/payload_identifier", 1) as driver,
    ):
        wait_until(lambda: any("configure" in line for line in driver.printed_lines()), 60, driver, node)
        assert json.loads(driver.printed_lines()[0]) == {"step": "configure", "success": False, "state": "unconfigured"}
        assert "the parameter steady is 1: expected true or false" in node.noted()
        assert "Traceback" not in node.noted()


@pytest.fixture
def package(monkeypatch):
    """Imports a module of armload_ros that needs no ROS."""
    monkeypatch.syspath_prepend(str(ROOT / "ros2" / "armload_ros"))
    return lambda name: importlib.import_module(f"armload_ros.{name}")


def test_a_ros_stream_that_was_interrupted_is_confirmed_first(package, panda, monkeypatch):
    log, now = simulate(panda, taie2024(), HELD, rate=100.0), [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    stream = package("stream").Stream(panda)

    def take(k):
        now[0] += 0.01
        stream.update(Sample(0.01 * k, log.q[k], log.dq[k], log.tau[k]))

    for k in range(300):
        take(k)
    assert stream.why_unknown() is None
    now[0] += 3600.0
    assert stream.why_unknown() == "no sample for 3600.0 s"
    take(300)
    assert "since the interruption" in stream.why_unknown()
    for k in range(301, 420):
        take(k)
    assert stream.why_unknown() is None
    stream.close()


def test_a_tare_on_ros_is_of_the_samples_that_can_be_used_and_ends_whatever_the_clock_does(package, panda):
    log = simulate(panda, taie2024(), HELD, rate=100.0)
    taring, seconds = package("taring").Taring(panda), 0.0
    for k, sample in enumerate(log):
        t = sample.t - 1000.0 * (k >= 200)  # set back, as where a simulation begins anew
        tau = np.full(7, np.nan) if k % 50 == 0 else sample.tau
        seconds = taring.take(sample._replace(t=t, tau=tau))
    tare = taring.recording(panda.joint_names)
    assert seconds == tare.duration == pytest.approx(log.duration, abs=0.5)
    assert len(tare) == len(log) - len(range(0, len(log), 50))


def test_a_tool_on_ros_goes_with_a_tare_of_the_stream_alone(package, panda):
    log = simulate(panda, taie2024(), rate=100.0)
    robot, stream = panda.with_payload(HELD), package("stream").Stream
    with pytest.raises(UsageError, match="cannot be found out on a stream"):
        stream(robot, Tare(log))
    stream(robot, Tare(log, taken=True)).close()


@pytest.mark.parametrize("kind", ["torque", "without gravity", "currents"])
def test_the_parameters_say_what_effort_is_on_the_topic_and_in_a_tares_bag(package, panda, tmp_path, kind):
    parameters, log = package("parameters"), simulate(panda, taie2024(), rate=100.0)
    given = dict(parameters.DEFAULTS)
    sent = {"torque": log.tau, "without gravity": log.tau - panda.torque(log.q), "currents": log.tau / 8.0}[kind]
    if kind == "without gravity":
        given["compensated"] = "nothing"
    elif kind == "currents":
        given["torque_constants"] = [8.0] * 7
    stamps = [1_700_000_000_000_000_000 + round(1e9 * t) for t in log.t]
    rows = zip(stamps, stamps, [panda.joint_names] * len(log), log.q, log.dq, sent, strict=True)
    given["tare"] = str(write_bag(tmp_path, "mcap", {"/joint_states": list(rows)}))
    asked = parameters.Parameters(given.__getitem__)
    assert np.allclose(asked.effort(panda).torque(log.q[7], sent[7]), log.tau[7], atol=1e-9)
    assert np.allclose(asked.tare(panda).tau, log.tau, atol=1e-9)
    if kind == "without gravity":  # what armload itself has recorded of the topic
        rows = zip(stamps, stamps, [panda.joint_names] * len(log), log.q, log.dq, log.tau, strict=True)
        given["tare"] = str(write_bag(tmp_path, "mcap", {"/joint_states": list(rows)}, "recorded"))
        with pytest.raises(RecordingError, match="gravity in it already"):
            asked.tare(panda)


def test_a_ros_parameter_is_of_its_default_s_kind_whatever_number_yaml_takes_it_for(package):
    parameters = package("parameters")
    given = parameters.DEFAULTS | {"rate": 20, "gravity": (0, 0, -9), "mass": 1.2, "touch_links": ("hand",)}
    read = parameters.as_declared(given)
    assert {name: read[name] for name in ("rate", "gravity", "mass", "touch_links")} == {
        "rate": 20.0,
        "gravity": [0.0, 0.0, -9.0],
        "mass": "1.2",
        "touch_links": ["hand"],
    }
    assert parameters.as_declared(parameters.DEFAULTS) == parameters.DEFAULTS


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("rate", 0.0, "a number above 0"),
        ("rate", float("nan"), "a number above 0"),
        ("timeout", -1.0, "a number above 0"),
        ("tare_duration", "20 s", "a number above 0"),
        ("end_effector", -0.1, "a number of 0 or more"),
        ("steady", 1, "true or false"),
        ("robot", True, "text"),
        ("gravity", [0.0, 0.0, float("inf")], "a list of numbers"),
        ("touch_links", [1], "a list of texts"),
    ],
)
def test_a_ros_parameter_that_cannot_be_is_named_before_anything_is_made(package, name, value, expected):
    parameters = package("parameters")
    with pytest.raises(UsageError, match=f"the parameter {name} is .*: expected {expected}"):
        parameters.as_declared(parameters.DEFAULTS | {name: value})


@pytest.mark.full
@pytest.mark.usefixtures("messages")
def test_without_a_clock_simulated_time_is_said_to_be_missing(ros, wait_until):
    with (
        ros(*NODE, "--ros-args", "-p", "use_sim_time:=true") as node,
        ros(ROOT / "tests/devices/ros/drive_lifecycle.py", "/payload_identifier", 3) as driver,
    ):
        wait_until(lambda: driver.poll() is not None, 120, driver, node)
        said = [json.loads(line).get("diagnostics") for line in driver.printed_lines()]
    assert "use_sim_time is set, and nothing comes on /clock" in said


def test_the_ros_package_names_what_it_imports_and_installs_what_it_needs():
    folder = ROOT / "ros2" / "armload_ros"
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    needs = {element.text for element in manifest.iter("exec_depend")}
    imported = set()
    for path in [*folder.glob("armload_ros/*.py"), *folder.glob("launch/*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module is not None and node.level == 0:
                imported.add(node.module.split(".")[0])
            elif isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "armload":
                module = importlib.import_module(node.module)
                assert all(hasattr(module, alias.name) for alias in node.names), (path.name, node.module)
    ours = {"armload", "numpy", *sys.stdlib_module_names, "__future__"}
    assert imported - ours == needs
    assert manifest.findtext("name") == "armload_ros"
    setup = (folder / "setup.py").read_text(encoding="utf-8")
    for path in ("launch/payload.launch.py", "config/payload.yaml", "package.xml"):
        assert path in setup
        assert (folder / path).exists()
    parameters = (folder / "config" / "payload.yaml").read_text(encoding="utf-8")
    source = (folder / "armload_ros" / "parameters.py").read_text(encoding="utf-8")
    defaults = re.search(r"DEFAULTS.*?= (\{.*?^\})", source, re.DOTALL | re.MULTILINE)
    assert defaults is not None
    assert yaml.safe_load(parameters)["/**"]["ros__parameters"] == ast.literal_eval(defaults[1])
