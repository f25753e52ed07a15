"""An enriched path stays in its tube, keeps ends, stops and times, and tells what the path alone leaves open."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armload.app.cli import main
from armload.arms import arm
from armload.devices.ros2.trajectory_file import read_path
from armload.errors import MotionError
from armload.excitation import Constraints, Criterion, Obstacle, PayloadRange, Surroundings, enrich, problems
from armload.motion import PathMotion, export_motion, load_motion, save_motion
from armload.motion.point_to_point import PointToPoint

READY = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def path():
    there = READY + np.array([-0.4, 0.1, 0.0, 0.1, 0.0, 0.0, 0.3])
    return PointToPoint(np.array([READY, there, READY]), np.array([0.2, 1.4]), np.array([1.0, 2.2]), name="carry")


@pytest.fixture(scope="module")
def allowed(panda):
    return Constraints(panda, READY, share=1.0, payload=PayloadRange(2.0), travel=10.0, speed=5.0)


def trajectory(panda, *seconds, joints=()):
    points = [{"positions": READY.tolist(), "time_from_start": {"sec": s}} for s in seconds]
    return json.dumps({"joint_names": [*panda.joint_names, *joints], "points": points})


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("p.json", lambda panda: trajectory(panda, 0, float("inf")), "is no JointTrajectory"),
        ("p.json", lambda panda: trajectory(panda, 0, 10**400), "is no JointTrajectory"),
        ("p.yaml", lambda _: "made: 2026-13-45", "is neither JSON nor YAML: month must be in"),
        ("p.yaml", lambda _: "[" * 100_000, "is neither JSON nor YAML"),
        ("p.csv", lambda _: "t,q1,q2,q3,q4,q5,q6,q7\n", "has a row that is not 8 numbers"),
        ("p.csv", lambda _: f"t,q1,q2,q3,q4,q5,q6,q7,q1\n{'0,' * 8}0\n{'1,' * 8}1", "has 2 columns 'q1'"),
        ("p.csv", lambda _: f"t,q1,q2,q3,q4,q5,q6,q7\n{'0,' * 7}0\n1e9,{'0,' * 6}0", "lasts 1e.09 s: expected 3600 s"),
        ("p.json", lambda panda: trajectory(panda, 0, 10**9), "lasts 1e.09 s: expected 3600 s"),
        ("p.json", lambda panda: trajectory(panda, 0, "2"), 'time_from_start holds "2": expected nothing but numbers'),
        ("p.json", lambda panda: trajectory(panda, 0, 2).replace("0.8", '"0.8"', 1), 'positions holds "0.8"'),
        ("p.json", lambda panda: trajectory(panda, 0, 2, joints=[5]), "names a joint 5: expected texts"),
        ("p.json", lambda panda: trajectory(panda, 0, 2, joints=["panda_joint1"]), "panda_joint7, each once"),
    ],
    ids=[
        *("at no time", "at a time too long", "no date", "too deep", "no row", "a column twice", "a table of years"),
        *("a trajectory of years", "a time as text", "an angle as text", "a joint without a name", "a joint twice"),
    ],
)
def test_what_is_no_path_is_refused_in_a_sentence(panda, tmp_path, name, content, says):
    (tmp_path / name).write_text(content(panda))
    with pytest.raises(MotionError, match=says):
        read_path(tmp_path / name, panda)


@pytest.fixture(scope="module")
def enriched(panda, path, allowed):
    return enrich(path, allowed, Criterion(panda, "same"))


def test_the_flange_stays_within_its_tube(panda, path, enriched):
    t = np.linspace(0.0, path.duration, 900)
    (R, p), (S, r) = panda.frame_pose(path(t)[0]), panda.frame_pose(enriched.motion(t)[0])
    turned = np.arccos(np.clip((np.einsum("tij,tij->t", R, S) - 1.0) / 2.0, -1.0, 1.0))
    assert 1e-3 < np.linalg.norm(p - r, axis=1).max() <= 5e-3 * (1 + 1e-6)
    assert np.deg2rad(0.5) < turned.max() <= np.deg2rad(2.0) + 1e-6
    assert enriched.distance == pytest.approx(np.linalg.norm(p - r, axis=1).max(), rel=0.01)
    assert enriched.angle == pytest.approx(turned.max(), rel=0.01)


def test_ends_stops_and_times_stay_as_they_are(path, enriched):
    assert enriched.motion.duration == path.duration
    t = np.concatenate([np.linspace(0.0, 0.19, 9), np.linspace(1.01, 1.39, 9), [path.duration]])
    for order in (0, 1, 2):
        np.testing.assert_allclose(enriched.motion.derivative(t, order), path.derivative(t, order), atol=2e-4)
    np.testing.assert_allclose(enriched.motion(t)[0], path(t)[0], atol=1e-9)


def test_what_the_path_left_open_is_narrowed_to_half_at_least(enriched):
    open_before = enriched.before > 0.5 * Criterion(arm("panda")).prior_half_width
    assert open_before.any()
    assert np.all(enriched.after[open_before] < 0.5 * enriched.before[open_before])
    assert np.all(enriched.after < 1.02 * enriched.before)


def test_an_enriched_path_keeps_to_the_limits_and_to_its_file(allowed, enriched, tmp_path):
    assert [text for text in problems(allowed, enriched.motion) if "at rest" not in text] == []
    save_motion(tmp_path / "m.json", enriched.motion)
    back = load_motion(tmp_path / "m.json")
    t = np.linspace(0.0, back.duration, 77)
    for order in range(4):
        np.testing.assert_array_equal(back.derivative(t, order), enriched.motion.derivative(t, order))


def test_a_change_whose_jerk_is_soon_too_large_keeps_most_of_its_room():
    """A change begins at a point that is handed out: amid two, its jerk jumped, and three of five mm were left."""
    ur, home = arm("ur5e"), np.array([0.0, -1.2, 1.5, -1.5, -1.57, 0.0])
    there = home + np.array([0.4, 0.1, -0.1, 0.1, 0.2, 0.3])
    path = PointToPoint(np.array([home, there, home]), np.array([0.2, 1.6]), np.array([1.2, 2.6]), name="carry")
    about = Constraints(ur, home, share=1.0, payload=PayloadRange(2.0), travel=10.0, speed=5.0)
    found = enrich(path, about, Criterion(ur, "same"))
    assert found.used[0].share <= 1.0
    assert 4.5e-3 < found.distance <= 5e-3


@pytest.mark.full  # some seconds
def test_a_quick_change_that_does_not_pass_is_made_smaller_and_not_looked_for_further():
    ur, home = arm("ur10e"), np.array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0])
    low, high, over = home + np.array([[0.0, 0.15, 0, 0, 0, 0], [-0.4, 0, 0, 0, 0, 0], [-0.8, 0, 0, 0, 0, 0.6]])
    starts, ends = np.array([0.2, 1.2, 2.3, 3.2, 4.4]), np.array([1.0, 2.0, 3.0, 4.2, 5.8])
    path = PointToPoint(np.array([home, low, home, high, over, home]), starts, ends, name="pick and place")
    about = Constraints(ur, home, share=1.0, payload=PayloadRange(6.0), travel=10.0, speed=3.0)
    quick, found = (enrich(path, about, Criterion(ur, "same"), quick=quick) for quick in (True, False))
    assert max(quick.used[0].share, found.used[0].share) <= 1.0
    assert quick.distance < 4e-3
    assert found.distance > 4.8e-3


def test_an_enriched_path_comes_no_nearer_to_what_its_path_is_near(panda, path, allowed):
    """A design may go down to half of what its start has; a path that starts 1 cm above a table may not."""
    t = np.linspace(0.0, path.duration, 2000)
    _, place = panda.frame_pose(READY[None])
    table = Obstacle((float(place[0, 0]), 0.0, float(place[0, 2]) - 0.1 - 0.15 - 0.01 - 0.05), (0.2, 0.2, 0.1))
    around = Surroundings(panda, boxes=(table,))
    near = around.clearance(path(t)[0])[:, 2].min()
    assert 0.005 < near < 0.015
    found = enrich(path, replace(allowed, surroundings=around), Criterion(panda, "same"))
    assert around.clearance(found.motion(t)[0])[:, 2].min() > near - 1.001e-3


def test_no_room_nothing_that_moves_and_a_path_beyond_a_limit_are_refused(panda, path, allowed):
    known = Criterion(panda, "same")
    with pytest.raises(MotionError, match="room in one of them"):
        enrich(path, allowed, known, distance=0.0, angle=0.0)
    still = PathMotion(np.array([0.0, 1.0]), np.tile(READY, (2, 1)), np.zeros((2, 7)), np.zeros((2, 7)))
    with pytest.raises(MotionError, match="nothing to change"):
        enrich(still, allowed, known)
    with pytest.raises(MotionError, match="passes a limit by itself"):
        enrich(path, replace(allowed, speed=0.1, surroundings=Surroundings(panda)), known)


def test_a_path_motion_is_its_own_derivative_and_goes_through_its_points(path):
    motion = PathMotion.of(path, 50.0)
    np.testing.assert_allclose(motion(motion.times)[0], motion.positions, atol=1e-12)
    t = np.linspace(0.3, 0.9, 23) + 1e-3
    for order in (1, 2, 3):
        slope = (motion.derivative(t + 1e-6, order - 1) - motion.derivative(t - 1e-6, order - 1)) / 2e-6
        np.testing.assert_allclose(motion.derivative(t, order), slope, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(motion(t)[0], path(t)[0], atol=1e-5)


@pytest.mark.parametrize(
    "changed",
    [
        {"times": np.array([0.0, 0.0])},
        {"times": np.array([0.1, 1.0])},
        {"times": np.array([0.0])},
        {"velocities": np.zeros((2, 6))},
        {"positions": np.full((2, 7), np.nan)},
    ],
)
def test_points_that_make_no_path_are_refused(changed):
    points = {
        "times": np.array([0.0, 1.0]),
        **{k: np.zeros((2, 7)) for k in ("positions", "velocities", "accelerations")},
    }
    with pytest.raises(MotionError):
        PathMotion(**(points | changed))


HOME = np.array([0.0, -1.6, 1.4, -1.4, -1.57, 0.0])


def cubic(arm, start, step, file, *, at=0.0):
    """What a planner writes with velocities alone: its acceleration jumps, so that its jerk is large for a moment."""
    points = []
    for k, (share, speed) in enumerate([(0.0, 0.0), (0.15, 0.35), (0.5, 0.5), (0.85, 0.35), (1.0, 0.0)]):
        when = round((at + 0.6 * k) * 1e9)
        points.append(
            {
                "positions": (start + share * step).tolist(),
                "velocities": (speed * step).tolist(),
                "time_from_start": {"sec": when // 10**9, "nanosec": when % 10**9},
            }
        )
    file.write_text(json.dumps({"joint_names": arm.joint_names, "points": points}))
    return file


@pytest.mark.parametrize(("millimetres", "degrees"), [(5.0, 0.0), (0.0, 2.0)])
def test_no_millimetre_or_no_degree_asked_for_is_none_that_matters(panda, path, allowed, millimetres, degrees):
    found = enrich(path, allowed, Criterion(panda, "same"), distance=1e-3 * millimetres, angle=np.deg2rad(degrees))
    assert found.distance <= max(1e-3 * millimetres, 1e-5)
    assert found.angle <= np.deg2rad(max(degrees, 0.01))
    t = np.linspace(0.0, path.duration, 900)
    (_, p), (_, r) = panda.frame_pose(path(t)[0]), panda.frame_pose(found.motion(t)[0])
    assert np.linalg.norm(p - r, axis=1).max() <= 1.001 * max(1e-3 * millimetres, 1e-5)


@pytest.mark.parametrize(("first", "last", "where"), [(0.5, 2.2, "begin"), (0.2, 0.8, "end")])
def test_a_path_that_begins_or_ends_while_it_moves_is_refused(panda, path, first, last, where):
    t = np.linspace(first, last, 100)
    cut = PathMotion(t - first, *(path.derivative(t, order) for order in range(3)), name="cut")
    about = Constraints(panda, cut(np.zeros(1))[0][0], share=1.0, payload=PayloadRange(2.0), travel=10.0, speed=5.0)
    with pytest.raises(MotionError, match=rf"'cut' does not {where} at rest: panda_joint1 moves at 0\.\d+ rad/s"):
        enrich(cut, about, Criterion(panda, "same"))


def test_a_path_may_jump_in_acceleration_where_the_maker_sets_no_limit(tmp_path):
    """UR's controllers take such paths every day; a limit that is only assumed forbids none."""
    ur = arm("ur10e")
    path = read_path(cubic(ur, HOME, np.array([0.6, 0.2, -0.3, 0.2, 0.1, 0.5]), tmp_path / "p.json"), ur)
    about = Constraints(ur, HOME, share=1.0, payload=PayloadRange(3.0), travel=1e3, speed=1e3)
    assert any(
        "jerk" in text and "what is assumed, as its maker gives no limit" in text for text in problems(about, path)
    )
    found = enrich(path, about, Criterion(ur, "same"))
    assert np.all(found.after < 1.02 * found.before)
    assert found.after.sum() < 0.8 * found.before.sum()
    speed = np.abs(found.motion.velocity(np.linspace(0.0, path.duration, 500))).max(axis=0)
    assert np.all(speed < ur.limits.velocity)


