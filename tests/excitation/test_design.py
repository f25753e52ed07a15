"""Designed motions keep to what was asked; requests that cannot be met name the limit in the way."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import MotionError
from armload.excitation import (
    Accuracy,
    Constraints,
    Criterion,
    Obstacle,
    PayloadRange,
    Surroundings,
    design_motion,
    design_until,
    problems,
    used,
)
from armload.motion import check_motion, load_motion, random_motion, save_motion
from armload.posterior import bound

READY = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
QUICK = {"starts": 1, "stages": ((8, 100.0), (12, 2000.0))}


def test_a_larger_share_is_offered_only_where_one_is_left():
    """The xArm7 holds its rated payload here with 0.993 of a joint's torque, and no share is above 1."""
    start = np.array([0.0, -0.3, 0.0, 1.0, 0.0, 1.2, 0.0])
    with pytest.raises(MotionError, match=r"start elsewhere, or give the payload's mass \(2\.32 kg can be held\)"):
        Constraints(arm("xarm7"), start)
    with pytest.raises(MotionError, match=r"allow a larger share \(more than 0\.9"):
        Constraints(arm("xarm7"), start, payload=PayloadRange(3.2))


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def allowed(panda):
    return Constraints(panda, READY, share=0.7, payload=PayloadRange(1.5))


@pytest.fixture(scope="module")
def designed(panda, allowed):
    return design_motion(allowed, Criterion(panda, "same"), 1.5, **QUICK)


@pytest.mark.parametrize("first", [0, 6])
def test_no_design_of_random_requests_is_rejected_by_other_code(first, monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "benchmarks")
    from motion_requests import answered, drawn, objections

    designed = 0
    for seed in range(first, first + 6):
        request = drawn(seed, longest=0.8)
        motions, why = answered(request, starts=1, stages=((4, 100.0), (2, 2000.0)))
        assert bool(motions) != bool(why)
        designed += bool(motions)
        for motion in motions:
            assert objections(request, motion, seed) == []
    assert designed >= 1


def test_the_other_code_objects_to_a_motion_of_each_kind_that_passes_a_limit(allowed, designed, monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "benchmarks")
    from motion_requests import Request, objections

    request = Request(
        allowed.arm, READY, 0.7, allowed.payload, allowed.around, np.ones(7, bool), allowed.speed, "same", [1.5]
    )
    assert objections(request, designed.motion) == []
    wider = replace(designed.motion, control=1.3 * designed.motion.control)
    faster = replace(designed.motion, lasting=1.2)
    for motion in (wider, faster):
        text = " ".join(objections(request, motion))
        assert all(what in text for what in ("velocity", "acceleration", "torque"))
    place = allowed.arm.frame_pose(designed.motion(np.array([0.4]))[0])[1][0]
    near = replace(allowed, surroundings=Surroundings(allowed.arm, None, (), 0.0))
    boxed = Surroundings(allowed.arm, None, (Obstacle(tuple(place), (0.02, 0.02, 0.02)),), 0.0)
    assert any("boxes" in text for text in objections(request._replace(surroundings=boxed), designed.motion))
    assert problems(near, designed.motion) == []


@pytest.mark.parametrize("what", ["velocity", "acceleration", "torque", "tool speed"])
def test_the_check_finds_each_limit_that_is_passed(what, allowed, designed):
    assert problems(allowed, designed.motion) == []
    over = {one.what for one in used(allowed, replace(designed.motion, lasting=0.9)) if one.share > 1.0}
    assert what in over


def test_the_check_sees_boxes_positions_and_joints_that_leave(panda, allowed, designed):
    tight = replace(allowed, travel=0.05)
    assert any("goes to" in text for text in problems(tight, designed.motion))
    still = replace(allowed, joints=np.arange(7) >= 4)
    moved = design_motion(still, Criterion(panda, "same"), 0.6, **QUICK).motion
    np.testing.assert_array_equal(moved.control[:4], 0.0)
    assert np.abs(moved.control[4:]).max() > 0.02
    path = panda.frame_pose(designed.motion(np.linspace(0, 1.5, 100))[0])[1]
    farthest = path[np.linalg.norm(path - path[0], axis=1).argmax()]
    boxed = Surroundings(panda, None, (Obstacle(tuple(farthest), (0.01, 0.01, 0.01)),), 0.0)
    assert any("the boxes" in text for text in problems(replace(allowed, surroundings=boxed), designed.motion))


