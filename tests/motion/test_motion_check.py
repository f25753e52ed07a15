"""Capsules against brute force, poses against Pinocchio, and checks against motions made to break one thing."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload.arms import Arm, arm
from armload.devices.ros2.trajectory import TrajectoryMotion
from armload.errors import MotionError
from armload.inertia import InertialParameters
from armload.motion import FourierMotion, PathMotion, check_motion, random_motion, rated_load, taie2024
from armload.motion.collision import capsule_arm


def segment_distance(a, b, c, d, steps=2001):
    """Smallest distance of the segments ab and cd: |p − q|² is convex in q, so that each p has its q in closed form."""
    p, u = a + np.outer(np.linspace(0, 1, steps), b - a), d - c
    along = np.clip((p - c) @ u / max(u @ u, 1e-300), 0.0, 1.0)
    return np.linalg.norm(p - c - np.outer(along, u), axis=1).min()


def axes(capsules, q):
    """Both ends of the capsules' axes in the base, as Pinocchio places the links."""
    model = pin.buildModelFromXML(capsules.arm.urdf)
    data = model.createData()
    pin.forwardKinematics(model, data, np.asarray(q, dtype=float))
    placed = [data.oMi[int(link)] for link in capsules.link]
    return tuple(
        np.array([place.act(end) for place, end in zip(placed, ends, strict=True)])
        for ends in (capsules.start, capsules.end)
    )


@pytest.mark.parametrize("floor", [0.0, -0.3])
def test_clearances_are_those_of_segments_on_the_links_less_their_radii(every_arm, floor):
    capsules = capsule_arm(every_arm)
    poses = np.random.default_rng(0).uniform(-2.5, 2.5, size=(20, every_arm.n))
    clear = capsules.clearance(poses, floor)
    for k, q in enumerate(poses):
        start, end = axes(capsules, q)
        apart = [
            segment_distance(start[i], end[i], start[j], end[j]) - capsules.radius[i] - capsules.radius[j]
            for i, j in capsules.pairs
        ]
        assert clear.self[k] == pytest.approx(min(apart), abs=1e-6)  # a sampled distance is too long by 1e-6 at most
        assert apart[clear.self_pair[k]] == pytest.approx(min(apart), abs=1e-6)
        height = np.minimum(start[:, 2], end[:, 2]) - capsules.radius - floor
        assert set(capsules.above) <= set(np.flatnonzero(capsules.link >= 2))
        height[np.setdiff1d(np.arange(len(height)), capsules.above)] = np.inf
        assert clear.floor[k] == pytest.approx(height.min(), abs=1e-10)
        assert height[clear.floor_part[k]] == pytest.approx(height.min(), abs=1e-10)
    assert (clear.self < 0).any()  # penetration is among them


def test_automatic_capsules_run_from_joint_to_joint_and_end_at_the_flange():
    ur = arm("ur10e")
    capsules = capsule_arm(ur, payload_radius=0.0)
    for q in np.random.default_rng(1).uniform(-2, 2, size=(4, 6)):
        start, end = axes(capsules, q)
        np.testing.assert_allclose(end[:-1], start[1:], atol=1e-12)
        np.testing.assert_allclose(end[-1], ur.frame_pose(q)[1][0], atol=1e-12)


@pytest.mark.parametrize("name", ["ur5", "ur3e", "gen3"])
def test_what_is_tested_against_each_other_can_be_apart(name):
    capsules = capsule_arm(arm(name))
    poses = np.random.default_rng(5).uniform(-np.pi, np.pi, size=(100, capsules.arm.n))
    ends = [axes(capsules, q) for q in poses]
    for i, j in capsules.pairs:
        apart = max(segment_distance(start[i], end[i], start[j], end[j]) for start, end in ends)
        assert apart - capsules.radius[i] - capsules.radius[j] > 0.015


def test_a_ur5_is_not_asked_to_keep_apart_what_it_cannot():
    capsules = capsule_arm(arm("ur5"))
    # its wrist is 0.205 m long to the ball's centre, the radii of forearm and ball are 0.194 m
    tested = {(capsules.names[i], capsules.names[j]) for i, j in capsules.pairs}
    assert ("the link of elbow_joint", "the payload") not in tested
    assert 2 not in capsules.link[capsules.above]  # its shoulder is 0.09 m above the floor
    assert 2 in capsule_arm(arm("ur5e")).above


