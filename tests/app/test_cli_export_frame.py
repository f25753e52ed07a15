"""About which frame `armload export` writes for an arm whose URDF has a gripper behind the flange."""

import json
import re

import numpy as np
import pytest

from armload.app.cli import main
from armload.arms import ARMS, Arm, arm, flange_named
from armload.arms.facts import description_of

# where the gripper sits on the flange, and how its tool centre point sits in it: x, y, z [m] and the turn about z [rad]
_MOUNT, _TIP = ((0.01, 0.02, 0.05), 0.7), ((0.0, 0.0, 0.12), 0.5)
_COM, _INERTIA = np.array([0.01, 0.02, 0.08]), np.array([[0.01, 1e-3, 0.0], [1e-3, 0.012, 5e-4], [0.0, 5e-4, 8e-3]])
_FINGER = """
  <joint name="finger_joint" type="prismatic"><origin xyz="0 0.03 0.1"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="20" velocity="0.2"/><parent link="gripper"/><child link="finger"/></joint>
  <link name="finger"/>
</robot>"""


def with_gripper(name, tip, finger=False, prefix=""):
    """The URDF of a built-in arm with a gripper behind its flange, whose last link is `tip`, or a finger."""
    flange = ARMS[name].flange

    def fixed(parent, child, place):
        (x, y, z), turn = place
        return (
            f'<joint name="{child}_joint" type="fixed"><origin xyz="{x} {y} {z}" rpy="0 0 {turn}"/>'
            f'<parent link="{parent}"/><child link="{child}"/></joint>'
        )

    body = '<inertial><mass value="0.9"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
    gripper = (
        f'<link name="gripper">{body}</link><link name="{tip}"/>'
        f"{fixed(flange, 'gripper', _MOUNT)}{fixed('gripper', tip, _TIP)}"
    )
    whole = description_of(name).rstrip().removesuffix("</robot>") + gripper + (_FINGER if finger else "</robot>")
    return re.sub(rf'(name|link)="{flange}"', rf'\1="{prefix}{flange}"', whole)


def in_flange(com, inertia):
    """A body about the tip as the flange sees it."""
    for (x, y, z), turn in (_TIP, _MOUNT):
        R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        com, inertia = R @ com + (x, y, z), R @ inertia @ R.T
    return com, inertia


def numbers(text):
    """Mass, centre and inertia that a UR is told."""
    call = re.search(r"set_target_payload\((.*)\)", text).group(1)
    mass, *rest = json.loads(f"[{call}]")
    xx, yy, zz, xy, xz, yz = rest[1]
    return mass, np.array(rest[0]), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.fixture
def export(tmp_path, capsys):
    """Run the command on a payload about a frame and a URDF: export(frame, urdf, *arguments) -> (stdout, stderr)."""

    def call(frame, urdf, *arguments, code=0):
        held = {"mass": 2.0, "com": _COM.tolist(), "inertia_com": _INERTIA.tolist()}
        (tmp_path / "held.json").write_text(json.dumps(held | ({} if frame is None else {"frame": frame})))
        (tmp_path / "cell.urdf").write_text(urdf)
        named = ["--robot", str(tmp_path / "cell.urdf")]
        assert main(["export", str(tmp_path / "held.json"), *named, *arguments]) == code
        return capsys.readouterr()

    return call


@pytest.mark.parametrize("prefix", ["", "left_"])
@pytest.mark.parametrize(("tip", "finger"), [("gripper_tcp", False), ("gripper_tcp", True), ("gripper_tool0", False)])
def test_a_controller_gets_its_flange_whatever_is_mounted_behind_it(export, tip, finger, prefix):
    urdf, flange = with_gripper("ur10e", tip, finger, prefix), f"{prefix}tool0"
    if (tip, prefix) == ("gripper_tool0", "left_"):  # two links that may be the flange
        _, err = export(flange, urdf, "--to", "ur", code=2)
        assert "name its flange with --frame" in err
        return
    for frame, (com, inertia) in ((flange, (_COM, _INERTIA)), (tip, in_flange(_COM, _INERTIA))):
        out, err = export(frame, urdf, "--to", "ur")
        assert f"payload about {flange}\n" in out
        assert err == ""
        found = numbers(out)
        assert found[0] == pytest.approx(2.0)
        np.testing.assert_allclose(found[1], com, atol=1e-9)
        np.testing.assert_allclose(found[2], inertia, atol=1e-9)