def test_a_maker_s_limit_that_a_path_passes_is_named_with_what_can_be_done(panda, path, allowed):
    known = Criterion(panda, "same")
    fast = PathMotion.of(path, 100.0)
    fast = PathMotion(0.3 * fast.times, fast.positions, fast.velocities / 0.3, fast.accelerations / 0.09, "fast")
    with pytest.raises(MotionError, match=r"of its limit\); change the path$"):
        enrich(fast, allowed, known)
    with pytest.raises(MotionError, match="change the path, or allow a higher --speed"):
        enrich(path, replace(allowed, speed=0.1), known)
    with pytest.raises(MotionError, match="change the path, or allow a larger --travel"):
        enrich(path, replace(allowed, travel=0.1), known)


@pytest.mark.parametrize("begins", [0.0, 2.5])
def test_an_enriched_trajectory_is_due_when_its_path_was(tmp_path, capsys, begins):
    ur = arm("ur10e")
    file = cubic(ur, HOME, np.array([0.6, 0.2, -0.3, 0.2, 0.1, 0.5]), tmp_path / "p.json", at=begins)
    out = tmp_path / "o.yaml"
    assert main(["motion", "enrich", str(file), "--robot", "ur10e", "--payload", "3", "--out", str(out)]) == 0
    assert "the first point is due" not in capsys.readouterr().err
    enriched = read_path(out, ur)
    assert enriched.begins == begins
    assert enriched.duration == pytest.approx(2.4)