def test_the_payload_ball_sits_a_tenth_of_a_metre_beyond_the_flange(every_arm):
    q = np.random.default_rng(2).uniform(-1, 1, size=every_arm.n)
    R, p = every_arm.frame_pose(q)
    start, end = axes(capsule_arm(every_arm, payload_radius=0.12), q)
    np.testing.assert_allclose(start[-1], p[0] + 0.1 * R[0, :, 2], atol=1e-12)
    np.testing.assert_array_equal(start[-1], end[-1])


def test_of_equal_clearances_the_first_instant_is_named():
    ur = arm("ur5e")  # its shoulder stays where it is
    assert "at t = 0.00 s" in check_motion(ur, random_motion(ur, 4)).floor_nearest


def test_a_panda_is_recognised_by_its_joints_under_any_name(tmp_path, panda):
    path = tmp_path / "lab_robot.urdf"
    path.write_text(panda.urdf)
    other = arm(path, frame="panda_link8")
    assert other.name == "lab_robot"
    np.testing.assert_array_equal(capsule_arm(other).radius, capsule_arm(panda).radius)


def test_poses_that_touch_are_told_from_poses_that_do_not(panda):
    ready, folded, low = [0, -0.5, 0, -2.0, 0, 1.6, 0.8], [0, -0.5, 0, -3.0, 0, 0.2, 0], [0, 1.7, 0, -0.3, 0, 1.6, 0]
    clear = capsule_arm(panda).clearance([ready, folded, low])
    assert clear.self[0] > 0.03
    assert clear.floor[0] > 0.1
    assert clear.self[1] < 0  # the flange, and the payload with it, against the forearm
    assert clear.floor[2] < 0
    assert np.isinf(capsule_arm(panda).clearance([low], floor=None).floor[0])
    higher = capsule_arm(panda).clearance([low], floor=-1.0)
    assert higher.floor[0] == pytest.approx(clear.floor[2] + 1.0)


def one_joint_moves(joint, amplitude, period=6.0, ready=(0, -0.5, 0, -2.0, 0, 1.6, 0.8)):
    """q_joint moves by amplitude·(sin x − sin(2x)/2): smooth at both ends."""
    sine = np.zeros((7, 2))
    sine[joint] = amplitude, -amplitude / 2
    return FourierMotion(ready, sine, np.zeros((7, 2)), period, "one joint")


def test_margins_are_the_closed_form_of_a_motion_of_one_joint(panda):
    amplitude, omega = 0.4, 2 * np.pi / 6
    check = check_motion(panda, one_joint_moves(0, amplitude), rate=2000)
    # sin x − sin(2x)/2: peak 3·sqrt(3)/4 at 2·pi/3; its derivative cos x − cos 2x has its peak −2 at pi
    assert check.ok
    assert check.margin["position"][0] == pytest.approx(2.8973 - amplitude * 0.75 * np.sqrt(3), abs=1e-6)
    assert check.margin["velocity"][0] == pytest.approx(2.175 - 2 * amplitude * omega, abs=1e-6)
    assert check.used("velocity")[0] == pytest.approx(2 * amplitude * omega / 2.175, abs=1e-6)
    # the acceleration −sin x + 2·sin 2x has its extremes where its derivative −cos x + 4·cos 2x vanishes
    x = np.arccos((1 + np.array([1, -1]) * np.sqrt(129)) / 16)
    extreme = np.abs(2 * np.sin(2 * x) - np.sin(x)).max()
    assert check.peak["acceleration"][0] == pytest.approx(amplitude * omega**2 * extreme, abs=1e-5)
    # the jerk −cos x + 4·cos 2x is largest in size at pi: 5
    assert check.peak["jerk"][0] == pytest.approx(5 * amplitude * omega**3, abs=1e-6)
    np.testing.assert_array_equal(check.peak["velocity"][1:], 0.0)


@pytest.mark.parametrize(
    ("joint", "amplitude", "period", "says"),
    [
        (5, 2.0, 60.0, "panda_joint6 passes its position limit"),
        (6, 1.0, 3.0, "panda_joint7 passes its velocity limit"),
        (1, 0.4, 1.4, "panda_joint2 passes its acceleration limit"),
        (0, 0.1, 0.12, "panda_joint1 passes its jerk limit"),
        (1, 0.4, 1.4, "panda_joint2 passes its torque limit"),
    ],
)
def test_each_passed_limit_is_named_with_joint_and_time(panda, joint, amplitude, period, says):
    load = InertialParameters.from_com(30.0, (0, 0, 0.1), 0.03 * np.eye(3)) if "torque" in says else None
    check = check_motion(panda, one_joint_moves(joint, amplitude, period), load)
    assert not check.ok
    (sentence,) = [p for p in check.problems if p.startswith(says)]
    assert " at t = " in sentence
    assert sentence in str(check)


