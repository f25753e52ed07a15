"""Braking on the path, straight ways, motions as tables."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import MotionError
from armload.motion import Course, JoinedMotion, PathMotion, StraightMotion, export_motion, random_motion, taie2024


@pytest.fixture(scope="module", params=["panda", "ur10e"])
def moved(request):
    """An arm, its motion and its limits, what the maker does not give assumed here anew: velocity in 0.25 s."""
    robot = arm(request.param)
    motion = taie2024() if robot.name == "panda" else random_motion(robot, 1)
    limits = robot.limits
    push = np.where(np.isfinite(limits.acceleration), limits.acceleration, limits.velocity / 0.25)
    return robot, motion, push, np.where(np.isfinite(limits.jerk), limits.jerk, push / 0.1)


def test_a_stop_stays_on_the_path_and_within_the_limits(moved):
    robot, motion, push, jerk = moved
    path = motion.position(np.linspace(0.0, motion.duration, 60001))
    h = 1e-4
    for start in (0.013, 1.234, 3.7, 5.2):
        course = Course(motion, robot.limits)
        rest = course.brake(start)
        t = np.arange(start - 5 * h, rest + 20 * h, h)
        q = course.position(t)
        for pose in q[::97]:
            assert np.abs(path - pose).max(axis=1).min() < 2e-4
        v = np.diff(q, axis=0) / h  # by differences alone, not by the course's own derivatives
        a = np.diff(v, axis=0) / h
        j = np.diff(a[::50], axis=0) / (50 * h)
        own = np.abs(motion(np.linspace(0.0, motion.duration, 6001))[2]).max(axis=0)
        assert np.all(np.abs(a).max(axis=0) <= 1.01 * np.maximum(push, 1.05 * own))
        assert np.all(np.abs(j).max(axis=0) <= 1.05 * np.maximum(jerk, 1.05 * np.abs(motion.jerk(t)).max(axis=0)))
        assert np.abs(v[-10:]).max() < 1e-9
        # no arm can do it faster than its slowest joint at full deceleration, and this one is not idle about it
        fastest = np.max(np.abs(motion.velocity([start])[0]) / push)
        assert fastest <= rest - start < 0.6


def test_what_is_not_braked_is_the_motion(moved):
    robot, motion, *_ = moved
    t = np.linspace(0.0, motion.duration, 50)
    course = Course(motion, robot.limits)
    for order in range(4):
        np.testing.assert_array_equal(course._at(t, order), motion._at(t, order))
    assert course.duration == motion.duration


def test_who_brakes_at_the_end_comes_to_the_end(moved):
    robot, motion, *_ = moved
    course = Course(motion, robot.limits)
    rest = course.brake(motion.duration - 0.01)
    np.testing.assert_allclose(course.position([rest])[0], motion.position([motion.duration])[0], atol=1e-5)
    assert np.abs(course.velocity([rest])).max() < 1e-3


def test_braking_begins_once(moved):
    robot, motion, *_ = moved
    course = Course(motion, robot.limits)
    assert course.brake(1.0) == course.brake(1.1)


def test_a_slow_way_uses_at_most_its_share_of_each_limit(panda):
    start = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
    way = StraightMotion.slow(panda, start, start + np.array([0.3, 0.1, -0.7, 0.2, 0.0, 0.4, 1.0]), 0.2)
    q, dq, ddq = way(np.linspace(0.0, way.duration, 2001))
    used = np.concatenate([np.abs(dq) / panda.limits.velocity, np.abs(ddq) / panda.limits.acceleration]).max()
    assert used == pytest.approx(0.2, rel=1e-3)  # and no slower than it must be
    assert np.all(np.abs(way.jerk(np.linspace(0.0, way.duration, 2001))) <= 0.2 * panda.limits.jerk)
    np.testing.assert_allclose(q[[0, -1]], [way.start, way.stop], atol=1e-12)
    assert np.abs(np.cross(q[700, :3] - q[0, :3], q[-1, :3] - q[0, :3])).max() < 1e-12


def test_where_jerk_is_what_is_scarce_a_slow_way_takes_the_time_for_it(panda):
    start = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
    gentle = replace(panda.limits, jerk=np.full(7, 5.0))
    way = StraightMotion.slow(SimpleNamespace(limits=gentle), start, start + 0.5, 0.2)
    assert np.abs(way.jerk([0.0, way.duration])).max() == pytest.approx(0.2 * 5.0, rel=1e-9)


def test_joined_motions_are_each_of_them_in_turn(panda):
    motion = taie2024()
    begin = motion.position([0.0])[0]
    way = StraightMotion.slow(panda, begin + 0.1, begin)
    both = JoinedMotion((way, motion))
    t = np.linspace(0.0, motion.duration, 301)
    for order in range(4):
        np.testing.assert_allclose(both._at(t[1:-1] + way.duration, order), motion._at(t[1:-1], order), atol=1e-6)
    np.testing.assert_array_equal(both.position([0.0])[0], begin + 0.1)
    np.testing.assert_array_equal(both.position([both.duration]), motion.position([motion.duration]))
    with pytest.raises(MotionError, match="does not begin at rest where"):
        JoinedMotion((motion, way))
    with pytest.raises(MotionError, match="cannot be joined"):
        JoinedMotion(())


def test_a_table_of_a_motion_is_the_motion_and_comes_back_from_its_file(tmp_path):
    motion = taie2024()
    export_motion(motion, tmp_path / "m.csv", rate=250.0)
    t = np.linspace(0.0, motion.duration, 777)
    for table in (PathMotion.of(motion, 250.0), PathMotion.read(tmp_path / "m.csv")):
        assert table.duration == motion.duration
        for order, off in enumerate((1e-8, 1e-6, 1e-3, 1.0)):  # the third is not continuous in a table
            np.testing.assert_allclose(table._at(t, order), motion._at(t, order), rtol=0, atol=off)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,q1,dq1\n0,0,0\n1,1,0\n", "has the columns t, q1, dq1: expected"),
        ("t,q1,q2,q3,q4,dq1,dq2,dq3,tau1,tau2,tau3\n0,0\n", "t, q1, q2, q3, …, tau1, tau2, tau3: expected"),
        ("t,q1,dq1,ddq1\n0,0,0,0\n0,1,0,0\n", "do not rise from 0"),
        ("t,q1,dq1,ddq1\n0,x,0,0\n1,1,0,0\n", "is not a table of numbers"),
        ("t,q1,dq1,ddq1\n0,nan,0,0\n1,1,0,0\n", "not finite"),
    ],
)
def test_a_file_that_is_no_motion_is_refused(text, said, tmp_path):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(MotionError, match=said):
        PathMotion.read(path)
