"""ROS 2: joints by name, the convention of the inertia that is published, trajectories as the controller takes them.

The tests marked full run `armload ros2` and plain rclpy programs (tests/devices/ros) side by side on a real ROS 2. Its
Python is ARMLOAD_ROS_PYTHON, one that can import rclpy and armload, or else that of `make .venv-ros/.stamp`.
"""

import importlib.util
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from rosbags.typesys import Stores, get_typestore

from armload.arms import arm
from armload.devices import Ros2Source
from armload.devices.ros2 import (
    CommandedMotion,
    TrajectoryMotion,
    announced,
    message_of,
    parameters_of,
    read_trajectory,
)
from armload.devices.ros2.effort import Effort
from armload.devices.ros2.joint_states import JointStates
from armload.devices.ros2.receipt import Receipt
from armload.errors import MotionError, SourceError
from armload.estimators import Estimate
from armload.inertia import InertialParameters, is_consistent, to_order
from armload.motion import taie2024
from armload.online import OnlineEstimate, OnlineIdentifier
from armload.payloads import test_payload as example_payload
from armload.payloads import write_payload
from armload.simulation import simulate

ROOT = Path(__file__).resolve().parents[2]
TYPES = get_typestore(Stores.ROS2_JAZZY).types  # the messages' definitions, without ROS
SECOND = 1_000_000_000


def ros_type(name):
    return TYPES[name.replace("/", "/msg/")]


def header(stamp=0, frame=""):
    return ros_type("std_msgs/Header")(ros_type("builtin_interfaces/Time")(*divmod(stamp, SECOND)), frame)


def joint_state(names, q, dq, tau, stamp=0):
    return ros_type("sensor_msgs/JointState")(header(stamp), list(names), *map(np.asarray, (q, dq, tau)))


def inertia_stamped():
    vector = ros_type("geometry_msgs/Vector3")(0.0, 0.0, 0.0)
    return ros_type("geometry_msgs/InertiaStamped")(
        header(), ros_type("geometry_msgs/Inertia")(0.0, vector, *[0.0] * 6)
    )


def trajectory(names, points):
    """points: (time [s], positions, velocities, accelerations)."""
    duration, point = ros_type("builtin_interfaces/Duration"), ros_type("trajectory_msgs/JointTrajectoryPoint")
    made = [point(q, dq, ddq, [], duration(*divmod(round(t * SECOND), SECOND))) for t, q, dq, ddq in points]
    return ros_type("trajectory_msgs/JointTrajectory")(header(), list(names), made)


# ------------------------------------------------------------------ joint states


def test_joints_are_known_by_name_in_any_order_and_among_others(panda):
    rng = np.random.default_rng(1)
    values = {name: rng.normal(size=3) for name in (*panda.joint_names, "finger_left", "finger_right")}
    names = [*values]
    states = JointStates(panda, "/joint_states")
    for _ in range(3):
        rng.shuffle(names)
        q, dq, tau = np.array([values[name] for name in names]).T
        sample = states.sample(joint_state(names, q, dq, tau, SECOND), 0)
        expected = np.array([values[name] for name in panda.joint_names]).T
        assert np.array_equal([sample.q, sample.dq, sample.tau], expected)


def test_joints_are_known_by_another_driver_s_names_on_the_arm_s_sheet():
    states, q = JointStates(arm("iiwa14"), "/joint_states"), np.arange(7.0)
    names = [f"iiwa_joint_{k}" for k in range(1, 8)]
    sample = states.sample(joint_state(names[::-1], q[::-1], q[::-1], q[::-1], SECOND), 0)
    assert np.array_equal([sample.q, sample.dq, sample.tau], [q, q, q])