@pytest.mark.parametrize("kind", [PathMotion, TrajectoryMotion])
@pytest.mark.parametrize("rate", [1000.0, 37.0])
def test_what_a_table_does_between_its_points_counts(panda, kind, rate):
    """A quintic from rest to rest over d in h goes at 15/8·d/h half way, whatever stands in its points."""
    t = np.linspace(0.0, 1.0, round(rate) + 1)
    q = np.tile(np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8]), (len(t), 1))
    q[:, 0] += 1.5 * t
    stopped = kind(t, q, np.zeros_like(q), np.zeros_like(q))
    result = check_motion(panda, stopped)
    assert result.peak["velocity"][0] == pytest.approx(15 / 8 * 1.5)
    assert any("panda_joint1 passes its velocity limit" in problem for problem in result.problems)


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_one_damaged_point_of_a_table_is_found_at_any_rate(panda, rate):
    table = PathMotion.of(taie2024(), 1000.0)
    q = table.positions.copy()
    q[498, 0] += 0.3
    damaged = PathMotion(table.times, q, table.velocities, table.accelerations)
    assert check_motion(panda, table, rate=rate).ok
    assert any("panda_joint1 passes" in problem for problem in check_motion(panda, damaged, rate=rate).problems)


def test_the_torque_margin_is_that_of_the_arm_with_its_payload(panda):
    load = InertialParameters.from_com(2.0, (0.02, 0, 0.05), 0.01 * np.eye(3))
    t = np.linspace(0, 6, 1201)
    peak = np.abs(panda.with_payload(load).torque(*taie2024()(t))).max(axis=0)
    check = check_motion(panda, taie2024(), load)
    np.testing.assert_allclose(check.margin["torque"], panda.limits.effort - peak, atol=1e-12)
    assert check.margin["torque"][3] < check_motion(panda, taie2024()).margin["torque"][3]


def test_a_motion_that_does_not_start_at_rest_is_a_problem(panda):
    ready = (0, -0.5, 0, -2.0, 0, 1.6, 0.8)
    jump = FourierMotion(ready, np.full((7, 2), 0.02), np.zeros((7, 2)), 6.0)
    assert any("velocity" in p and "at rest" in p for p in check_motion(panda, jump).problems)
    shove = FourierMotion(ready, np.zeros((7, 2)), np.full((7, 2), 0.02), 6.0)
    assert any("acceleration" in p and "at rest" in p for p in check_motion(panda, shove).problems)
    assert check_motion(panda, jump.smooth()).ok


def test_hitting_the_floor_or_itself_is_a_problem_with_place_and_time(panda):
    low = one_joint_moves(1, 0.3, ready=(0, 1.3, 0, -0.5, 0, 1.6, 0.8))
    (sentence,) = check_motion(panda, low).problems
    assert sentence.startswith("the arm hits the floor: the payload at t = ")
    assert check_motion(panda, low, floor=None).ok
    folded = one_joint_moves(5, 0.6, ready=(0, -0.5, 0, -2.0, 0, 0.9, 0.8))
    assert any(p.startswith("the arm hits itself: the link of panda_joint5 and the payload") for p in
               check_motion(panda, folded).problems)  # fmt: skip
    assert check_motion(panda, folded, payload_radius=0.0).ok


def test_a_motion_of_another_arm_is_refused():
    with pytest.raises(MotionError, match="7 joints: ur10e has 6"):
        check_motion(arm("ur10e"), taie2024())


def test_the_table_has_the_share_of_each_limit_but_of_a_position_which_has_two(panda):
    check = check_motion(panda, taie2024())
    rows = {line.split()[0]: line for line in str(check).splitlines() if line.startswith("panda_joint")}
    for k, joint in enumerate(panda.joint_names):
        found = re.findall(r"(-?[\d.]+)(?: \((\d+) %\))?", rows[joint].removeprefix(joint))
        names = ("position", "velocity", "acceleration", "jerk", "torque")
        for name, (margin, share) in zip(names, found, strict=True):
            assert float(margin) == pytest.approx(check.margin[name][k], abs=0.005)
            assert share == ("" if name == "position" else f"{100 * check.used(name)[k]:.0f}")


def test_an_arm_without_acceleration_limits_shows_none():
    ur = arm("ur10e")
    check = check_motion(ur, random_motion(ur, 3))
    assert np.all(np.isinf(check.margin["acceleration"]))
    assert np.all(check.used("acceleration") == 0)
    assert "no limit" in str(check)