def test_of_a_path_without_such_a_time_the_way_to_the_start_is_said(path, tmp_path, capsys):
    save_motion(tmp_path / "m.json", PathMotion.of(path, 100.0))
    out = tmp_path / "o.yaml"
    words = ["motion", "enrich", str(tmp_path / "m.json"), "--robot", "panda", "--payload", "2", "--out", str(out)]
    assert main(words) == 0
    assert "the first point is due after 5 s" in capsys.readouterr().err
    assert read_path(out, arm("panda")).begins == 5.0


def test_a_program_for_ur_robots_of_another_arm_is_refused_before_anything_is_computed(path, tmp_path, capsys):
    save_motion(tmp_path / "m.json", PathMotion.of(path, 100.0))
    words = ["motion", "enrich", str(tmp_path / "m.json"), "--robot", "panda", "--out", str(tmp_path / "o.script")]
    assert main(words) == 2
    assert "which have 6 joints: panda has 7" in capsys.readouterr().err


def test_a_path_whose_times_are_in_milliseconds_is_asked_about_at_once(panda, allowed):
    rows = np.array([READY, READY + 0.1, READY])
    slow = PathMotion(np.array([0.0, 2000.0, 4000.0]), rows, np.zeros((3, 7)), np.zeros((3, 7)), "slow")
    with pytest.raises(MotionError, match=r"'slow' takes 4000 s, and no joint goes faster than 9.*are these ms\?"):
        enrich(slow, allowed, Criterion(panda, "same"))


def test_a_table_with_semicolons_is_told_what_parts_columns(panda, tmp_path):
    (tmp_path / "p.csv").write_text("t;q1;q2;q3;q4;q5;q6;q7\n0;0;0;0;0;0;0;0\n")
    with pytest.raises(MotionError, match="in s and rad, parted by commas"):
        read_path(str(tmp_path / "p.csv"), panda)


@pytest.mark.parametrize("form", ["p.json", "p.yaml"])
def test_a_trajectory_where_a_motion_is_expected_is_called_one(panda, path, tmp_path, form):
    cubic(panda, READY, np.full(7, 0.1), tmp_path / "p.json")
    export_motion(path, tmp_path / "p.yaml", "ros2", joint_names=panda.joint_names)
    with pytest.raises(MotionError, match="it is a JointTrajectory, for controllers"):
        load_motion(tmp_path / form)