def test_efforts_that_are_currents_or_lack_gravity_become_torque(tmp_path):
    """As UR's driver publishes them: of joints in another order, from the first message on."""
    ur, rng = arm("ur5e"), np.random.default_rng(2)
    q, dq, tau = rng.normal(size=(3, 6))
    constants = np.array([12.0, 12.0, 10.0, 11.0, 11.0, 11.0])
    held = example_payload()
    write_payload(tmp_path / "set.json", held)
    tool = ur.with_payload(InertialParameters.from_com(0.8, (0.0, 0.0, 0.05), 1e-3 * np.eye(3)))
    for robot in (ur, tool):  # the controller knows nothing of a tool but what it was set to
        for how, sent in (
            ({"torque_constants": constants}, tau / constants),
            ({"compensated": "nothing"}, tau - ur.torque(q)),
            ({"compensated": str(tmp_path / "set.json")}, tau - ur.with_payload(held.parameters).torque(q)),
        ):
            states = JointStates(robot, "/joint_states", Effort(robot, **how))
            message = joint_state(ur.joint_names[::-1], q[::-1], dq[::-1], sent[::-1], SECOND)
            assert np.allclose(states.sample(message, 0).tau, tau, atol=1e-9)


@pytest.mark.parametrize(("stamp", "simulated"), [(0, False), (12 * SECOND, True), (1_790_000_000 * SECOND, False)])
def test_stamps_that_show_no_time_of_day_are_of_simulated_time(panda, stamp, simulated):
    """It runs slower or faster than time does; messages without stamps are timed when they come."""
    states = JointStates(panda, "/joint_states")
    assert not states.simulated
    states.sample(joint_state(panda.joint_names, *np.ones((3, 7)), stamp), 1_790_000_000 * SECOND)
    assert states.simulated == simulated


@pytest.mark.parametrize("step", [-3600.0, -0.5, 0.5, 3600.0])
def test_a_clock_that_is_set_while_messages_wait_makes_none_of_them_old(step):
    """Messages wait for 20 ms each; one that came just after the clock of this machine was set may seem younger."""
    receipt, set_at = Receipt(), 2.0
    for k in range(400):
        came, taken = 0.01 * k, 0.01 * k + 0.02
        received, wall = (round(1e9 * (1.79e9 + t + step * (t > set_at))) for t in (came, taken))
        waited = receipt.waited(received, wall, round(1e9 * taken))
        assert -1e-6 <= waited <= 0.02 + 1e-6
        assert abs(taken - set_at) < 0.05 or waited == pytest.approx(0.02, abs=1e-6)
    assert receipt.waited(0, wall, round(1e9 * taken)) == 0.0


def test_a_message_of_another_device_is_no_sample(panda):
    states = JointStates(panda, "/joint_states")
    assert states.sample(joint_state(["finger"], [0.0], [0.0], [0.0], SECOND), 0) is None
    assert states.others == {"finger"}


@pytest.mark.parametrize("what", ["position", "velocity", "effort"])
def test_what_never_comes_is_an_error_and_what_lacks_once_is_missing(panda, what):
    whole = {"position": np.zeros(7), "velocity": np.zeros(7), "effort": np.ones(7)}
    lacking = whole | {what: []}
    with pytest.raises(SourceError, match=f"/joint_states has no {what} for its 7 joints"):
        JointStates(panda, "/joint_states").sample(joint_state(panda.joint_names, *lacking.values(), SECOND), 0)
    states = JointStates(panda, "/joint_states")
    states.sample(joint_state(panda.joint_names, *whole.values(), SECOND), 0)
    sample = states.sample(joint_state(panda.joint_names, *lacking.values(), 2 * SECOND), 0)
    missing = {name: bool(np.isnan(x).all()) for name, x in zip(whole, sample[1:], strict=True)}
    assert missing == {name: name == what for name in whole}


@pytest.mark.parametrize("what", ["velocity", "effort"])
def test_what_is_nan_for_every_joint_of_the_arm_is_not_measured_as_ros2_control_says_it(panda, what):
    names, nan = [*panda.joint_names, "finger"], [np.nan] * 7 + [0.0]
    whole = {"position": np.zeros(8), "velocity": np.zeros(8), "effort": np.ones(8)}
    states = JointStates(panda, "/joint_states")
    early = states.sample(joint_state(names, *[nan] * 3, SECOND), 0)  # a driver that is not ready yet
    assert np.isnan(early[1:]).all()
    with pytest.raises(SourceError, match=f"no {what} for its 8 joints .all are NaN.: expected one per joint"):
        states.sample(joint_state(names, *(whole | {what: nan}).values(), 2 * SECOND), 0)
    states = JointStates(panda, "/joint_states", needs_velocities=False)
    if what == "velocity":
        states.sample(joint_state(names, *(whole | {what: nan}).values(), SECOND), 0)
        assert not states.has_velocities
    states.sample(joint_state(names, *whole.values(), SECOND), 0)


