"""An arm on a linear axis: metres and newtons of the joint that slides, radians and N·m of those that turn."""

import json
import re

import numpy as np
import pytest

from armload.app.cli import main
from armload.app.cli.motion_check import passed
from armload.app.cli.profile_text import next_steps
from armload.arms import Arm, arm
from armload.devices import Supervision, Thresholds
from armload.errors import MotionError, RecordingError
from armload.excitation import Constraints, PayloadRange, problems
from armload.excitation.verification import used
from armload.identification import check_plausible
from armload.identification.arm_notes import arm_changed
from armload.identification.notes import torques_drift
from armload.lab.report.motion_figure import motion_figure
from armload.motion import Course, PathMotion, StraightMotion, check_motion, random_motion, save_motion
from armload.online import Gate
from armload.posterior import learn_profile
from armload.posterior.scales import Drift
from armload.recording import ColumnSpec, Recording, Sample, read_recording
from armload.recording.currents import in_si


def link(name, mass):
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0 0.05"/><mass value="{mass}"/>'
        '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>'
    )


def joint(name, kind, parent, child, limits):
    low, high, speed, effort = limits
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.2 0 0.5"/><axis xyz="0 0 1"/>'
        f'<limit lower="{low}" upper="{high}" velocity="{speed}" effort="{effort}"/></joint>'
    )


LIFT = (
    '<robot name="lift"><link name="base"/>'
    + joint("up", "prismatic", "base", "one", (0.0, 0.6, 0.8, 300.0))
    + link("one", 4.0)
    + joint("turn", "revolute", "one", "two", (-2.5, 2.5, 2.0, 80.0))
    + link("two", 2.0)
    + "</robot>"
)


@pytest.fixture(scope="module")
def lift():
    return Arm("lift", LIFT)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT)
    return path


def moved(*to, seconds=2.0):
    still = np.zeros((2, 2))
    return PathMotion(np.array([0.0, seconds]), np.array([[0.3, 0.2], list(to)]), still, still, "up")


def test_limits_know_which_joints_slide(lift, panda):
    assert lift.limits.slides.tolist() == [True, False]
    assert panda.limits.slides.tolist() == [False] * 7


@pytest.mark.parametrize("low", [-9.0, 0.0, 4.0])
def test_a_random_motion_keeps_to_a_rail_wherever_it_begins(low):
    arm_on_rail = Arm("rail", LIFT.replace('lower="0.0" upper="0.6"', f'lower="{low}" upper="{low + 2.0}"'))
    motion = random_motion(arm_on_rail, seed=1, duration=4.0)
    q = motion(np.linspace(0.0, 4.0, 400))[0][:, 0]
    assert low <= q.min() < q.max() <= low + 2.0
    assert np.ptp(q) > 0.1
    assert check_motion(arm_on_rail, motion).ok


def test_a_sentence_on_a_limit_of_a_sliding_joint_is_in_metres_and_newtons(lift):
    found = check_motion(lift, moved(0.9, 3.0, seconds=0.4), payload_radius=0.0)
    for part in (
        "up passes its position limit by 0.300 m at t = 0.40 s (0.900 m)",
        "turn passes its position limit by 0.500 rad at t = 0.40 s (3.000 rad)",
        "up passes its velocity limit of 0.8 m/s with 2.81",
        "turn passes its velocity limit of 2 rad/s with 13.1",
    ):
        assert any(part in problem for problem in found.problems), found.problems
    hard = check_motion(lift, moved(0.5, 0.2, seconds=0.12), payload_radius=0.0).problems
    assert any("up passes its force limit of 300 N with" in problem for problem in hard)
    assert "position [rad, m]" in str(found)
    assert "torque [N·m, N]" in str(found)
    assert "up (slides)" in str(found)


def test_a_design_s_limits_are_in_metres_and_newtons_too(lift):
    allowed = Constraints(lift, np.array([0.3, 0.2]), share=1.0, payload=PayloadRange(1.0))
    said = problems(allowed, moved(0.9, 3.0, seconds=0.12))
    assert any("up goes to 0.9 m" in text for text in said)
    assert any("up has velocity" in text and "0.8 m/s are allowed" in text for text in said)
    assert any("up has force" in text and "300 N are allowed" in text for text in said)
    every = [one.text for one in used(allowed, moved(0.9, 3.0))]
    assert any("turn has torque" in text and "80 N·m are allowed" in text for text in every)
    with pytest.raises(MotionError, match=r"up starts at 0\.9 m, outside .* 0 to 0\.6 m") as caught:
        Constraints(lift, np.array([0.9, 0.2]), share=1.0, payload=PayloadRange(1.0))
    assert "degrees" not in str(caught.value)
    with pytest.raises(MotionError, match=r"up needs .* N to hold .* more than 300 N"):
        Constraints(lift, np.array([0.3, 0.2]), share=1.0, payload=PayloadRange(40.0))