@pytest.mark.parametrize("finger", [False, True])
@pytest.mark.parametrize(
    ("name", "to"),
    [
        ("panda", "franka"),
        ("fr3", "franka-desk"),
        ("ur5e", "ur-payload"),
        ("iiwa14", "kuka"),
        ("gen3", "kinova"),
        ("xarm7", "xarm"),
    ],
)
def test_every_maker_s_flange_is_found_in_a_urdf_with_a_gripper(export, name, to, finger):
    of_flange = export(ARMS[name].flange, description_of(name), "--to", to).out
    assert export(ARMS[name].flange, with_gripper(name, "tcp", finger), "--to", to).out == of_flange


def test_a_payload_without_a_frame_is_said_to_be_taken_about_the_flange_or_the_last_link(export):
    urdf = with_gripper("ur10e", "gripper_tcp")
    out, err = export(None, urdf, "--to", "ur")
    np.testing.assert_allclose(numbers(out)[1], _COM, atol=1e-12)
    assert "names no frame: it is taken to be about tool0" in err
    out, err = export(None, urdf, "--to", "urdf")
    assert '<parent link="gripper_tcp" />' in out
    assert "names no frame: it is taken to be about gripper_tcp" in err


def test_a_link_that_is_only_called_like_a_flange_is_written_about_where_asked_for_and_said(export):
    out, err = export("tool0", with_gripper("ur10e", "gripper_tool0"), "--to", "ur", "--frame", "gripper_tool0")
    assert "payload about gripper_tool0" in out
    assert "these numbers are about gripper_tool0, as was asked for" in err


def test_an_arm_whose_flange_has_another_name_is_refused_with_its_links(export):
    urdf = description_of("ur10e").replace('"tool0"', '"mounting_plate"')
    _, err = export("mounting_plate", urdf, "--to", "ur", code=2)
    assert "name its flange with --frame, one of base_link" in err
    out, err = export("mounting_plate", urdf, "--to", "ur", "--frame", "mounting_plate")
    np.testing.assert_allclose(numbers(out)[1], _COM, atol=1e-12)
    assert "these numbers are about mounting_plate" in err


def test_a_description_that_ends_in_two_fingers_is_read_about_what_was_identified(export):
    fingers = "".join(
        f'<link name="{name}"/><joint name="{name}_joint" type="prismatic"><parent link="gripper_tcp"/>'
        f'<child link="{name}"/><axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="20" velocity="1"/></joint>'
        for name in ("left", "right")
    )
    urdf = with_gripper("ur10e", "gripper_tcp").replace("</robot>", fingers + "</robot>")
    out, _ = export("tool0", urdf, "--to", "ur")
    np.testing.assert_allclose(numbers(out)[1], _COM, atol=1e-12)
    _, err = export(None, urdf, "--to", "ur", code=2)
    assert "'left' and 'right' among them: name the link" in err


def test_of_two_arms_in_a_file_the_flange_beside_the_payload_is_meant():
    text = description_of("ur5e").rstrip().removesuffix("</robot>")
    inside = text[text.index(">", text.index("<robot")) + 1 :]
    sides = [re.sub(r'(name|link)="', rf'\1="{side}_', inside) for side in ("left", "right")]
    joints = "".join(
        f'<joint name="{side}_place" type="fixed"><origin xyz="0 {y} 0"/><parent link="table"/>'
        f'<child link="{side}_{arm("ur5e").frames[0]}"/></joint>'
        for side, y in (("left", 0.5), ("right", -0.5))
    )
    both = f'<robot name="both"><link name="table"/>{"".join(sides)}{joints}</robot>'
    for side in ("left", "right"):
        chosen = Arm("both", both, f"{side}_tool0")
        assert flange_named(chosen, ARMS.values(), f"{side}_wrist_3_link") == f"{side}_tool0"
        assert flange_named(chosen, ARMS.values()) is None