def test_a_motion_that_is_not_at_rest_or_elsewhere_fails_the_check(allowed, designed):
    elsewhere = replace(designed.motion, start=READY + 1e-3)
    assert any("at rest" in text for text in problems(allowed, elsewhere))


def test_the_same_seed_gives_the_same_motion_and_its_file_the_same_again(panda, allowed, designed, tmp_path):
    again = design_motion(allowed, Criterion(panda, "same"), 1.5, **QUICK)
    np.testing.assert_array_equal(again.motion.control, designed.motion.control)
    save_motion(tmp_path / "m.json", designed.motion)
    back = load_motion(tmp_path / "m.json")
    t = np.linspace(0.0, 1.5, 50)
    for order in range(4):
        np.testing.assert_array_equal(back.derivative(t, order), designed.motion.derivative(t, order))


def test_a_design_tells_more_than_random_motions_about_the_same_pose(panda, designed):
    found = bound(panda, designed.motion, tare=designed.motion, times=(1.5,))
    np.testing.assert_allclose(found.half_width[-1], designed.half_width, rtol=0.01)
    value = -np.linalg.slogdet(found.covariance[-1])[1]
    for seed in range(4):
        drawn = random_motion(panda, seed, duration=1.5, around=READY)
        other = bound(panda, drawn, tare=drawn, times=(1.5,))
        assert value > -np.linalg.slogdet(other.covariance[-1])[1] + 3.0


@pytest.mark.full  # a whole design takes some seconds
def test_a_clearance_a_millimetre_short_does_not_cost_most_of_the_motion():
    """Smaller motions of this one are not farther from what it nearly touches: drawn together it kept a fifth."""
    limits = Constraints(arm("ur5e"), np.array([0.0, -1.2, 1.5, -1.5, -1.57, 0.0]))
    motion = design_motion(limits, Criterion(limits.arm, "same"), 3.0).motion
    assert problems(limits, motion) == []
    accelerations = np.diff(motion.position(motion.instants(1000.0)), 2, axis=0) * 1e6
    assert np.abs(accelerations / limits.most["acceleration"]).max() > 0.8


def test_a_design_goes_slower_near_the_ends_of_the_joints_ranges_where_its_arm_must():
    fr3 = arm("fr3")
    start = np.array([0.0, -1.2, 0.0, -2.8, 0.0, 3.9, 2.3])
    limits = Constraints(fr3, start, share=1.0)
    motion = design_motion(limits, Criterion(fr3), 1.5, starts=2).motion
    assert problems(limits, motion) == []
    q, dq, _ = motion(motion.instants(1000.0))
    # of joint 4 towards its low end, by the formula of libfranka's rate_limiting.h
    allowed = np.minimum(2.62, np.sqrt(8.0 * (q[:, 3] + 3.0481)) - 0.3)
    assert np.all(-dq[:, 3] < allowed)
    careless = Constraints(replace(fr3, velocity_ends=None), start, share=1.0)
    passed = problems(limits, design_motion(careless, Criterion(careless.arm), 1.5, starts=2).motion)
    assert any("velocity" in one for one in passed)


def test_the_arms_own_check_agrees_with_a_design(panda, designed):
    assert check_motion(panda, designed.motion, PayloadRange(1.5).payload(1.0, np.zeros(3))).ok


def test_a_pair_tells_more_than_the_loaded_run_alone(panda, allowed):
    alone = design_motion(allowed, Criterion(panda, None), 0.8, **QUICK)
    pair = design_motion(allowed, Criterion(panda, "own"), 0.8, tare_time=1.0, **QUICK)
    assert pair.empty is not None
    assert pair.empty.duration == 1.0
    assert problems(allowed, pair.empty) == []
    assert np.all(pair.half_width < alone.half_width)


