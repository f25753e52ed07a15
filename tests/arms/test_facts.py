"""The sheets of the built-in arms: complete, with a source each, and the only place that knows an arm by name."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import armload
from armload.app.cli.arguments import built_in_arms
from armload.arms import ARMS, PAYLOAD_REACH, Arm, arm, facts_of, rated_effort, rated_mass, strength
from armload.arms.facts import description_of, read_sheet
from armload.arms.tellable import tellable
from armload.devices import FORMS, Simulator, open_source
from armload.devices.opening import SCHEMES
from armload.errors import ArmError
from armload.identification import identify
from armload.inertia import NAMES, InertialParameters
from armload.motion import excitation, random_motion
from armload.motion.collision import capsule_arm
from armload.payloads import draw_payload, hand_on
from armload.payloads.hand import HAND
from armload.posterior.problem import assumed_gain
from armload.regression import payload_prior_std
from armload.simulation import simulate

SHEET = """
[arm]
product = "a two-joint arm"
joints = 2
source = "ours"
[flange]
frame = "tip"
ending = "tip"
source = "ours"
[payload]
"rated [kg]" = 1.0
source = "ours"
[torque]
side = "link"
source = "ours"
[links]
spread = 1.0
source = "ours"
"""


@pytest.mark.parametrize("name", ARMS)
def test_every_sheet_states_what_is_assumed_of_the_torques_scale_and_answers_allow_for_it(name):
    facts, robot = ARMS[name], arm(name)
    side, other = facts.torque_side, "link" if facts.torque_side == "motor" else "motor"
    assert facts.gain_std == robot.torque_gain_std == assumed_gain(robot, side)
    assert 0.0 < facts.gain_std < 0.1
    calibrated = replace(robot, torque_gain_std=0.1 * facts.gain_std)
    assert assumed_gain(calibrated, side) == 0.1 * facts.gain_std
    assert assumed_gain(calibrated, other) == assumed_gain(replace(robot, torque_gain_std=None), other)


@pytest.mark.parametrize("name", ARMS)
def test_a_sheet_and_its_description_are_of_one_arm(name):
    facts, robot = ARMS[name], arm(name)
    assert (facts.name, facts.joints, facts.flange) == (name, robot.n, robot.frame)
    assert facts.flange.endswith(facts.flange_ending)
    assert facts.scheme is None or facts.scheme in SCHEMES
    assert facts.controller is None or facts.controller in {form.maker for form in FORMS.values()}
    assert f'name="{facts.flange}"' in description_of(name)
    assert facts_of(robot) is facts
    assert excitation(robot).n == robot.n
    if facts.hand == HAND:
        assert hand_on(robot).parameters.frame == facts.flange
    if facts.capsules is not None:
        assert [part.link for part in facts.capsules] == capsule_arm(robot, 0.0).link.tolist()
        assert {part.link for part in facts.capsules} <= set(range(robot.n + 1))


def test_the_command_line_names_the_same_arms():
    assert built_in_arms() == list(ARMS)


def test_an_arm_cut_short_by_its_frame_has_no_figures_per_joint():
    short = arm("panda", frame="panda_link5")
    assert facts_of(short) is None
    assert short.limits.acceleration.tolist() == [15.0, 7.5, 10.0, 12.5, 15.0]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (SHEET.replace('joints = 2\nsource = "ours"', "joints = 2"), r"\[arm\] of the sheet of two has no source"),
        (SHEET.replace('"rated [kg]"', '"rated [lb]"'), r"has 'rated \[lb\]': expected 'rated \[kg\]'"),
        (SHEET.replace("[links]", "[bars]"), r"\[bars\] of the sheet of two has 'spread': expected another table"),
        (SHEET.replace("spread = 1.0\n", ""), r"lacks 'spread' in \[links\]"),
        (SHEET.replace('"link"', '"joint"'), "torque side of the sheet of two is 'joint'"),
        (SHEET + '[current]\n"torque_constants [N·m/A]" = [1.0]\nsource = "ours"', "has 1 entries: expected 2"),
        (SHEET + '[logs]\njoint_names = [["a", "b"], ["a"]]\nsource = "ours"', "has 1 entries: expected 2"),
        ("[arm\n", "is not TOML"),
    ],
)
def test_a_sheet_that_is_not_whole_is_refused_in_a_sentence(wrong, text):
    assert read_sheet("two", SHEET).joints == 2
    with pytest.raises(ArmError, match=text):
        read_sheet("two", wrong)


HELD_EVERYWHERE = {"gen3": 1.1}  # [kg] where the maker's figure is of the middle of the reach only


@pytest.mark.parametrize("name", ARMS)
def test_what_is_assumed_of_an_unrated_arm_lies_within_a_factor_of_two_of_its_maker_s_figure(name):
    known = arm(name)
    assert rated_mass(known) == known.rated_payload
    held = HELD_EVERYWHERE.get(name, known.rated_payload)
    assert 0.5 < rated_mass(replace(known, rated_payload=None)) / held < 2.0
    np.testing.assert_array_equal(rated_effort(known), known.limits.effort)


def horizontal_arm():
    """Two links of 0.3 m that turn about the vertical, of 30 and 15 N·m."""
    inertia = " ".join(f'{k}="{v}"' for k, v in dict(ixx=1e-3, iyy=0.01, izz=0.01, ixy=0, ixz=0, iyz=0).items())
    inertial = f'<inertial><origin xyz="0.15 0 0"/><mass value="1.5"/><inertia {inertia}/></inertial>'
    text = '<robot name="horizontal"><link name="base"/>'
    for k, (parent, at) in enumerate([("base", 0.0), ("link1", 0.3)], start=1):
        text += f"""<link name="link{k}">{inertial}</link><joint name="joint{k}" type="revolute">
            <parent link="{parent}"/><child link="link{k}"/><origin xyz="{at} 0 0"/><axis xyz="0 0 1"/>
            <limit lower="-2" upper="2" effort="{30 / k}" velocity="4"/></joint>"""
    text += """<link name="tool0"/><joint name="flange" type="fixed"><parent link="link2"/><child link="tool0"/>
        <origin xyz="0.3 0 0"/></joint></robot>"""
    return Arm("horizontal", text)


def test_a_horizontal_arm_is_rated_by_what_its_joints_move(monkeypatch):
    moved = 0.5 * 9.81 * (0.3 + PAYLOAD_REACH)  # [N·m/kg] by the second joint, the weaker one in every pose
    assert rated_mass(horizontal_arm()) == pytest.approx(0.7 * 15.0 / moved)
    for name in ARMS:  # of an arm that holds its payload the joints' hold decides
        monkeypatch.setattr(strength, "_MOVED", 1e-6)
        holds = rated_mass(replace(arm(name), rated_payload=None))
        monkeypatch.setattr(strength, "_MOVED", 0.7)
        assert rated_mass(replace(arm(name), rated_payload=None)) == holds


@pytest.mark.parametrize("method", ["map-gp", "wls", "ols"])
def test_a_horizontal_arm_does_not_determine_what_its_torques_do_not_hold(method):
    horizontal = horizontal_arm()
    body = InertialParameters.from_com(1.3, (0.02, -0.03, 0.06), np.diag([4e-3, 3e-3, 2e-3]))
    log = simulate(horizontal, random_motion(horizontal, seed=1), body, rate=200.0)
    found = identify(log, horizontal, method=method)
    assert abs(found.mass - body.mass) < 0.01
    assert found.determined[0]
    assert not found.determined[3:9].any()  # m·rz and the inertia about other axes than the joints'


def test_what_no_motion_of_an_arm_determines_is_said_so_and_no_faster_motion_is_asked_for():
    horizontal, names = horizontal_arm(), np.array(NAMES)
    assert names[tellable(horizontal)].tolist() == ["m", "m·rx", "m·ry", "Izz"]
    assert all(tellable(arm(name)).all() for name in ("panda", "ur10e"))
    body = InertialParameters.from_com(5.0, (0.02, -0.03, 0.06), np.diag([0.02, 0.02, 0.02]))
    log = simulate(horizontal, random_motion(horizontal, seed=1), body, rate=200.0)
    notes = identify(log, horizontal).notes
    assert any(note.startswith("no motion of this arm determines m·rz, Ixx, Ixy, Ixz, Iyy, Iyz:") for note in notes)
    assert not any("move the wrist faster" in note or "this motion does not" in note for note in notes)


def test_a_weighed_mass_that_the_joints_do_not_feel_is_not_called_nothing():
    turntable = Arm("turntable", horizontal_arm().urdf, "link1")
    assert np.array(NAMES)[tellable(turntable)].tolist() == ["Izz"]
    body = InertialParameters.from_com(5.0, (0.02, -0.03, 0.06), np.diag([0.02, 0.02, 0.02]))
    log = simulate(turntable, random_motion(turntable, seed=1), body, rate=200.0)
    found = identify(log, turntable, mass=(5.0, 0.01))
    assert found.mass == pytest.approx(5.0, abs=0.02)
    assert found.why_not_held == "the log does not tell whether anything is held"


def test_one_payload_is_assumed_of_an_unrated_arm_by_the_prior_and_the_simulator_alike():
    unrated = replace(arm("ur10e"), rated_payload=None)
    assert payload_prior_std(unrated)[0] == 0.5 * rated_mass(unrated)
    drawn = draw_payload("boxes", 0, rated=rated_mass(unrated)).parameters
    with open_source("sim", unrated, speed=None, duration=0.01) as source:
        assert isinstance(source, Simulator)
        assert source._payloads[1].mass == drawn.mass


def test_no_module_asks_an_arm_for_its_name():
    for path in Path(armload.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Compare | ast.MatchValue):
                asked = [x.value for x in ast.walk(node) if isinstance(x, ast.Constant) and isinstance(x.value, str)]
                assert not set(asked) & set(ARMS), f"{path}:{node.lineno} compares with {asked}: ask the arm's sheet"
