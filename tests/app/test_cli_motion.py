"""`armload motion design` and `enrich` on the command line: files others read, and refusals in one sentence."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from armload.app.cli import main, motion_enrich
from armload.app.cli.motion_arguments import joints
from armload.arms import arm
from armload.errors import MotionError
from armload.excitation import Surroundings
from armload.excitation.constraints import SHARE, TOOL_SPEED, TRAVEL
from armload.motion import export_motion, load_motion
from armload.motion.point_to_point import PointToPoint

READY = "0.0123,-0.5,0,-2,0,1.6,0.8"


@pytest.fixture(scope="module")
def designed(tmp_path_factory):
    """One short design with its own empty run, and what was printed."""
    import contextlib
    import io

    folder, printed = tmp_path_factory.mktemp("motion"), io.StringIO()
    words = (
        f"motion design --robot panda --from {READY} --time 0.5 --tare-time 0.6 --share 0.6 --payload 1 --json --out"
    )
    with contextlib.redirect_stdout(printed):
        assert main([*words.split(), str(folder / "m.json")]) == 0
    return folder, json.loads(printed.getvalue())


@pytest.mark.full  # some seconds
def test_a_design_is_exported_with_the_pose_first_at_rest_and_the_pose_again(designed, tmp_path):
    folder, said = designed
    for file, lasting in ((said["motion"], 0.5), (said["empty_motion"], 0.6)):
        assert main(["motion", "export", file, "--format", "csv", "--out", str(tmp_path / "m.csv")]) == 0
        header, *_ = (tmp_path / "m.csv").read_text().splitlines()
        assert header.split(",")[:15] == ["t", *(f"q{k}" for k in range(1, 8)), *(f"dq{k}" for k in range(1, 8))]
        table = np.loadtxt(tmp_path / "m.csv", delimiter=",", skiprows=1)
        pose = [float(x) for x in READY.split(",")]
        np.testing.assert_array_equal(table[[0, -1], 1:8], [pose, pose])
        np.testing.assert_array_equal(table[[0, -1], 8:15], 0.0)
        assert table[-1, 0] == lasting
        limits, middle = arm("panda").limits, 0.0
        assert np.all(np.abs(table[:, 8:15]) <= 0.6 * limits.velocity)
        middle = (limits.position_low + limits.position_high) / 2
        assert np.all(np.abs(table[:, 1:8] - middle) <= 0.6 * (limits.position_high - limits.position_low) / 2)
    assert (folder / "m-empty.json").exists()


def test_the_table_of_a_motion_is_that_motion_to_every_command(designed, tmp_path, capsys):
    file, table = designed[1]["motion"], str(tmp_path / "m.csv")
    assert main(["motion", "export", file, "--format", "csv", "--rate", "1000", "--out", table]) == 0
    found = []
    for motion in (file, table):
        capsys.readouterr()
        assert main(["motion", "check", motion, "--robot", "panda", "--payload", "none", "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out))
        assert main(["motion", "show", motion, "--robot", "panda"]) == 0
        assert main(["motion", "export", motion, "--format", "ros2"]) == 0
    assert [one["kind"] for one in found] == ["motion", "motion"]
    fastest = [one["peak"]["velocity"] for one in found]  # of the table at each of its rows, of the motion at 200 Hz
    np.testing.assert_allclose(fastest[1], fastest[0], rtol=2e-3)
    np.testing.assert_allclose(
        found[1]["without_tare"]["half_width"], found[0]["without_tare"]["half_width"], rtol=1e-3
    )


def test_an_export_without_a_file_is_printed_and_a_figure_is_a_picture(designed, tmp_path, capsys):
    _, said = designed
    export = ["motion", "export", said["motion"], "--format", "csv"]
    assert main([*export, "--out", str(tmp_path / "m.csv")]) == 0
    capsys.readouterr()
    assert main(export) == 0
    assert capsys.readouterr().out == (tmp_path / "m.csv").read_text()
    assert main(["motion", "show", said["motion"], "--figure", str(tmp_path / "m.png")]) == 0
    assert (tmp_path / "m.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    capsys.readouterr()
    assert main(["motion", "show", said["motion"], "--robot", "ur10e", "--figure", str(tmp_path / "n.png")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "moves 7 joints: ur10e has 6" in printed.err


def test_the_json_says_what_is_told_and_what_is_used(designed):
    _, said = designed
    assert said["duration"] == 0.5
    assert said["empty_duration"] == 0.6
    assert len(said["half_width"]) == len(said["parameters"]) == len(said["units"]) == 10
    assert all(0 < after < before for after, before in zip(said["half_width"], said["prior_half_width"], strict=True))
    assert max(said["used"].values()) <= 1.0


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--from 0,-0.5,0,-3.0,0,1.6,0.8 --share 0.6", "outside 0.6 of its range"),
        ("--from 0,-0.5,0,-2,0,1.6", "has 6 joint positions: panda has 7"),
        (f"--from {READY} --payload 30", "to hold the worst payload"),
        (f"--from {READY} --box 0,0,1", "is not a box"),
        (f"--from {READY} --joints 9", "joints 1 to 7"),
        (f"--from {READY} --joints a", "names no joints"),
        (f"--from {READY} --joints 0-3", "names joint 0"),
        ("--from 0,-0.5,0,-2,0,1.6,nan", "has nan at panda_joint7"),
        ("--from 0,-28,0,-114,0,91,45", "are these degrees?"),
        (f"--from {READY} --joints 7-5", "'7-5' names no joints"),
        (f"--from {READY} --joints 1-99999999999", "names no joints"),
        (f"--from {READY} --until mass=3apples", "is no accuracy"),
        (f"--from {READY} --until mass=10g --time 2", "exclude each other"),
        (f"--from {READY} --tare none --tare-time 2", "leave --tare out"),
        (f"--from {READY} --held 1,2", "is not a body"),
    ],
)
def test_a_request_that_cannot_be_met_is_one_sentence(words, expected, tmp_path, capsys):
    out = tmp_path / "m.json"
    assert main(["motion", "design", "--robot", "panda", *words.split(), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert expected in printed.err
    assert printed.err.count("\n") == 1
    assert not out.exists()


def test_a_box_in_the_way_of_the_start_is_refused_by_its_number(tmp_path, capsys):
    place = arm("panda").frame_pose(np.array([[float(x) for x in READY.split(",")]]))[1][0]
    box = ",".join(f"{x:.3f}" for x in place) + ",0.1,0.1,0.1"
    words = ["motion", "design", "--robot", "panda", "--from", READY, "--box", "2,2,2,0.1,0.1,0.1", "--box", box]
    assert main([*words, "--out", str(tmp_path / "m.json")]) == 2
    assert "box 2" in capsys.readouterr().err


def test_a_design_keeps_off_a_floor_at_the_base_where_nothing_is_said_of_one(tmp_path, capsys):
    lying, out = "0,1.7,0,-0.1,0,1.8,0.8", str(tmp_path / "m.json")  # the hand is below the base
    assert main([*f"motion design --robot panda --from {lying} --time 0.5 --share 1 --out".split(), out]) == 2
    assert "is at the floor" in capsys.readouterr().err


def test_a_path_that_runs_into_the_floor_itself_is_said_to(tmp_path, capsys):
    robot, start = arm("panda"), np.array([float(x) for x in READY.split(",")])
    lower = start + np.array([0, 0.5, 0, 0, 0, 0, 0])
    path = PointToPoint(np.array([start, lower]), np.array([0.1]), np.array([1.5]), name="move")
    export_motion(path, tmp_path / "move.csv", "csv", rate=50.0, joint_names=robot.joint_names)
    words = ["motion", "enrich", str(tmp_path / "move.csv"), "--robot", "panda", "--payload", "1"]
    high = float(Surroundings(robot, 0.0).clearance(np.array([start, lower]))[:, 0].mean())
    for floor, said in ((0.0, False), (high, True)):
        assert main([*words, "--floor", str(floor), "--out", str(tmp_path / "e.json")]) == 0
        assert ("is at the floor" in capsys.readouterr().err) == said


@pytest.mark.parametrize("action", [f"design --from {READY}", "random"])
@pytest.mark.parametrize("name", ["m.csv", "m"])
def test_a_motion_is_written_under_no_other_ending_than_its_own(action, name, tmp_path, capsys):
    words = ["motion", *action.split(), "--robot", "panda", "--out", str(tmp_path / name)]
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "a name that ends in .json" in printed.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("start", "asked"),
    [("0,-28,0,-114,0,91,45", True), ("0,-0.5,0,-2,0,1.6,3", False), ("0,-0.5,0,-2,0,1.6,nan", False)],
)
def test_a_pose_beyond_the_limits_that_would_be_within_them_in_degrees_is_asked_about(start, asked, tmp_path, capsys):
    words = ["motion", "export", "taie2024", "--format", "csv", "--robot", "panda", "--from", start]
    assert main([*words, "--out", str(tmp_path / "m.csv")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "expected a position from" in printed.err
    assert ("are these degrees?" in printed.err) == asked


def test_a_motion_that_is_not_there_is_asked_for_by_the_command_that_writes_one(capsys):
    assert main(["motion", "check", "nosuch.json", "--robot", "panda"]) == 2
    assert "`armload motion design`" in capsys.readouterr().err


@pytest.mark.parametrize("form", ["csv", "ros2"])
def test_a_path_of_a_table_or_a_trajectory_is_enriched(form, tmp_path, capsys):
    robot = arm("panda")
    start = np.array([float(x) for x in READY.split(",")])
    path = PointToPoint(np.array([start, start + 0.2]), np.array([0.1]), np.array([1.0]), name="move")
    file = tmp_path / {"csv": "move.csv", "ros2": "move.yaml"}[form]
    export_motion(path, file, form, rate=50.0, joint_names=robot.joint_names)
    out = tmp_path / "enriched.json"
    words = ["motion", "enrich", str(file), "--robot", "panda", "--payload", "1", "--json", "--out", str(out)]
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out)
    assert 0 < said["distance"] <= 5e-3
    assert np.prod(np.array(said["half_width"]) / said["half_width_before"]) < 0.1
    found = load_motion(out)
    np.testing.assert_allclose(found([0.0, found.duration])[0], [start, start + 0.2], atol=1e-8)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "time,x\n0,1\n", "expected t, q1"),
        ("a.csv", "t,q1,q2,q3,q4,q5,q6,q7\n0,1\n", "not 8 numbers"),
        ("hole.csv", "t,q1,q2,q3,q4,q5,q6,q7\n0,0,0,0,0,0,0,0\n1,0,0,nan,0,0,0,0\n", "joint 3 at point 2"),
        ("of_eight.csv", "t,q1,q2,q3,q4,q5,q6,q7,q8\n0,1,1,1,1,1,1,1,1\n", "q8: expected t, q1 … q7"),
        ("a.yaml", "joint_names: [a]\npoints: []\n", "no JointTrajectory of panda"),
        ("a.yaml", "- 1\n", "is no path"),
        ("a.yaml", "{]", "neither JSON nor YAML"),
    ],
)
def test_a_file_that_is_no_path_is_refused(name, text, words, tmp_path, capsys):
    (tmp_path / name).write_text(text)
    assert main(["motion", "enrich", str(tmp_path / name), "--robot", "panda", "--out", str(tmp_path / "o.json")]) == 2
    assert words in capsys.readouterr().err


def test_a_path_that_was_written_for_a_controller_is_checked_as_the_motion_that_it_is(tmp_path, capsys):
    joints_of, start = arm("panda").joint_names, (0.2, -0.4, 0.1, -2.1, 0.0, 1.5, 0.9)
    (tmp_path / "m.csv").write_text(table_of(start, 0.2))
    words = ["motion", "export", str(tmp_path / "m.csv"), "--robot", "panda", "--format", "ros2"]
    assert main([*words, "--out", str(tmp_path / "m.yaml")]) == 0
    assert joints_of[0] in (tmp_path / "m.yaml").read_text()
    capsys.readouterr()
    told = []
    for name in ("m.csv", "m.yaml"):
        assert main(["motion", "check", str(tmp_path / name), "--robot", "panda", "--json"]) == 0
        told.append(json.loads(capsys.readouterr().out))
    assert told[0]["duration"] == pytest.approx(told[1]["duration"], abs=1e-6)
    widths = [said["without_tare"]["half_width"] for said in told]
    np.testing.assert_allclose(*widths, rtol=1e-3)
    assert main(["motion", "show", str(tmp_path / "m.yaml"), "--robot", "ur5e"]) == 2
    assert "no JointTrajectory of ur5e" in capsys.readouterr().err


def test_of_a_motions_joints_nobody_said_which_slide_unless_a_robot_is_named(tmp_path, capsys):
    (tmp_path / "m.csv").write_text(table_of((0.1, 0.2), 0.1))
    assert main(["motion", "show", str(tmp_path / "m.csv")]) == 0
    assert "m]" in capsys.readouterr().out
    assert main(["motion", "show", "taie2024"]) == 0
    told = capsys.readouterr().out
    assert "rad]" in told
    assert "m]" not in told


def table_of(start, by, seconds=2.0):
    """The text of a table: every joint goes so far, at rest at both ends."""
    t = np.linspace(0.0, seconds, 201)
    x = t / seconds
    course = [
        10 * x**3 - 15 * x**4 + 6 * x**5,
        (30 * x**2 - 60 * x**3 + 30 * x**4) / seconds,
        (60 * x - 180 * x**2 + 120 * x**3) / seconds**2,
    ]
    columns = [t] + [q + by * course[0] for q in start] + [by * part for part in course[1:] for _ in start]
    kinds = [f"{kind}{k + 1}" for kind in ("q", "dq", "ddq") for k in range(len(start))]
    rows = [",".join(f"{value:.12g}" for value in row) for row in np.array(columns).T]
    return "\n".join([",".join(["t", *kinds]), *rows]) + "\n"


def test_accuracies_and_joints_are_read_with_their_units():
    assert joints("7,1-2") == (1, 2, 7)


def test_an_export_from_the_present_pose_begins_there_and_each_step_of_it_is_within_the_limits(designed, tmp_path):
    _, said = designed
    here = "0.2,-0.4,0.1,-2.1,0,1.5,0.9"
    words = ["motion", "export", said["motion"], "--format", "csv", "--from", here, "--payload", "1"]
    assert main([*words, "--out", str(tmp_path / "m.csv")]) == 0
    table = np.loadtxt(tmp_path / "m.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[0, 1:8], [float(x) for x in here.split(",")])
    np.testing.assert_array_equal(table[-1, 1:8], [float(x) for x in READY.split(",")])
    motion, h = load_motion(said["motion"]), np.diff(table[:, 0]).mean()
    assert table[-1, 0] >= motion.duration + 1.0
    limits, q = arm("panda").limits, table[:, 1:8]
    for order, most in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        assert np.all(np.abs(np.diff(q, order, axis=0)) / h**order <= most)
    led = np.searchsorted(table[:, 0], table[-1, 0] - motion.duration) + 50
    np.testing.assert_allclose(q[led:], motion.position(table[led:, 0] - table[-1, 0] + motion.duration), atol=2e-9)


def test_a_trajectory_from_the_present_pose_does_not_leave_the_way_there_to_the_controller(designed, capsys):
    import yaml

    _, said = designed
    here = [0.2, -0.4, 0.1, -2.1, 0.0, 1.5, 0.9]
    words = ["motion", "export", said["motion"], "--robot", "panda", "--format", "ros2", "--payload", "1"]
    assert main([*words, "--from", ",".join(map(str, here))]) == 0
    points = yaml.safe_load(capsys.readouterr().out)["points"]
    assert points[0]["positions"] == here
    assert points[0]["time_from_start"] == {"sec": 0, "nanosec": 500_000_000}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--from 0.2,-0.4,0.1,-2.1,0,1.5", "has 6 joint positions: panda has 7"),
        ("--from 1.6,-0.4,0.1,-2.1,0,1.5,0.9", "more than the 1 rad of --approach"),
        ("--from 0.8,-0.4,0.1,-2.1,0,1.5,0.9 --box 0.4,0.3,0.5,0.1,0.1,0.5", "because of the way to the start"),
        ("--box 0.4,0.2,0.5,0.1,0.1,0.5", "give it with --from"),
        ("--floor 0.1", "give it with --from"),
        ("--floor none", "give it with --from"),
    ],
)
def test_a_way_from_the_present_pose_that_is_not_allowed_is_refused(designed, tmp_path, capsys, words, expected):
    _, said = designed
    out = tmp_path / "m.csv"
    assert main(["motion", "export", said["motion"], "--format", "csv", "--out", str(out), *words.split()]) == 2
    assert expected in capsys.readouterr().err
    assert not out.exists()


def test_the_help_says_the_limits_of_a_design_and_of_a_path_when_none_is_asked_for(monkeypatch, tmp_path, capsys):
    kept = SimpleNamespace()

    def constraints_of(options, *_):
        kept.share, kept.travel, kept.speed = options.share, options.travel, options.speed
        raise MotionError("far enough")

    monkeypatch.setattr(motion_enrich, "constraints_of", constraints_of)
    start = np.array([float(x) for x in READY.split(",")])
    path = PointToPoint(np.array([start, start + 0.2]), np.array([0.1]), np.array([1.0]), name="move")
    export_motion(path, tmp_path / "path.csv", "csv")
    assert main(["motion", "enrich", str(tmp_path / "path.csv"), "--robot", "panda", "--out", "o.json"]) == 2
    for command, values in (("design", (SHARE, TRAVEL, TOOL_SPEED)), ("enrich", (kept.share, kept.travel, kept.speed))):
        capsys.readouterr()
        assert main(["motion", command, "--help"]) == 0
        words = " ".join(capsys.readouterr().out.split())
        for name, value in zip(("--share S of", "--travel RAD", "--speed V of"), values, strict=True):
            found = re.search(rf"{name}[^(]*\(default: (\S+)\)", words)
            assert found is not None
            said = found[1]
            assert value >= 1e3 if said == "any" else float(said) == value


@pytest.fixture(scope="module")
def of_six(tmp_path_factory):
    """The file of a motion of six joints."""
    path = tmp_path_factory.mktemp("six") / "six.json"
    assert main(["motion", "random", "--robot", "ur10e", "--seed", "3", "--duration", "2", "--out", str(path)]) == 0
    return str(path)


@pytest.mark.parametrize(
    "words",
    [
        "motion show {} --robot panda",
        "motion show {} --figure f.png",
        "motion check {} --robot panda",
        "motion check random:1 --robot panda --tare {}",
        "motion export {} --format csv --robot panda",
        "motion export {} --format ur --robot panda",
        "motion export {} --format ros2",
        "motion export {} --format csv --from 0,0,0,0,0,0,0",
        "motion enrich {} --robot panda --out o.json",
        "motion design --robot panda --from 0,-0.5,0,-2,0,1.6,0.8 --tare {} --out o.json",
        "measure sim --robot panda --motion {} --dry-run",
        "dataset --robot panda --motion {} --out data",
    ],
)
def test_every_command_refuses_a_motion_of_another_arm_alike(of_six, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words.format(of_six).split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "moves 6 joints: panda has 7; name the arm that it is of" in printed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", ["motion show {}", "motion export {} --format csv", "motion export {} --format ur"])
def test_what_needs_no_arm_takes_any_motion_where_none_is_named(of_six, words, capsys):
    assert main(words.format(of_six).split()) == 0
    assert capsys.readouterr().out