@pytest.mark.full
def test_until_reaches_the_accuracy_and_half_its_time_does_not(panda, allowed):
    wanted = Accuracy(mass=0.03, moment=0.006)
    found = design_until(allowed, Criterion(panda, "same"), wanted, **QUICK)
    assert wanted.over(found.promised) <= 1.0
    shorter = design_motion(allowed, Criterion(panda, "same"), 0.5 * found.motion.duration, **QUICK)
    assert wanted.over(shorter.promised) > 1.0


def test_an_accuracy_that_any_motion_reaches_is_reached_by_one_that_can_be_run():
    slow = arm("ur5e")
    keep = Constraints(slow, [0.1, -1.2, 1.4, -1.5, -1.5, 0.2], share=0.7, payload=PayloadRange(2.0))
    wanted = Accuracy(mass=5.0)
    found = design_until(keep, Criterion(slow), wanted, starts=1, stages=((2, 100.0),))
    assert problems(keep, found.motion) == []
    assert found.motion.duration < 2.0


def test_an_accuracy_out_of_reach_is_refused(panda, allowed):
    with pytest.raises(MotionError, match="out of reach"):
        design_until(
            replace(allowed, joints=np.arange(7) == 6, travel=0.1),
            Criterion(panda, None),
            Accuracy(mass=1e-5),
            starts=1,
            stages=((1, 100.0),),
        )


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"start": READY - 0.9 * np.eye(7)[3]}, "panda_joint4 starts at -2.9 rad, outside 0.7 of its range"),
        ({"payload": PayloadRange(9.0)}, "to hold the worst payload of the range .* can be held"),
        ({"start": READY[:6]}, "expected|has 7 joints"),
        ({"share": 1.2}, "share is 1.2"),
        ({"travel": 0.0}, "travel is 0"),
        ({"speed": 0.0}, "tool speed"),
        ({"joints": np.zeros(7, bool)}, "no joint"),
    ],
)
def test_what_cannot_be_is_refused_with_what_stands_in_the_way(allowed, changed, words):
    with pytest.raises(MotionError, match=words):
        replace(allowed, **changed)


def test_a_start_that_touches_is_refused_with_what_touches(panda):
    place = panda.frame_pose(READY[None])[1][0]
    for around, words in (
        (Surroundings(panda, 0.0, (Obstacle(tuple(place), (0.1, 0.1, 0.1)),)), "at box 1"),
        (Surroundings(panda, float(place[2])), "at the floor"),
    ):
        with pytest.raises(MotionError, match=words):
            Constraints(panda, READY, surroundings=around)


def test_a_joint_that_its_limits_lock_stands_and_the_others_move(panda, tmp_path):
    """Its least stir counted as a limit that was passed a million times over, and no motion was found."""
    locked = re.sub(
        r'(?s)(<joint name="panda_joint5".*?)lower="[^"]*" upper="[^"]*"', r'\1lower="0" upper="0"', panda.urdf
    )
    (tmp_path / "locked.urdf").write_text(locked)
    robot = arm(tmp_path / "locked.urdf", panda.frame)
    limits = Constraints(robot, READY, payload=PayloadRange(1.5))
    motion = design_motion(limits, Criterion(robot, "same"), 2.0, **QUICK).motion
    assert problems(limits, motion) == []
    went = np.ptp(motion(np.linspace(0.0, 2.0, 500))[0], axis=0)
    assert went[4] == 0.0
    assert went.max() > 0.3
    with pytest.raises(MotionError, match="the limits of panda_joint5 leave no room"):
        replace(limits, joints=np.arange(7) == 4)
    with pytest.raises(MotionError, match=r"panda_joint5 starts at 0\.1 rad, outside .* \(its limits are 0 and 0\)"):
        replace(limits, start=READY + 0.1 * np.eye(7)[4])


def test_a_time_that_leaves_no_motion_is_refused(panda):
    slow = arm("ur10e")
    start = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]
    with pytest.raises(MotionError, match="jerk"):
        design_motion(Constraints(slow, start, share=0.6, payload=PayloadRange(0.0)), Criterion(slow), 0.2, **QUICK)
    with pytest.raises(MotionError, match=r"expected 0\.2 to 60 s"):
        design_motion(Constraints(panda, READY), Criterion(panda), 0.1)