def test_velocities_may_lack_where_nobody_needs_them_but_not_in_part(panda):
    q, names = np.zeros(7), panda.joint_names
    states = JointStates(panda, "/joint_states", needs_velocities=False)
    sample = states.sample(joint_state(names, q, [], q, SECOND), 0)
    assert not states.has_velocities
    assert np.isnan(sample.dq).all()
    with pytest.raises(SourceError, match="3 values of velocity for its 7 joints"):
        JointStates(panda, "/t", needs_velocities=False).sample(joint_state(names, q, q[:3], q, SECOND), 0)


def test_time_is_the_stamps_to_the_nanosecond_and_else_the_time_of_receipt(panda):
    def times(stamps, received):
        states, rows = JointStates(panda, "/t"), [np.zeros(7)] * 3
        pairs = zip(stamps, received, strict=True)
        return states, [states.sample(joint_state(panda.joint_names, *rows, s), r).t for s, r in pairs]

    since_1970 = 1_790_000_000_123_456_789
    states, t = times([since_1970, since_1970 + 1_000_001], [0, 5 * SECOND])
    assert t == [0.0, 0.001000001]
    assert [states.stamp(x) for x in t] == [since_1970, since_1970 + 1_000_001]

    states, t = times([0, 0, 0], [since_1970, since_1970 + 10, since_1970 + SECOND])
    assert t == [0.0, 1e-8, 1.0]
    assert states.stamp(1.0) == since_1970 + SECOND

    # a simulation whose clock starts with the second message; one message without a stamp is a bad sample
    _, t = times([0, SECOND, 3 * SECOND // 2, 0], [0, 100, 200, 300])
    assert t[:3] == [0.0, 1e-7, 0.5000001]
    assert np.isnan(t[3])


# ------------------------------------------------------------------ the payload's message


def test_the_message_holds_com_in_the_frame_and_inertia_about_the_com():
    body = InertialParameters(example_payload().parameters.phi, "panda_link8")
    message = message_of(body, 12 * SECOND + 34, inertia_stamped)
    inertia = message.inertia
    expected = pin.Inertia.FromDynamicParameters(to_order(body, "pinocchio"))
    six = [inertia.ixx, inertia.ixy, inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz]
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == ("panda_link8", 12, 34)
    assert inertia.m == pytest.approx(expected.mass, rel=1e-12)
    assert np.allclose([inertia.com.x, inertia.com.y, inertia.com.z], expected.lever, rtol=0, atol=1e-12)
    assert np.allclose(six, expected.inertia[np.triu_indices(3)], rtol=0, atol=1e-12)
    back = parameters_of(message)
    assert back.frame == body.frame
    assert np.allclose(back.phi, body.phi, rtol=0, atol=1e-12)


def test_nothing_is_a_message_of_zeros():
    inertia = message_of(InertialParameters.zero("tool0"), 0, inertia_stamped).inertia
    assert [inertia.m, inertia.com.x, inertia.com.y, inertia.com.z, inertia.ixx, inertia.iyy, inertia.izz] == [0.0] * 7


def estimate(phi, std):
    return Estimate(1.0, np.asarray(phi, dtype=float), np.diag(np.square(std)), 100, "panda_link8")


SPREAD = np.array([0.02, *[0.002] * 3, *[0.002] * 6])
BODY = example_payload().parameters.phi
PANDA = arm("panda")


def test_only_a_body_that_can_exist_is_announced():
    assert np.array_equal(announced(estimate(BODY, SPREAD), PANDA).phi, BODY)
    impossible = BODY - np.array([0, 0, 0, 0, 0.012, 0, 0, 0, 0, 0])  # Ixx below 0
    body = announced(estimate(impossible, SPREAD), PANDA)
    assert is_consistent(body.phi)
    assert not is_consistent(impossible)
    assert body.mass == pytest.approx(BODY[0], abs=0.1)
    assert body.frame == "panda_link8"


@pytest.mark.parametrize(
    ("phi", "std"),
    [
        (BODY, [1.0, *SPREAD[1:]]),
        (BODY, [np.inf] * 10),
        (BODY, [*SPREAD[:9], np.inf]),
        ([np.nan] * 10, SPREAD),
        (-BODY, SPREAD),
    ],
    ids=["mass unknown", "nothing known", "no inertia", "not a number", "taken off"],
)
def test_what_is_not_known_is_not_announced(phi, std):
    assert announced(estimate(phi, std), PANDA) is None


def live(p_change=0.0, p_contact=0.0, settling=False):
    said = OnlineIdentifier(arm("panda"), method="map").update(0.0, [0.0] * 7, [0.0] * 7, [0.0] * 7)
    of = {**vars(said), **vars(estimate(BODY, SPREAD))}
    return OnlineEstimate.of({**of, "p_change": p_change, "p_contact": p_contact, "settling": settling})


def test_a_live_answer_is_announced_while_nothing_passes_by():
    assert np.array_equal(announced(live(), PANDA).phi, BODY)
    for passing in ({"p_change": 0.6}, {"p_contact": 0.6}, {"settling": True}):
        assert announced(live(**passing), PANDA) is None


def test_an_empty_hand_is_announced_as_nothing():
    body = announced(estimate(0.02 * BODY, SPREAD), PANDA)
    assert body.mass == 0.0
    assert not body.phi.any()


@pytest.mark.parametrize("rated", [0.3, 3.0, 150.0], ids=["hobby", "cobot", "industrial"])
def test_how_well_a_mass_is_to_be_known_to_be_announced_grows_with_what_the_arm_is_rated_for(rated):
    """Else an empty arm of 150 kg is never announced as empty, and a tenth of a kilogram of a toy's always is."""
    robot, light = replace(PANDA, rated_payload=rated), 0.02 * BODY[0] * rated / 3.0
    for std, known in ((0.0499, True), (0.0501, False)):
        body = announced(estimate([light, *[0.0] * 9], [std * rated, *SPREAD[1:]]), robot)
        assert (body is not None and body.mass == 0.0) == known
    heavy = 6.0 * rated / 3.0 * BODY / BODY[0]
    assert announced(estimate(heavy, [0.09 * heavy[0], *SPREAD[1:]]), robot) is not None


# ------------------------------------------------------------------ trajectories


def at_rest(q):
    return q, np.zeros_like(q), np.zeros_like(q)


def sampled(motion, order, rate=50.0, lead=0.0):
    t = np.linspace(0.0, motion.duration, round(motion.duration * rate) + 1)
    return [(when + lead, *(x[order] for x in rows)) for when, *rows in zip(t, *motion(t), strict=True)]


def test_a_trajectory_between_its_points_is_the_motion_it_was_sampled_from(panda):
    motion, order = taie2024(), [3, 1, 6, 0, 2, 5, 4]
    names = [panda.joint_names[k] for k in order]
    read = read_trajectory(trajectory(names, sampled(motion, order)), panda, at_rest(motion.position([0.0])[0]))
    t = np.linspace(0.0, 6.0, 997)
    for found, expected, close in zip(read(t), motion(t), (1e-6, 1e-4, 1e-2), strict=True):
        assert np.abs(found - expected).max() < close


@pytest.mark.parametrize("known", [1, 2, 3], ids=["positions", "velocities", "accelerations"])
def test_a_trajectory_leaves_as_the_arm_moves_and_ends_at_rest(panda, known):
    begin = taie2024()([0.7])
    goal = begin[0][0] + 0.2
    point = (2.0, *([goal, 0 * goal, 0 * goal][:known]), *([[]] * (3 - known)))
    motion = read_trajectory(trajectory(panda.joint_names, [point]), panda, tuple(x[0] for x in begin))
    q, dq, _ = motion([0.0, 2.0])
    assert np.allclose(q, [begin[0][0], goal], atol=1e-12)
    assert np.allclose(dq, [begin[1][0], 0 * goal], atol=1e-9)


def test_a_trajectory_the_arm_cannot_run_is_refused(panda):
    start = taie2024().position([0.0])[0]
    names, none = panda.joint_names, []

    def refusal(names, *points):
        with pytest.raises(MotionError) as caught:
            read_trajectory(trajectory(names, points), panda, at_rest(start))
        return str(caught.value)

    assert "expected panda_joint1" in refusal(["elbow"], (1.0, [0.0], none, none))
    assert "expected panda_joint1" in refusal(names[:6], (1.0, start[:6], none, none))
    assert "no points" in refusal(names)
    assert "without positions" in refusal(names, (1.0, none, none, none))
    assert "has 3 velocities for 7" in refusal(names, (1.0, start, [0.0] * 3, none))
    assert "do not rise" in refusal(names, (1.0, start, none, none), (0.5, start, none, none))
    assert "begins at once, 0.500 rad" in refusal(names, (0.0, start + 0.5, none, none), (1.0, start, none, none))
    assert "past its position limit" in refusal(names, (9.0, start + 3.0, none, none))
    assert "past its velocity limit" in refusal(names, (0.05, start + 0.5, none, none))
    assert "end at rest" in refusal(names, (1.0, start, np.ones(7), none))


def test_times_of_a_trajectory_count_from_its_stamp_and_what_is_over_is_left_out(panda):
    motion, start = taie2024(), 1_700_000_000 * SECOND
    message = trajectory(panda.joint_names, sampled(motion, list(range(7)), lead=0.0))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(start, SECOND)
    late = 1.234
    now = tuple(x[0] for x in motion([late]))
    read = read_trajectory(message, panda, now, start + round(late * SECOND))
    assert read.duration == pytest.approx(motion.duration - late)
    t = np.linspace(0.0, read.duration, 301)
    assert np.abs(read.position(t) - motion.position(late + t)).max() < 1e-5
    with pytest.raises(MotionError, match=r"was over 1\.000 s before it could begin"):
        read_trajectory(message, panda, now, start + 7 * SECOND)
    message.header.stamp.sec = message.header.stamp.nanosec = 0  # without one it begins at once
    assert read_trajectory(message, panda, at_rest(motion.position([0.0])[0]), start).duration == motion.duration


def test_an_order_replaces_the_motion_without_a_jump_and_keeps_what_was_asked_for(panda):
    motion = taie2024()
    commanded = CommandedMotion(motion)
    before = commanded.position(np.linspace(0.0, 1.3, 14))
    goal = commanded.state[0] - 0.1
    new = read_trajectory(trajectory(panda.joint_names, [(1.0, goal, 0 * goal, [])]), panda, commanded.state)
    assert commanded.order(new) == 1.3
    assert np.allclose(commanded.position(np.linspace(0.0, 1.3, 14)), before, rtol=0, atol=1e-12)
    q, dq, _ = commanded([1.3, 1.3 + 1e-6])
    assert np.abs(np.diff(q, axis=0)).max() < 1e-5
    assert np.abs(np.diff(dq, axis=0)).max() < 1e-4
    assert np.allclose(commanded.position([2.3, 99.0]), goal)
    # two orders before anybody asked: only the second one counts
    commanded = CommandedMotion(motion)
    still = [TrajectoryMotion([0.0, 1.0], np.full((2, 7), x)) for x in (0.1, 0.2)]
    for order in still:
        commanded.order(order)
    assert np.allclose(commanded.position([0.0, 5.0]), 0.2)


def test_orders_that_follow_each_other_fast_change_nothing_of_what_was_asked_for(panda):
    commanded = CommandedMotion(taie2024())
    t = np.linspace(0.0, 1.3, 14)
    asked = commanded.velocity(t)
    for k in range(1, 4):
        goal = commanded.state[0] - 0.1
        message = trajectory(panda.joint_names, [(1.0, goal, 0 * goal, [])])
        commanded.order(read_trajectory(message, panda, commanded.state))
        t = np.append(t, 1.3 + 0.01 * k)
        asked = np.vstack([asked, commanded.velocity(t[-1:])])
        assert np.allclose(commanded.velocity(t), asked, rtol=0, atol=1e-12)


# ------------------------------------------------------------------ without ROS, and with it


def test_without_ros_one_sentence_says_how_to_get_it(panda, capsys):
    if importlib.util.find_spec("rclpy"):
        pytest.skip("this Python has rclpy")
    with pytest.raises(SourceError, match="install ROS 2"):
        Ros2Source("/joint_states", panda)
    from armload.app.cli import main

    for words in (["node", "--robot", "panda"], ["simulate", "--robot", "panda"]):
        assert main(["ros2", *words]) == 2
        assert "install ROS 2" in capsys.readouterr().err


def write_log(path, log, names):
    np.savez(path, t=log.t, q=log.q, dq=log.dq, tau=log.tau, names=np.array(names))
    return path


ARMLOAD = ("-m", "armload", "ros2")
PUBLISHES = ROOT / "tests" / "devices" / "ros" / "publish_recording.py"


@pytest.mark.full
@pytest.mark.parametrize("effort", ["torque", "without gravity", "currents", "torque, no velocities"])
def test_joint_states_in_and_inertia_out_between_processes(ros, wait_until, panda, tmp_path, effort):
    """A driver's messages in, read back by plain rclpy: numbers as Pinocchio has them, the frame and the stamp."""
    truth = example_payload().parameters
    log = sent = simulate(panda, taie2024(), truth, rate=200.0)
    topic = "/arm/states"
    if effort == "without gravity":
        sent, topic = replace(log, tau=log.tau - panda.torque(log.q)), f"{topic}?compensated=nothing"
    elif effort == "currents":
        sent, topic = replace(log, tau=log.tau / 8.0), f"{topic}?torque_constants=8,8,8,8,8,8,8"
    file = write_log(tmp_path / "log.npz", sent, panda.joint_names)
    start = 1_700_000_000_000_000_001
    node = (*ARMLOAD, "node", "--robot", "panda", "--topic", topic, "--publish", "/arm/load", "--method", "ols")
    with (
        ros(ROOT / "tests" / "devices" / "ros" / "listen.py", "inertia", "/arm/load") as listener,
        ros(*node) as identifier,
        ros(PUBLISHES, file, "/arm/states", start, *["velocity"] * ("no velocities" in effort)) as driver,
    ):
        wait_until(lambda: driver.poll() is not None, 60, driver, identifier)
        wait_until(listener.printed_lines, 5, identifier, listener)
        time.sleep(0.5)
        messages = [json.loads(line) for line in listener.printed_lines()]
        assert identifier.poll() is None, identifier.noted()
    assert identifier.returncode == 130  # interrupted, not broken
    assert ("/arm/states has no velocities" in identifier.noted()) == ("no velocities" in effort)
    assert {message["frame"] for message in messages} == {"panda_link8"}
    stamps = {start + round(t * 1e9) for t in log.t.tolist()}
    assert {message["stamp"] for message in messages} <= stamps
    assert 20 <= len(messages) <= 61  # ten in a second, once they mean something
    last = messages[-1]
    assert last["stamp"] > start + 5.5e9
    expected = pin.Inertia.FromDynamicParameters(to_order(truth, "pinocchio"))
    assert last["m"] == pytest.approx(expected.mass, rel=0.01)
    assert np.allclose(last["com"], expected.lever, rtol=0, atol=1e-3)
    six = expected.inertia[np.triu_indices(3)]
    assert np.allclose(last["inertia"], six, rtol=0, atol=0.05 * six.max())
    about_the_origin = truth.inertia[np.triu_indices(3)]
    assert np.abs(np.array(last["inertia"]) - about_the_origin).max() > 0.2 * six.max()


@pytest.mark.full
def test_the_default_method_identifies_the_simulated_robots_payload(ros, wait_until):
    truth = example_payload().parameters
    robot = (*ARMLOAD, "simulate", "--robot", "panda", "--payload", "test", "--motion", "taie2024", "--rate", "200")
    with (
        ros(ROOT / "tests" / "devices" / "ros" / "listen.py", "inertia", "/payload/inertia") as listener,
        ros(*ARMLOAD, "node", "--robot", "panda") as identifier,
        ros(*robot) as simulator,
    ):
        wait_until(lambda: len(listener.printed_lines()) > 100, 90, simulator, identifier, listener)
        last = json.loads(listener.printed_lines()[-1])
    assert last["frame"] == "panda_link8"
    assert last["m"] == pytest.approx(truth.mass, rel=0.04)
    assert np.allclose(last["com"], truth.com, rtol=0, atol=5e-3)
    assert (simulator.returncode, identifier.returncode) == (130, 130)


@pytest.mark.full
def test_the_simulated_robot_follows_a_trajectory_and_carries_its_payload(ros, wait_until, panda, tmp_path):
    truth = example_payload().parameters
    start = 0.5 * (panda.limits.position_low + panda.limits.position_high)
    goal = start + np.array([0.5, -0.3, 0.4, -0.4, 0.3, 0.4, -0.5])
    order = [6, 5, 4, 3, 2, 1, 0]
    names = [panda.joint_names[k] for k in order]

    def point(t, q):
        return {"t": t, "q": q[order].tolist(), "dq": [0.0] * 7, "ddq": [0.0] * 7}

    file, impossible = tmp_path / "trajectory.json", tmp_path / "impossible.json"
    file.write_text(json.dumps({"names": names, "points": [point(2.0, goal)]}))
    impossible.write_text(json.dumps({"names": names, "points": [point(2.0, goal + 9.0)]}))
    command = "/joint_trajectory_controller/joint_trajectory"
    send = ROOT / "tests" / "devices" / "ros" / "send_trajectory.py"
    with (
        ros(ROOT / "tests" / "devices" / "ros" / "listen.py", "states", "/joint_states") as listener,
        ros(*ARMLOAD, "simulate", "--robot", "panda", "--payload", "test", "--no-noise") as robot,
    ):
        wait_until(lambda: len(listener.printed_lines()) > 50, 60, robot, listener)
        for wanted in (impossible, file):
            with ros(send, command, wanted) as sender:
                wait_until(lambda sender=sender: sender.poll() is not None, 30, sender, robot)
        wait_until(lambda: "was accepted" in robot.noted(), 10, robot)
        before = len(listener.printed_lines())
        wait_until(lambda: len(listener.printed_lines()) > before + 700, 30, robot, listener)
    assert "was refused" in robot.noted()
    seen = [json.loads(line) for line in listener.printed_lines()[1:-1]]
    assert {tuple(message["names"]) for message in seen} == {panda.joint_names}
    t = np.array([message["stamp"] for message in seen])
    assert np.median(np.diff(t)) == pytest.approx(5e6, abs=1e3)  # 200 Hz
    q, dq, tau = (np.array([message[key] for message in seen]) for key in ("q", "dq", "tau"))

    # at both ends the arm stands, a few milliradians below where it is commanded to be, and bears arm and payload
    sag = 0.01
    for k, pose in ((0, start), (-1, goal)):
        assert np.abs(q[k] - pose).max() < sag
        assert np.abs(dq[k]).max() < 1e-4
        assert np.allclose(tau[k], panda.with_payload(truth).torque(q[k]), rtol=0, atol=0.01)
    # between them it follows the quintic: one delay fits all joints and samples
    moving = (np.abs(dq).max(axis=1) > 1e-3).nonzero()[0]
    x = (t * 1e-9)[:, None] - t[moving[0]] * 1e-9

    def wanted(delay):
        s = np.clip((x - delay) / 2.0, 0.0, 1.0)
        return start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)

    assert min(np.abs(q - wanted(delay)).max() for delay in np.arange(-0.2, 0.2, 0.01)) < 0.02


@pytest.mark.full
def test_a_topic_that_cannot_serve_ends_in_one_sentence(ros, wait_until, panda, tmp_path):
    log = simulate(panda, taie2024(), rate=50.0)
    file = write_log(tmp_path / "log.npz", log, panda.joint_names)
    cases = {
        "/silent": "no joint states on /silent for 3 s",
        "/fingers": "had only the joints finger_left, finger_right for 3 s, without panda_joint1",
        "/weak": "/weak has no effort for its 9 joints",
        "not a topic": "cannot be a ROS 2 topic here",
    }
    with ros(PUBLISHES, file, "/fingers", SECOND, "arm"), ros(PUBLISHES, file, "/weak", SECOND, "effort"):
        for topic, sentence in cases.items():
            with ros(*ARMLOAD, "node", "--robot", "panda", "--topic", topic, "--timeout", "3") as node:
                wait_until(lambda node=node: node.poll() is not None, 30, node)
            assert node.returncode == 2, node.noted()
            assert sentence in node.noted().splitlines()[-1]