@pytest.mark.parametrize("seed", [0, 3])
def test_random_motions_pass_the_check_and_move_every_joint(every_arm, seed):
    motion = random_motion(every_arm, seed)
    check = check_motion(every_arm, motion, rated_load(every_arm), rate=500, collision_rate=200)
    assert check.problems == []
    q, dq, _ = motion(np.linspace(0, motion.duration, 300))
    assert np.all(np.ptp(q, axis=0) > 0.15)
    assert np.all(np.abs(dq).max(axis=0) > 0.1)
    assert (motion.duration, motion.harmonics) == (6.0, 5)


def test_random_motions_depend_on_the_seed_and_on_nothing_else(panda):
    first, again, other = random_motion(panda, 5), random_motion(arm("panda"), 5), random_motion(panda, 6)
    np.testing.assert_array_equal(first.sine, again.sine)
    np.testing.assert_array_equal(first.offset, again.offset)
    assert np.abs(first.offset - other.offset).max() > 0.1


def test_random_motions_have_the_duration_and_harmonics_asked_for(panda):
    motion = random_motion(panda, 1, duration=4.0, harmonics=3)
    assert (motion.duration, motion.harmonics) == (4.0, 3)
    with pytest.raises(MotionError, match="at least 2"):
        random_motion(panda, 1, harmonics=1)
    with pytest.raises(MotionError, match="positive"):
        random_motion(panda, 1, duration=0.0)


def test_a_urdf_without_effort_or_velocity_limits_gets_a_random_motion(tmp_path):
    path = tmp_path / "scara.urdf"
    joint = """<joint name="j{0}" type="{1}"><parent link="l{2}"/><child link="l{0}"/><origin xyz="{3}"/>
      <axis xyz="0 0 1"/></joint><link name="l{0}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"
      ixy="0" ixz="0" iyz="0"/></inertial></link>"""
    chain = (1, "continuous", 0, "0 0 0.4"), (2, "continuous", 1, "0.4 0 0.1"), (3, "fixed", 2, "0.3 0 0")
    path.write_text('<robot name="scara"><link name="l0"/>' + "".join(joint.format(*row) for row in chain) + "</robot>")
    scara = arm(path)
    motion = random_motion(scara, 0)
    check = check_motion(scara, motion)
    assert check.ok
    assert np.all(check.peak["velocity"] <= 1.5)
    assert np.all(np.isinf(check.margin["torque"]))


def mounted(name, xyz, rpy):
    """A built-in arm that its file mounts somewhere in a cell."""
    known = arm(name)
    base = re.search(r'<link name="([^"]*)"', known.urdf)[1]
    place = (
        f'<link name="cell"/><joint name="place" type="fixed"><origin xyz="{xyz}" rpy="{rpy}"/><parent link="cell"/>'
        f'<child link="{base}"/></joint>'
    )
    return Arm(name, known.urdf.replace("</robot>", place + "</robot>"), known.frame)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
@pytest.mark.parametrize(("xyz", "rpy"), [("3 0 0", "0 0 1"), ("0 0 2.2", "3.14159265358979 0 0"), ("0 1 1", "0 1 0")])
def test_an_arm_is_as_large_wherever_its_file_mounts_it(name, xyz, rpy):
    there, known = capsule_arm(mounted(name, xyz, rpy)), capsule_arm(arm(name))
    np.testing.assert_allclose(there.radius, known.radius, atol=1e-12)
    poses = np.random.default_rng(0).uniform(-2.5, 2.5, size=(20, known.arm.n))
    np.testing.assert_allclose(there.clearance(poses).self, known.clearance(poses).self, atol=1e-9)


def test_a_panda_that_hangs_from_the_root_has_no_floor_at_the_root():
    hanging = check_motion(mounted("panda", "0 0 0", "3.14159265358979 0 0"), taie2024())
    assert hanging.floor_clearance == np.inf
    assert hanging.ok, hanging.problems


def test_a_motion_too_fast_for_where_it_is_is_refused_by_the_place():
    fr3 = arm("fr3")
    elsewhere = replace(fr3, velocity_ends=None)
    motion = random_motion(elsewhere, seed=11)
    assert check_motion(elsewhere, motion, rated_load(fr3)).ok
    found = check_motion(fr3, motion, rated_load(fr3))
    assert len(found.problems) == 1
    said = re.fullmatch(
        r"fr3_joint\d passes its velocity limit of ([\d.]+) rad/s at -?[\d.]+ rad, near the end of its range, "
        r"with ([\d.]+) rad/s at t = [\d.]+ s",
        found.problems[0],
    )
    assert float(said[1]) < float(said[2]) < 2.62
    assert check_motion(fr3, random_motion(fr3, seed=11), rated_load(fr3)).ok