def test_a_log_s_limits_are_in_metres_too(lift):
    q = np.array([[0.3, 0.0], [0.7, 0.0], [0.3, 0.0]])
    said = passed(Recording(np.array([0.0, 0.5, 1.0]), q, np.full((3, 2), 2.5), np.zeros((3, 2))), lift)
    assert said[0].startswith("up passes its position limit by 0.1 m at t = 0.50 s (0.7 m)")
    assert any("up passes its velocity limit by 1.7 m/s" in text for text in said)
    assert any("turn passes its velocity limit by 0.5 rad/s" in text for text in said)


def test_show_and_its_figure_give_both_units(lift, file, tmp_path, capsys):
    save_motion(tmp_path / "up.json", moved(0.5, 0.4))
    assert main(["motion", "show", str(tmp_path / "up.json"), "--robot", str(file)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "1 (slides)" in said
    assert "[rad, m]" in said
    assert "2 (slides)" not in said
    titles = [axis.get_title() for axis in motion_figure(moved(0.5, 0.4), lift).axes[:4]]
    assert titles == ["position [rad, m]", "velocity [rad/s, m/s]", "acceleration [rad/s², m/s²]", "torque [N·m, N]"]
    assert main(["motion", "check", str(tmp_path / "up.json"), "--robot", str(file), "--payload", "none"]) == 0
    assert "velocity [rad/s, m/s]" in capsys.readouterr().out


def test_an_arm_that_turns_alone_has_no_metres(panda, tmp_path, capsys):
    motion = PathMotion(np.array([0.0, 2.0]), np.zeros((2, 7)), np.zeros((2, 7)), np.zeros((2, 7)))
    save_motion(tmp_path / "m.json", motion)
    assert main(["motion", "show", str(tmp_path / "m.json"), "--robot", "panda"]) == 0
    assert "slides" not in capsys.readouterr().out
    assert motion_figure(motion, panda).axes[3].get_title() == "torque [N·m]"


@pytest.mark.parametrize(("name", "seed"), [("panda", 3), ("ur10e", 0), ("iiwa14", 1)])
@pytest.mark.full  # some seconds
def test_no_curve_passes_where_the_number_of_a_limit_is_written(name, seed):
    """A curve that is highest or lowest at the end of its motion, far from the limit."""
    of = arm(name)
    figure = motion_figure(random_motion(of, seed, duration=3.0), of)
    figure.set_dpi(150)
    figure.canvas.draw()
    for axis in figure.axes:
        for text in axis.texts:
            box = text.get_window_extent().transformed(axis.transData.inverted())
            for line in axis.lines:
                x, y = (np.asarray(part, dtype=float) for part in line.get_data())
                inside = (x >= box.x0) & (x <= box.x1) & (y >= box.y0) & (y <= box.y1)
                assert not inside.any(), (text.get_text(), axis.get_title())


def test_the_page_names_units_by_joint(lift):
    pytest.importorskip("viser")
    from armload.app.page.motion_page import MotionPage
    from armload.excitation import Surroundings

    page = MotionPage(moved(0.5, 0.4), lift, Surroundings(lift), "127.0.0.1", 0)
    try:
        table = page._table(0.0, np.array([0.3, 0.2]), np.zeros(2))
    finally:
        page.close()
    assert "[rad, m]" in table
    assert "up (slides)" in table
    assert json.dumps(table).count("(slides)") == 1


def test_what_is_in_degrees_are_the_angles_and_not_the_joint_that_slides(lift, tmp_path):
    t = np.linspace(0.0, 2.0, 201)
    q = np.stack([0.3 + 0.2 * np.sin(t), 40.0 * np.sin(t)], axis=1)  # m and degrees
    dq = np.stack([0.2 * np.cos(t), 40.0 * np.cos(t)], axis=1)
    table = np.column_stack([t, q, dq, np.ones_like(q)])
    path = tmp_path / "run.csv"
    np.savetxt(path, table, delimiter=",", header="t,q1,q2,dq1,dq2,tau1,tau2", comments="")
    log = read_recording(path, lift, columns="q_unit=deg,dq_unit=deg/s")
    np.testing.assert_allclose(log.q, q * [1.0, np.pi / 180.0], rtol=1e-6)
    np.testing.assert_allclose(log.dq, dq * [1.0, np.pi / 180.0], rtol=1e-6)
    scale, _ = in_si(ColumnSpec.of("q_unit=deg,dq_unit=deg/s"), lift, 2, "here")  # of a bag, of a topic
    np.testing.assert_allclose(scale, [1.0, np.pi / 180.0, 1.0, np.pi / 180.0, 1.0, 1.0])


def test_a_log_beyond_the_range_of_a_joint_that_slides_is_refused_in_metres(lift):
    t = np.linspace(0.0, 2.0, 201)
    q = np.stack([0.7 + 0.2 * np.sin(t), 0.4 * np.sin(t)], axis=1)
    log = Recording(t, q, np.gradient(q, t, axis=0), np.ones_like(q))
    with pytest.raises(RecordingError, match=r"q1 = 0\.7000 m at .* limits of lift's up \(0\.0000 to 0\.6000 m\)"):
        check_plausible(log, lift)


def test_a_joint_that_slides_is_not_asked_to_move_by_half_a_radian(lift):
    t = np.linspace(0.0, 10.0, 1001)
    q = np.stack([0.3 + 0.2 * np.sin(t), 0.1 * np.sin(t)], axis=1)
    dq, ddq = np.gradient(q, t, axis=0), np.stack([-0.2 * np.sin(t), -0.1 * np.sin(t)], axis=1)
    tau = lift.torque(q, dq, ddq) + 0.5 * np.tanh(dq / 0.05)
    said = [line for line in next_steps(learn_profile(lift, [Recording(t, q, dq, tau)]), lift) if "radian" in line]
    assert said == ["joint 2 moved by less than half a radian in all logs: move it further"]


def test_what_is_doubted_of_a_joint_that_slides_is_in_newtons(lift):
    def changed(joint):
        return arm_changed(lift, Drift(np.full(2, 24.0), np.full(2, 0.8), 90.0, joint, True), None)

    assert "the torque's offset differs by +24 N, the friction by +0.8 N;" in changed(0)
    assert "the torque's offset differs by +24 N·m, the friction by +0.8 N·m;" in changed(1)
    assert "that of joint 1, by +5 N from" in torques_drift(lift, 1, 5.0, 1)
    assert "that of joint 2, by +5 N·m from" in torques_drift(lift, 2, 5.0, 1)


def test_what_no_joint_that_slides_can_do_is_said_in_metres_and_newtons(lift):
    def why(q=(0.3, 0.0), dq=(0.0, 0.0), tau=(60.0, 0.0)):
        return Gate(lift).why("implausible", 0.0, q, dq, tau)

    assert why(q=(90.0, 0.0)) == "position of joint 1 is 90 m, beyond its limits"
    assert why(dq=(1e4, 0.0)).startswith("velocity of joint 1 is 1e+04 m/s,")
    assert why(tau=(1e6, 0.0)).startswith("torque of joint 1 is 1e+06 N,")
    assert why(tau=(60.0, 1e6)).startswith("torque of joint 2 is 1e+06 N·m,")


@pytest.mark.parametrize(
    ("speed", "force", "says"),
    [
        (1.0, 3e3, r"\(300 N\): expected joint force in N of lift"),
        (5.0, 60.0, r"dq1 = 5 m/s at .* \(0\.8 m/s\): expected m/s of lift$"),
    ],
)
def test_a_log_beyond_what_a_joint_that_slides_can_do_is_refused_in_its_units(lift, speed, force, says):
    t = np.linspace(0.0, 2.0, 401)
    q = np.stack([0.3 + 0.2 * np.sin(speed / 0.2 * t), np.sin(t)], axis=1)
    dq = np.stack([speed * np.cos(speed / 0.2 * t), np.cos(t)], axis=1)
    tau = np.stack([force + np.sin(t), 0.1 * np.cos(t)], axis=1)
    with pytest.raises(RecordingError, match=says):
        check_plausible(Recording(t, q, dq, tau), lift)


def test_a_joint_that_slides_off_its_path_is_stopped_in_metres_and_newtons(lift):
    motion = StraightMotion(np.array([0.1, 0.0]), np.array([0.4, 0.5]), 3.0)
    course, q = Course(motion, lift.limits), motion.position([0.0])[0]
    still, held = np.zeros(2), lift.torque(q)
    off = Supervision(lift, motion, Thresholds()).problem(
        0.0, Sample(0.0, q + np.array([0.2, 0.0]), still, held), course
    )
    assert off.startswith("up is 0.200 m off the path (more than 0.05 m")
    watch, pushed = Supervision(lift, motion, Thresholds()), held + np.array([500.0, 0.0])
    said = [watch.problem(t, Sample(t, q, still, pushed), course) for t in (0.0, 0.01, 0.03)]
    assert re.match(r"up feels \d+\.\d N beside .* \(more than \d+\.\d N\)", said[-1])
