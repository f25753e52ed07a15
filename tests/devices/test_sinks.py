"""An exported payload is the same body in the tool that reads it, and nothing doubtful reaches a robot."""

import ast
import itertools
import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from armload.arms import ARMS, Arm, arm, momentum_regressor
from armload.devices import (
    FORMS,
    Load,
    about,
    check_writable,
    export_load,
    flange_of,
    franka_load,
    is_moving,
    read_load,
    ur_payload,
)
from armload.devices.franka import writer as franka_robot
from armload.devices.kuka.form import kuka_load
from armload.devices.load_remarks import HARDLY_KNOWN, leaning
from armload.devices.ur import writer as ur_robot
from armload.errors import ArmError, ArmloadError, InertiaError, PayloadError, SinkError
from armload.identification import Identification
from armload.identification.answer import Segment
from armload.identification.intervals import intervals
from armload.inertia import NAMES, InertialParameters, inertia_com_std, is_consistent
from armload.payloads import INERTIA_ASSUMED, franka_hand, hand_on, random_payload, test_payload, write_payload
from armload.payloads.uncertainty import Uncertainty

FLANGES = {
    "panda": "panda_link8",
    "fr3": "fr3_link8",
    **dict.fromkeys(("ur3e", "ur5", "ur5e", "ur10", "ur10e", "ur16e", "ur20"), "tool0"),
    **dict.fromkeys(("iiwa7", "iiwa14"), "lbr_link_ee"),
    "gen3": "end_effector_link",
    "xarm7": "link_eef",
}


def rotation_of(axis, angle):
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


# three different moments in axes that are parallel to no axis of the frame: nothing is equal by symmetry
TURN = rotation_of((1.0, -2.0, 0.5), 0.9)
MASS, COM = 1.3, np.array([0.031, -0.047, 0.083])
INERTIA = TURN @ np.diag([4e-3, 7e-3, 9e-3]) @ TURN.T  # about the centre of mass


def skew_body(frame="panda_link8"):
    return InertialParameters.from_com(MASS, COM, INERTIA, frame)


def assert_is_the_body(mass, com, inertia, parameters=None, atol=1e-12):
    """Compare with figures about the centre of mass, by default those this file starts from."""
    expected = (MASS, COM, INERTIA)
    if parameters is not None:
        m, h = parameters.phi[0], parameters.phi[1:4]
        r = h / m
        expected = m, r, parameters.inertia - m * (r @ r * np.eye(3) - np.outer(r, r))
    np.testing.assert_allclose(mass, expected[0], rtol=0, atol=atol)
    np.testing.assert_allclose(com, expected[1], rtol=0, atol=atol)
    np.testing.assert_allclose(inertia, expected[2], rtol=0, atol=atol)


def six(xx, xy, xz, yy, yz, zz):
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


# ---------------------------------------------------------------------- Franka


def run_franka_text(text):
    """What the exported Python sends to a robot."""
    calls = []
    exec(text, {"robot": SimpleNamespace(set_load=lambda *a: calls.append(a))})
    (arguments,) = calls
    return arguments


def test_the_franka_text_calls_set_load_with_the_load():
    mass, com, nine = run_franka_text(export_load(Load(skew_body()), "franka"))
    assert_is_the_body(mass, com, np.array(nine).reshape(3, 3))
    assert tuple(franka_load(skew_body())) == (mass, com, nine)


@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_franka_s_load_gives_the_torque_of_the_momentum_regressor(robot):
    # Pinocchio carries the nine numbers at the flange; the regressor, written from scratch, carries phi
    bare = arm(robot)
    load = skew_body(bare.frame)
    mass, com, nine = franka_load(load)
    model = pin.buildModelFromXML(bare.urdf)
    flange = model.frames[model.getFrameId(bare.frame)].placement
    loaded = model.copy()
    loaded.appendBodyToJoint(
        model.njoints - 1, pin.Inertia(mass, np.array(com), np.reshape(nine, (3, 3), order="F")), flange
    )
    rng, h = np.random.default_rng(2), 1e-3
    q0, w = rng.uniform(-1.5, 1.5, 7), rng.uniform(1.0, 2.0, 7)

    def motion(t):
        t = np.atleast_1d(t)[:, None]
        return q0 + 0.4 * np.sin(w * t), 0.4 * w * np.cos(w * t), -0.4 * w**2 * np.sin(w * t)

    stencil, weights = np.array([-3, -2, -1, 1, 2, 3]), np.array([-1, 9, -45, 45, -9, 1]) / (60 * h)
    for t in (0.2, 0.9, 2.3):
        q, dq, ddq = (x[0] for x in motion(t))
        Q, dQ, _ = motion(t + h * stencil)
        momentum = momentum_regressor(bare.frame_motion(Q), dQ).momentum @ load.phi
        drift = momentum_regressor(bare.frame_motion(q[None]), dq[None]).drift[0] @ load.phi
        added = pin.rnea(loaded, loaded.createData(), q, dq, ddq) - pin.rnea(model, model.createData(), q, dq, ddq)
        np.testing.assert_allclose(weights @ momentum + drift, added, atol=1e-8)


def test_a_franka_load_measured_in_a_turned_frame_is_told_in_the_flange_s():
    # an inertia is symmetric and cannot show whether a matrix was read by rows or by columns; the turn can:
    # R and its transpose give different inertias in the flange
    R, p = rotation_of((0.2, 1.0, -0.7), 1.1), np.array([0.01, -0.02, 0.05])
    rpy = pin.rpy.matrixToRpy(R)
    tool = f'<link name="tool"/><joint name="tool_joint" type="fixed"><origin xyz="{p[0]} {p[1]} {p[2]}" '
    tool += f'rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/><parent link="panda_link8"/><child link="tool"/></joint></robot>'
    panda = Arm("panda", arm("panda").urdf.replace("</robot>", tool), "tool", rated_payload=3.0, known_as="panda")
    load = franka_load(check_writable(Load(skew_body("tool")), panda, moving=False, write=True))
    np.testing.assert_allclose(load.com, R @ COM + p, atol=1e-12)
    np.testing.assert_allclose(np.reshape(load.inertia, (3, 3)), R @ INERTIA @ R.T, atol=1e-12)
    assert np.abs(R @ INERTIA @ R.T - R.T @ INERTIA @ R).max() > 1e-3


def test_desk_s_end_effector_has_the_keys_of_the_public_example_and_its_matrices_by_columns():
    text = export_load(Load(skew_body()), "franka-desk")
    read = json.loads(text)
    # frankaemika/external_gripper_example, endeffector-config.json
    example = {"mass": 0.9, "centerOfMass": [0] * 3, "transformation": [0] * 16, "inertia": [0] * 9}
    assert {k: np.shape(v) for k, v in read.items()} == {k: np.shape(v) for k, v in example.items()}
    assert_is_the_body(read["mass"], read["centerOfMass"], np.reshape(read["inertia"], (3, 3), order="F"))
    np.testing.assert_array_equal(np.reshape(read["transformation"], (4, 4)), np.eye(4))  # the flange itself


# ---------------------------------------------------------------------- Universal Robots


def read_script(text, function):
    """The arguments of the one call in a URScript, read by its own grammar: no exponents, # begins a comment."""
    lines = [line.split("#")[0].strip() for line in text.splitlines()]
    (call,) = [line for line in lines if line]
    name, arguments = re.fullmatch(r"(\w+)\(([-0-9., \[\]]*)\)", call).groups()
    assert name == function
    return ast.literal_eval(f"({arguments})")


def test_set_target_payload_has_the_order_of_the_manual():
    m, cog, inertia = read_script(export_load(Load(skew_body("tool0")), "ur"), "set_target_payload")
    xx, yy, zz, xy, xz, yz = inertia  # URScript manual: [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]
    assert_is_the_body(m, cog, six(xx, xy, xz, yy, yz, zz))
    assert (m, cog, inertia) == tuple(ur_payload(skew_body("tool0")))


def test_set_payload_has_mass_and_centre():
    m, cog = read_script(export_load(Load(skew_body("tool0")), "ur-payload"), "set_payload")
    assert_is_the_body(m, cog, INERTIA)


def test_an_iiwa_s_load_data_are_in_millimetres_and_about_the_principal_axes():
    text = export_load(Load(skew_body("lbr_link_ee")), "kuka")
    numbers = {
        name: [float(x) for x in re.findall(r"-?[0-9.]+(?:e-?[0-9]+)?", re.search(rf"{where}", text)[1])]
        for name, where in {
            "mass": r"setMass\((.*)\);",
            "com": r"setCenterOfMass\((.*)\);",
            "axes": r"axes (A .*) \[deg\]",
            "moments": r"moments (JX .*) \[kg",
        }.items()
    }
    a, b, c = (np.radians(x) for x in numbers["axes"])
    R = rotation_of((0, 0, 1), a) @ rotation_of((0, 1, 0), b) @ rotation_of((1, 0, 0), c)  # each about the new axis
    inertia = R @ np.diag(numbers["moments"]) @ R.T
    assert_is_the_body(numbers["mass"][0], np.array(numbers["com"]) / 1e3, inertia, atol=1e-9)


def test_the_principal_axes_of_an_iiwa_s_load_are_those_nearest_to_the_flange_s():
    straight = InertialParameters.from_com(1.0, (0.0, 0.0, 0.1), np.diag([3e-3, 1e-3, 2.5e-3]))
    assert kuka_load(straight).axes == [0.0, 0.0, 0.0]
    assert kuka_load(straight).moments == [3e-3, 1e-3, 2.5e-3]
    for seed in range(50):
        turned = np.abs(kuka_load(random_payload(seed).parameters).axes)
        assert turned.max() < 90.0


def test_a_gen3_s_tool_and_an_xarm_s_load_are_everything_on_the_flange():
    tool, sent = SimpleNamespace(tool_mass_center=SimpleNamespace()), []
    config = SimpleNamespace(GetToolConfiguration=lambda: tool, SetToolConfiguration=sent.append)
    exec(export_load(Load(skew_body("end_effector_link")), "kinova"), {"control_config": config})
    assert sent == [tool]
    assert_is_the_body(tool.tool_mass, [getattr(tool.tool_mass_center, axis) for axis in "xyz"], INERTIA)
    xarm = SimpleNamespace(set_tcp_load=lambda mass, com: sent.append((mass, np.array(com) / 1e3)))
    exec(export_load(Load(skew_body("link_eef")), "xarm"), {"arm": xarm})
    assert_is_the_body(*sent[-1], INERTIA)


def test_urscript_has_no_exponents():
    speck = InertialParameters.from_com(2e-5, (1e-6, -3e-5, 0.0), 1e-9 * np.diag([1.0, 1.2, 1.4]), "tool0")
    m, cog, inertia = read_script(export_load(Load(speck), "ur"), "set_target_payload")
    assert_is_the_body(m, cog, np.diag(inertia[:3]), speck, atol=1e-13)


# ---------------------------------------------------------------------- robot descriptions


def with_urdf(an_arm, text):
    """An arm's URDF with the children of an exported one copied into it."""
    root = ET.fromstring(an_arm.urdf)
    root.extend(ET.fromstring(text))
    return ET.tostring(root, encoding="unicode")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("robot", sorted(ARMS))
def test_urdf_in_pinocchio_and_mujoco_is_the_arm_with_the_payload(robot, seed):
    bare = arm(robot)
    load = InertialParameters(random_payload(seed=seed).parameters.phi, FLANGES[robot])
    text = with_urdf(bare, export_load(Load(load), "urdf"))
    model = pin.buildModelFromXML(text)
    theirs = mujoco.MjModel.from_xml_string(text)
    theirs.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, other = model.createData(), mujoco.MjData(theirs)
    ours = bare.with_payload(load)
    rng = np.random.default_rng(seed)
    for q, dq, ddq in rng.uniform(-2, 2, (5, 3, bare.n)):
        other.qpos[:], other.qvel[:], other.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(theirs, other)
        expected = ours.torque(q, dq, ddq)
        np.testing.assert_allclose(pin.rnea(model, data, q, dq, ddq), expected, atol=1e-9)
        np.testing.assert_allclose(other.qfrc_inverse, expected, atol=1e-9)


def test_urdf_alone_is_the_body_pinocchio_reads():
    text = export_load(Load(skew_body()), "urdf").replace("</robot>", '<link name="panda_link8"/></robot>')
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    body = model.inertias[1]
    assert_is_the_body(body.mass, body.lever, body.inertia)


def test_mjcf_in_mujoco_is_the_body():
    model = mujoco.MjModel.from_xml_string(export_load(Load(skew_body()), "mjcf", name="gripper"))
    k = model.body("gripper").id
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[k])
    R = turn.reshape(3, 3)
    assert_is_the_body(model.body_mass[k], model.body_ipos[k], R @ np.diag(model.body_inertia[k]) @ R.T)


def test_mjcf_attaches_to_an_arm():
    panda = arm("panda")
    child = mujoco.MjSpec.from_string(export_load(Load(skew_body()), "mjcf"))
    spec = mujoco.MjSpec.from_string(panda.urdf)
    frame = spec.body("panda_link8").add_frame()
    frame.attach_body(child.body("payload"), "held_", "")
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    q, dq, ddq = np.random.default_rng(1).uniform(-1, 1, (3, 7))
    data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(data.qfrc_inverse, panda.with_payload(skew_body()).torque(q, dq, ddq), atol=1e-9)


def test_sdf_reads_as_the_format_s_specification_says():
    root = ET.fromstring(export_load(Load(skew_body()), "sdf"))
    assert root.tag == "sdf"
    assert root.get("version") == "1.7"
    (inertial,) = root.findall("./model/link/inertial")
    assert [e.tag for e in inertial] == ["pose", "mass", "inertia"]
    pose = [float(x) for x in inertial.findtext("pose").split()]
    assert pose[3:] == [0, 0, 0]  # the inertia's axes are the link's
    entries = {e.tag: float(e.text) for e in inertial.find("inertia")}
    assert sorted(entries) == ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
    inertia = six(*(entries[k] for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")))
    assert_is_the_body(float(inertial.findtext("mass")), pose[:3], inertia)


@pytest.mark.full
@pytest.mark.parametrize("form", ["sdf", "urdf"])
def test_drake_reads_the_body(form):
    # Drake's parser of SDF is libsdformat, the format's own
    pytest.importorskip("pydrake", reason="Drake is not installed (pip install drake)")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    text = export_load(Load(skew_body()), form)
    if form == "urdf":
        text = text.replace("</robot>", '<link name="panda_link8"/></robot>')
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, form)
    plant.Finalize()
    body = plant.GetBodyByName("payload").default_spatial_inertia()
    about_com = body.CalcRotationalInertia().CopyToFullMatrix3()
    r = body.get_com()  # Drake gives it about the link's origin
    about_com = about_com - body.get_mass() * (r @ r * np.eye(3) - np.outer(r, r))
    assert_is_the_body(body.get_mass(), r, about_com)


# ---------------------------------------------------------------------- ROS 2


def test_every_number_of_ros2_yaml_is_a_number_to_a_reader_of_yaml_1_1():
    light = InertialParameters.from_com(2e-3, (1e-5, -3e-5, 0.0), np.diag([5e-6, 6e-6, 7e-6]), "tool0")
    reader = YAML(typ="safe")
    reader.version = (1, 1)
    inertia = reader.load(export_load(Load(light), "ros2"))["inertia"]
    com = inertia.pop("com")
    assert list(com.values()) == pytest.approx(light.com)
    assert list(inertia.values()) == pytest.approx([2e-3, 5e-6, 0.0, 0.0, 6e-6, 0.0, 7e-6])


def test_ros2_yaml_is_an_inertia_stamped_message():
    store = get_typestore(Stores.ROS2_HUMBLE)
    read = YAML(typ="safe").load(export_load(Load(skew_body()), "ros2"))
    kinds = {name: store.types[f"geometry_msgs/msg/{name}"] for name in ("InertiaStamped", "Inertia", "Vector3")}
    stamp = store.types["builtin_interfaces/msg/Time"](**read["header"].pop("stamp"))
    header = store.types["std_msgs/msg/Header"](stamp=stamp, **read.pop("header"))
    com = kinds["Vector3"](**read["inertia"].pop("com"))
    message = kinds["InertiaStamped"](header=header, inertia=kinds["Inertia"](com=com, **read.pop("inertia")))
    assert not read
    name = "geometry_msgs/msg/InertiaStamped"
    back = store.deserialize_cdr(store.serialize_cdr(message, name), name)
    i = back.inertia
    assert back.header.frame_id == "panda_link8"
    assert_is_the_body(i.m, (i.com.x, i.com.y, i.com.z), six(i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz))


# ---------------------------------------------------------------------- what is exported


def identification(parameters, robot="panda", relative_to="arm", determined=(True,) * 10, **other):
    """A result as `identify` gives it, of the given numbers."""
    phi = parameters.phi
    return Identification(
        method="map",
        robot=robot,
        frame=parameters.frame,
        relative_to=relative_to,
        n_samples=600,
        duration=6.0,
        phi=phi,
        interval="approximate",
        determined=np.array(determined),
        mass=parameters.mass,
        com=parameters.com,
        inertia_com=parameters.inertia_com,
        consistent=other.pop("consistent", is_consistent(phi)),
        held=True,
        rests_on_prior=np.array(other.pop("rests_on_prior", (False,) * 10)),
        **intervals(phi, phi - 0.02, phi + 0.02, np.eye(10))._asdict(),
    )


def test_a_saved_identification_reads_as_its_load(tmp_path):
    result = identification(skew_body(), relative_to="tare", determined=[True] * 4 + [False] * 6)
    path = tmp_path / "held.json"
    path.write_text(json.dumps(result.to_dict()))
    for load in (read_load(path), Load.of(result)):
        np.testing.assert_array_equal(load.parameters.phi, skew_body().phi)
        assert (load.frame, load.robot, load.relative_to) == ("panda_link8", "panda", "tare")
        assert load.undetermined == ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
        np.testing.assert_allclose(load.std, 0.02 / 1.96, rtol=1e-4)


@pytest.mark.parametrize("key", ["phi_low", "inertia_com_low"])
def test_a_result_whose_interval_nobody_can_hold_is_a_load_without_it(tmp_path, key):
    result = identification(skew_body()).to_dict()
    (tmp_path / "held.json").write_text(json.dumps(result | {key: [10**400] * 10}))
    load = read_load(tmp_path / "held.json")
    np.testing.assert_array_equal(load.parameters.phi, skew_body().phi)
    assert (load.std is None) == (key == "phi_low")


def test_a_payload_file_is_a_load_that_is_known(tmp_path):
    write_payload(tmp_path / "hand.json", franka_hand())
    load = read_load(tmp_path / "hand.json")
    assert all(load.determined)
    assert load.robot is None
    np.testing.assert_array_equal(load.parameters.phi, franka_hand().parameters.phi)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"determined": [True] * 9}, "determined is .* expected 10 times true or false"),
        ({"determined": [1] * 10}, "determined is .* expected 10 times true or false"),
        ({"robot": 7}, "robot is 7, expected text"),
        ({"phi": [-1.0] + [0.0] * 9, "mass": None}, "mass of -1 kg: expected a mass above 0"),
    ],
)
def test_malformed_results_are_refused(tmp_path, change, says):
    path = tmp_path / "held.json"
    path.write_text(json.dumps(identification(skew_body()).to_dict() | change))
    with pytest.raises((SinkError, PayloadError), match=says):
        read_load(path)


@pytest.mark.parametrize("form", [name for name, form in FORMS.items() if not form.inertia])
def test_a_text_without_inertia_says_nothing_of_it(form):
    leaning = "rests on what payloads are usually like more than on the log"
    remarks = (f"{leaning}: m·rz, Ixy", f"{HARDLY_KNOWN}: Ixx", INERTIA_ASSUMED, "weighed")
    text = export_load(Load(skew_body(), (True,) * 4 + (False,) * 6, "ur5e", "arm", remarks=remarks), form)
    assert f"{leaning}: m·rz\n" in text
    assert "weighed" in text
    assert not any(word in text for word in ("Ixx", "Ixy", "inertia", "not determined"))


@pytest.mark.parametrize("form", [name for name, form in FORMS.items() if form.inertia and name != "franka-desk"])
def test_every_text_says_what_was_not_determined(form):
    load = Load(skew_body(), (True,) * 4 + (False,) * 6, "panda", "arm")
    text = export_load(load, form)
    assert "payload of panda about panda_link8, relative to the arm" in text
    assert "not determined by the log: Ixx, Ixy, Ixz, Iyy, Iyz, Izz" in text
    assert "not determined" not in export_load(Load(skew_body()), form)


@pytest.mark.parametrize("form", [name for name in FORMS if name != "franka-desk"])
def test_a_text_says_that_its_intervals_are_approximate_and_that_nothing_seems_to_be_held(form, tmp_path):
    path, light = tmp_path / "held.json", InertialParameters(0.01 * skew_body().phi, "panda_link8")
    for body, interval in ((skew_body(), "calibrated"), (skew_body(), "approximate"), (light, "approximate")):
        result = replace(identification(body), interval=interval)
        path.write_text(json.dumps(result.to_dict()))
        for load in (Load.of(result), read_load(path)):
            text = export_load(load, form)
            assert ("approximate, not calibrated" in text) == (interval == "approximate")
            assert ("nothing seems to be held" in text) == (body is light)
            assert "nothing seems" not in export_load(load + franka_hand().parameters, form)


@pytest.mark.parametrize("form", [name for name in FORMS if name != "franka-desk"])
def test_a_text_says_that_the_payload_changed_within_its_log(form, tmp_path):
    path, one = tmp_path / "held.json", identification(skew_body())
    first, last = Segment(0.0, 3.0, one), Segment(3.0, 6.0, one)
    for segments in ((last,), (first, last)):
        result = replace(one, segments=segments)
        path.write_text(json.dumps(result.to_dict()))
        for load in (Load.of(result), read_load(path)):
            said = "the payload changed within the log: this is the last of 2, held at the end"
            assert (said in export_load(load, form)) == (len(segments) == 2)


@pytest.mark.parametrize("form", ["urdf", "mjcf", "sdf"])
def test_names_cannot_break_a_description(form):
    load = Load(skew_body('a"<b>&--c'), (False,) * 10, "--><evil/>\n", "arm")
    root = ET.fromstring(export_load(load, form, name='p"<q>'))
    assert root.find(".//evil") is None


@pytest.mark.parametrize("hyphens", [2, 3, 4, 5])
def test_hyphens_of_a_frame_end_no_comment(hyphens):
    root = ET.fromstring(export_load(Load(skew_body("a" + "-" * hyphens)), "urdf"))
    assert root.find("joint/parent").get("link") == "a" + "-" * hyphens


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("character", ["\x1b", "\0", "\ud800", "\uffff"])
def test_a_name_or_frame_that_no_xml_holds_is_refused_by_it(form, character):
    with pytest.raises(SinkError, match=r"the frame is 'a.*expected letters and digits"):
        export_load(Load(skew_body(f"a{character}")), form)
    with pytest.raises(SinkError, match=r"the name is 'b.*expected letters and digits"):
        export_load(Load(skew_body("a")), form, name=f"b{character}")


def test_a_robot_s_name_cannot_break_out_of_a_comment():
    text = export_load(Load(skew_body(), robot="x\nimport os"), "franka")
    assert [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import)] == []


def test_a_line_s_end_as_java_writes_it_ends_no_comment():
    """Java reads it before it reads comments (The Java Language Specification, 3.3)."""
    text = export_load(Load(skew_body("x\\u000aSystem.exit(0); //")), "kuka")
    assert "\\" not in text
    assert "x/u000aSystem.exit(0); //" in text.splitlines()[0]


def test_what_was_measured_minus_the_hand():
    hand, held = franka_hand().parameters, test_payload().parameters
    measured = Load.of(identification(InertialParameters(held.phi, "panda_link8") + hand))
    part = measured - hand
    np.testing.assert_allclose(part.parameters.phi, held.phi, atol=1e-15)
    assert part.relative_to == "tool"
    assert (part + hand).relative_to == "arm"
    np.testing.assert_allclose((part + hand).parameters.phi, measured.parameters.phi, atol=1e-15)
    with pytest.raises(InertiaError, match="cannot be combined"):
        measured - InertialParameters(hand.phi, "panda_hand")


def test_the_hand_taken_off_twice_is_refused_where_no_body_is_left_and_only_there():
    hand, held = franka_hand().parameters, InertialParameters(test_payload().parameters.phi, "panda_link8")
    once = Load.of(identification(held + hand)) - hand
    light = Load.of(identification(InertialParameters(0.3 * held.phi, held.frame) + hand)) - hand
    with pytest.raises(
        SinkError, match=r"mass of -0\.286 kg and is no body: relative to the tool.* do not take it off"
    ):
        light - hand
    assert (once - InertialParameters(0.4 * held.phi, held.frame)).consistent  # another part that is in it
    for relative_to in ("tare", "before"):
        with pytest.raises(SinkError, match="what was mounted then is not in it"):
            Load(InertialParameters(0.9 * hand.phi, hand.frame), relative_to=relative_to) - hand


def test_what_is_left_within_the_error_bars_of_a_body_is_left():
    hand = franka_hand().parameters
    rod = InertialParameters.from_com(0.4, (0, 0, 0.1), np.diag([3e-3, 3e-3, 1e-5]), "panda_link8")
    off = np.zeros(10)
    off[9] = -2e-5  # the rod is turned more easily than anything can be
    measured = InertialParameters((rod + hand).phi + off, "panda_link8")
    near = Load(measured, relative_to="tare", std=np.full(10, 2e-5)) - hand
    assert not near.consistent
    assert near.as_body().consistent
    with pytest.raises(SinkError, match="is no body"):
        Load(measured, relative_to="tare", std=np.full(10, 1e-7)) - hand
    with pytest.raises(SinkError, match="is no body"):
        Load(measured, relative_to="tare") - hand
    assert not (Load(measured, relative_to="arm") - hand).consistent  # as_body may mend it


def test_moments_that_a_part_leaves_smaller_than_their_intervals_are_said_to_be_hardly_known(tmp_path):
    hand = franka_hand().parameters
    whole = skew_body() + hand
    half = 0.5 * np.diag(INERTIA) * (1.1, 0.9, 1.1)  # of the interval of each moment
    assert np.all(np.diag(whole.inertia_com) > 2 * half)
    low, high = (whole.inertia_com + sign * np.diag(half) for sign in (-1, 1))
    spread = np.zeros((10, 10))
    spread[[4, 7, 9], [4, 7, 9]] = (half / 1.96) ** 2
    result = replace(identification(whole), inertia_com_low=low, inertia_com_high=high, covariance=spread)
    (tmp_path / "held.json").write_text(json.dumps(result.to_dict()))
    for load in (Load.of(result), read_load(tmp_path / "held.json")):
        assert HARDLY_KNOWN not in export_load(load, "franka")
        left = load - hand
        assert f"{HARDLY_KNOWN}: Ixx, Izz" in export_load(left, "franka")
        assert HARDLY_KNOWN not in export_load(left + hand, "franka")


def test_a_load_and_a_measured_part_are_as_uncertain_as_both_and_lack_what_either_lacks():
    std = np.array([0.03, *[1e-3] * 9])
    whole = Load(InertialParameters([0.12, *[0.0] * 3, 1e-4, 0, 0, 1e-4, 0, 1e-4]), std=std, relative_to="arm")
    part = Load(
        InertialParameters([0.02, *[0.0] * 3, 1e-5, 0, 0, 1e-5, 0, 1e-5]),
        std=std,
        determined=tuple([True] * 9 + [False]),
    )
    rng = np.random.default_rng(0)
    drawn = rng.normal(scale=std, size=(20_000, 10)) - rng.normal(scale=std, size=(20_000, 10))
    for both in (whole - part, whole + part):
        np.testing.assert_allclose(both.std, drawn.std(axis=0), rtol=0.03)
        assert both.undetermined == ("Izz",)
        assert "not determined by the log: Izz" in export_load(replace(both, parameters=skew_body()), "franka")
    assert not whole.seems_nothing
    assert (whole - part).seems_nothing  # 0.10 kg, three deviations of the two: 0.127 kg


def test_moments_of_what_was_put_together_are_as_uncertain_as_draws_of_its_parts_are():
    held = InertialParameters.from_com(0.8, (0.03, 0.0, 0.14), np.diag([1e-3, 1.2e-3, 0.8e-3]), "panda_link8")
    hand = franka_hand().parameters
    # an error of the centre hardly shows in the inertia about it, until something else moves the centre
    spread = Uncertainty(mass=0.06, com=0.025, inertia=0.1).covariance(held)
    result = replace(
        identification(held, relative_to="tare"),
        covariance=spread,
        inertia_com_low=held.inertia_com - 2e-4,
        inertia_com_high=held.inertia_com + 2e-4,
    )
    measured = Load.of(result)
    assert not any(HARDLY_KNOWN in remark for remark in measured.remarks)
    panda = arm("panda")
    for load in (measured + hand, (measured + hand).about("panda_link7", panda)):
        drawn = (
            np.random.default_rng(1).multivariate_normal(held.phi, 1e-4 * spread, 4000) + hand.phi
        )  # small: first order
        moments = np.array([np.diag(InertialParameters(phi).inertia_com) for phi in drawn])
        wide = 2 * 1.96 * 100 * moments.std(axis=0)
        np.testing.assert_allclose(
            2 * 1.96 * inertia_com_std(load.parameters.phi, load.covariance)[[0, 3, 5]], wide, rtol=0.1
        )
        assert np.array_equal(wide > np.diag((held + hand).inertia_com), [True, True, False])
        assert f"{HARDLY_KNOWN}: Ixx, Iyy" in load.remarks


def test_a_part_says_how_well_it_is_known(tmp_path):
    tool = {"mass": 0.7, "com": [0, 0, 0.05], "inertia_com": np.diag([1e-3, 1.2e-3, 1.5e-3]).tolist()}
    (tmp_path / "tool.json").write_text(json.dumps(tool | {"std": {"mass": 0.02, "inertia": 0.4}}))
    load = read_load(tmp_path / "tool.json")
    assert load.std is not None
    # moments of 1, 1.2 and 1.5 g·m², 95 % of which is ±1.96·0.4·1.23 g·m²: wider than any
    assert load.std[0] == pytest.approx(0.02)
    np.testing.assert_allclose(
        1.96 * inertia_com_std(load.parameters.phi, load.covariance)[[0, 3, 5]], 0.97e-3, rtol=5e-3
    )
    assert f"{HARDLY_KNOWN}: Ixx, Iyy, Izz" in "\n".join(load.description())


def test_what_no_body_has_is_not_exported_and_the_nearest_body_is():
    phi = skew_body().phi.copy()
    phi[4:] *= 0.1  # less than the mass at its centre needs
    # so little is known of the inertia that all the change lands there
    std = np.array([1e-3] + [1e-4] * 3 + [0.1] * 6)
    load = Load(InertialParameters(phi, "panda_link8"), std=std)
    with pytest.raises(SinkError, match=r"no body can have these parameters"):
        export_load(load, "urdf")
    body = load.as_body()
    assert body.consistent
    np.testing.assert_allclose(body.parameters.phi[:4], phi[:4], atol=3e-5)
    assert body.as_body() is body
    with pytest.raises(SinkError, match=r"mass of -1\.3 kg: expected a mass above 0"):
        Load(-skew_body()).as_body()


def test_moving_a_load_needs_the_arm_that_knows_both_frames():
    panda = arm("panda")
    at_link7 = about(skew_body(), "panda_link7", panda)
    # the flange is link 7 + 0.107 m along z, axes parallel
    assert_is_the_body(at_link7.mass, at_link7.com - [0, 0, 0.107], at_link7.inertia_com)
    assert about(skew_body(), None) is not None
    assert about(InertialParameters(skew_body().phi), "flange").frame == "flange"
    with pytest.raises(SinkError, match="about 'panda_link8' and wanted about 'panda_link7': name the robot"):
        about(skew_body(), "panda_link7")
    with pytest.raises(ArmError, match="unknown frame 'elsewhere'"):
        about(skew_body(), "elsewhere", panda)


@pytest.mark.parametrize("frame", ["panda_link4", "panda_link6"])
def test_a_load_is_not_moved_over_a_joint(frame):
    panda = arm("panda")
    for there, here in (("panda_link8", frame), (frame, "panda_link8"), (frame, "panda_link5")):
        with pytest.raises(ArmError, match="joints lie between the two"):
            about(skew_body(there), here, panda)
    with pytest.raises(ArmError, match="joints lie between the two"):
        about(hand_on(arm("fr3")).parameters, frame.replace("panda", "fr3"), arm("fr3"))
    with pytest.raises(ArmError, match="joints lie between the two"):
        check_writable(Load(skew_body()), panda, moving=False, write=True, flange=frame)
    with pytest.raises(ArmError, match="unknown frame 'nowhere'"):
        check_writable(Load(skew_body("nowhere")), panda, moving=False, write=True, flange="nowhere")


def test_a_load_that_is_moved_says_of_the_new_axes_what_was_not_measured():
    turned = (  # its y axis is the flange's −x
        '<link name="turned"/><joint name="turn" type="fixed"><origin xyz="0 0 0" rpy="0 0 1.5707963267948966"/>'
        '<parent link="panda_link8"/><child link="turned"/></joint></robot>'
    )
    cell = Arm("cell", arm("panda").urdf.replace("</robot>", turned), "turned")
    std = np.arange(1.0, 11.0)
    known = tuple(name not in ("m·ry", "Ixx") for name in NAMES)
    load = Load(skew_body("turned"), known, std=std, remarks=leaning(known, [name == "Iyy" for name in NAMES]))
    there = load.about("panda_link8", cell)
    assert there.undetermined == ("m·rx", "Iyy")
    assert there.remarks == (f"{load.remarks[0]}, in the axes of turned",)
    assert there.without_inertia().remarks == ()
    # m, then x and y exchanged, and so Ixx and Iyy, Ixz and Iyz
    np.testing.assert_allclose(there.std, std[[0, 2, 1, 3, 7, 5, 8, 4, 6, 9]], rtol=1e-6)
    assert load.about("turned", cell).undetermined == ("m·ry", "Ixx")


def test_a_load_that_is_moved_says_still_that_nothing_seems_to_be_held():
    light = InertialParameters(0.01 * skew_body().phi, "panda_link7")
    load = Load.of(identification(light)).about("panda_link8", arm("panda"))
    assert load.seems_nothing
    assert "nothing seems to be held" in export_load(load, "franka")


def test_forms_that_name_the_frame_need_it():
    nameless = Load(InertialParameters(skew_body().phi))
    for form in ("urdf", "ros2"):
        with pytest.raises(SinkError, match="does not name its frame"):
            export_load(nameless, form)


def test_a_file_is_written_whole_or_an_error_says_why(tmp_path):
    text = export_load(Load(skew_body()), "mjcf", tmp_path / "payload.xml")
    assert (tmp_path / "payload.xml").read_text() == text
    with pytest.raises(SinkError, match="cannot be written"):
        export_load(Load(skew_body()), "mjcf", tmp_path / "nowhere" / "payload.xml")
    with pytest.raises(SinkError, match="unknown form 'gazebo': expected one of franka, franka-desk"):
        export_load(Load(skew_body()), "gazebo")


# ---------------------------------------------------------------------- the guard


def writable(load=None, robot="panda", **settings):
    settings = {"moving": False, "write": True} | settings
    return check_writable(load or identification(skew_body()), arm(robot), **settings)


def test_what_may_be_written_is_what_was_identified():
    np.testing.assert_array_equal(writable().phi, skew_body().phi)
    np.testing.assert_array_equal(writable(Load(skew_body("tool0")), "ur5e").phi, skew_body().phi)


UNDETERMINED = {k: [i != k for i in range(10)] for k in range(10)}


@pytest.mark.parametrize(
    ("attempt", "says"),
    [
        (lambda: writable(write=False), "not asked for: pass write=True"),
        (lambda: writable(write="yes"), "not asked for: pass write=True"),
        (lambda: writable(moving=True), r"the robot moves: .* below 0\.01 rad/s"),
        (
            lambda: writable(identification(skew_body(), robot="fr3")),
            "identified on 'fr3': it is not written to 'panda'",
        ),
        (lambda: writable(identification(skew_body(), determined=UNDETERMINED[0])), "^m of the load is undetermined"),
        (
            lambda: writable(identification(skew_body(), determined=UNDETERMINED[3])),
            "^m·rz of the load is undetermined",
        ),
        (
            lambda: writable(identification(skew_body(), determined=UNDETERMINED[1]), allow_undetermined_inertia=True),
            "^m·rx of the load is undetermined",
        ),
        (lambda: writable(identification(skew_body(), determined=UNDETERMINED[9])), "^Izz of the load is undetermined"),
        (lambda: writable(Load(-skew_body())), r"mass of -1\.3 kg: expected a mass above 0"),
        (lambda: writable(Load(InertialParameters.zero("panda_link8"))), "mass of 0 kg: expected a mass above 0"),
        (lambda: writable(identification(skew_body(), consistent=False)), "inconsistent: no body"),
        (
            lambda: writable(Load(InertialParameters(skew_body().phi * ([1] * 4 + [0.1] * 6), "panda_link8"))),
            "inconsistent: no body",
        ),
        (
            lambda: writable(Load(InertialParameters(3 * skew_body().phi, "panda_link8"))),
            r"weighs 3\.900 kg: panda is rated for 3 kg",
        ),
        (
            lambda: check_writable(
                Load(skew_body()), replace(arm("panda"), rated_payload=None), moving=False, write=True
            ),
            "what panda is rated for is not known",
        ),
        (
            lambda: check_writable(
                Load(skew_body()), replace(arm("panda"), name="mine", known_as=None), moving=False, write=True
            ),
            "the flange of mine is not known",
        ),
    ],
)
def test_the_guard_refuses_in_one_sentence(attempt, says):
    with pytest.raises(SinkError, match=says) as caught:
        attempt()
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, ArmloadError)


def test_an_undetermined_inertia_is_written_as_reported_if_that_is_asked_for():
    result = identification(skew_body(), determined=[True] * 4 + [False] * 6)
    np.testing.assert_array_equal(writable(result, allow_undetermined_inertia=True).phi, skew_body().phi)


@pytest.mark.parametrize("robot", sorted(ARMS))
def test_each_built_in_arm_takes_its_rated_payload_and_no_more(robot):
    rated = arm(robot).rated_payload
    phi = skew_body().phi / MASS * rated
    writable(Load(InertialParameters(phi, FLANGES[robot])), robot)
    assert flange_of(arm(robot)) == FLANGES[robot]
    with pytest.raises(SinkError, match="is rated for"):
        writable(Load(InertialParameters(1.001 * phi, FLANGES[robot])), robot)


@pytest.mark.parametrize(
    ("dq", "moves"),
    [([0.0] * 7, False), ([0, 0.0099, 0, -0.0099], False), ([0, 0, -0.0101], True), ([0, np.nan], True), ([], True)],
)
def test_a_robot_moves_if_any_joint_does_or_nobody_knows(dq, moves):
    assert is_moving(dq) is moves


# ---------------------------------------------------------------------- robots


class Franka:
    """A robot that keeps what is sent to it, with the signature of libfranka's Python clients."""

    def __init__(self, dq=(0.0,) * 7, m_ee=0.0, refuses=None):
        self.state, self.refuses, self.sent = SimpleNamespace(dq=list(dq), m_ee=m_ee), refuses, []

    def read_once(self):
        if self.state is None:
            raise OSError("connection\nlost")
        return self.state

    def set_load(self, load_mass, F_x_Cload, load_inertia):
        if self.refuses:
            raise RuntimeError(self.refuses)
        assert (len(F_x_Cload), len(load_inertia)) == (3, 9)
        self.sent.append((load_mass, F_x_Cload, load_inertia))


class UR:
    """ur-rtde's two interfaces, as far as they are used."""

    def __init__(self, qd=(0.0,) * 6, answer=True, connected=True):
        self.qd, self.answer, self.connected, self.sent = list(qd), answer, connected, []

    def isConnected(self):
        return self.connected

    def getActualQd(self):
        return self.qd

    def setTargetPayload(self, mass, cog=(), inertia=(0.0,) * 6):
        self.sent.append((mass, cog, inertia))
        return self.answer


def test_a_franka_robot_is_told_the_load():
    robot = Franka()
    franka_robot.set_load(robot, identification(skew_body()), arm("panda"), write=True)
    ((mass, com, nine),) = robot.sent
    assert all(isinstance(x, float) for x in (mass, *com, *nine))
    assert_is_the_body(mass, com, np.reshape(nine, (3, 3), order="F"))


def test_a_ur_is_told_the_payload():
    robot = UR()
    ur_robot.set_load(robot, robot, identification(skew_body("tool0"), "ur5e"), arm("ur5e"), write=True)
    ((mass, cog, (xx, yy, zz, xy, xz, yz)),) = robot.sent
    assert_is_the_body(mass, cog, six(xx, xy, xz, yy, yz, zz))


@pytest.mark.parametrize(
    ("robot", "result", "settings", "says"),
    [
        (Franka(), identification(skew_body()), {}, "not asked for"),
        (Franka(dq=[0, 0, 0.02, 0, 0, 0, 0]), identification(skew_body()), {"write": True}, "the robot moves"),
        (Franka(dq=[np.nan] * 7), identification(skew_body()), {"write": True}, "the robot moves"),
        (
            Franka(m_ee=0.73),
            identification(skew_body()),
            {"write": True},
            r"counts an end effector of 0\.73 kg already",
        ),
        (
            Franka(m_ee=2.0),
            identification(skew_body(), relative_to="tool"),
            {"write": True},
            r"1\.300 kg and the end effector 2\.000 kg: panda is rated for 3 kg together",
        ),
        (
            Franka(refuses="command\nrejected"),
            identification(skew_body()),
            {"write": True},
            "refused the load: command rej",
        ),
        (Franka(), identification(skew_body(), relative_to="tool"), {"write": True}, "add the tool"),
        (Franka(), identification(skew_body(), relative_to="tare"), {"write": True}, "add what was mounted then"),
        (Franka(m_ee=np.nan), identification(skew_body()), {"write": True}, "an end effector of nan kg"),
        (Franka(m_ee=None), identification(skew_body()), {"write": True}, "state cannot be read"),
    ],
)
def test_a_franka_robot_is_told_nothing_it_should_not_be(robot, result, settings, says):
    with pytest.raises(SinkError, match=says):
        franka_robot.set_load(robot, result, arm("panda"), **settings)
    assert robot.sent == []


def test_a_franka_robot_with_its_hand_counted_is_told_the_rest():
    robot = Franka(m_ee=0.73)
    hand = franka_hand().parameters
    result = identification(skew_body() + hand)
    franka_robot.set_load(robot, Load.of(result) - hand, arm("panda"), write=True)
    assert_is_the_body(robot.sent[0][0], robot.sent[0][1], np.reshape(robot.sent[0][2], (3, 3)))


def test_a_robot_that_turns_round_does_not_stand_still():
    """All its joints are slow at once for an instant: at 0.5 rad/s², below 0.01 rad/s for 20 ms."""
    franka, ur = Franka(), UR()
    since = itertools.count()  # looks since then, each of some milliseconds
    franka.read_once = lambda: SimpleNamespace(dq=[0.004 * next(since)] * 7, m_ee=0.0)
    with pytest.raises(SinkError, match="the robot moves"):
        franka_robot.set_load(franka, identification(skew_body()), arm("panda"), write=True)
    assert next(since) == 4  # the first looks found it slow
    again = itertools.count()
    ur.getActualQd = lambda: [0.004 * next(again)] * 6
    with pytest.raises(SinkError, match="the robot moves"):
        ur_robot.set_load(ur, ur, identification(skew_body("tool0"), "ur5e"), arm("ur5e"), write=True)
    assert franka.sent == ur.sent == []


def test_a_ur_is_told_what_was_mounted_at_the_tare_and_what_was_added_since():
    gripper, robot = skew_body("tool0"), UR()
    result = identification(InertialParameters(0.5 * gripper.phi, "tool0"), "ur5e", relative_to="tare")
    ur_robot.set_load(robot, robot, Load.of(result) + gripper, arm("ur5e"), write=True)
    assert robot.sent[0][0] == pytest.approx(1.5 * gripper.mass, rel=1e-12)
    ur_robot.set_load(robot, robot, Load.of(result) + InertialParameters.zero("tool0"), arm("ur5e"), write=True)
    assert robot.sent[1][0] == pytest.approx(0.5 * gripper.mass, rel=1e-12)


def test_a_robot_that_is_lost_is_told_nothing():
    robot = Franka()
    robot.state = None
    with pytest.raises(SinkError, match="state cannot be read, so no load is written: connection lost"):
        franka_robot.set_load(robot, identification(skew_body()), arm("panda"), write=True)
    assert robot.sent == []


def test_a_ur_is_told_nothing_it_should_not_be():
    ur5e, result = arm("ur5e"), identification(skew_body("tool0"), "ur5e")
    for robot, load, settings, says in [
        (UR(), result, {}, "not asked for"),
        (UR(qd=[0, 0, 0, 0, 0, -0.5]), result, {"write": True}, "the robot moves"),
        (UR(), replace(result, relative_to="tool"), {"write": True}, "relative to a tool"),
        (UR(), replace(result, relative_to="tare"), {"write": True}, "add what was mounted then"),
        (UR(), replace(Load.of(result), relative_to="before"), {"write": True}, "since its last change"),
        (UR(connected=False), result, {"write": True}, "no payload is written: the connection is lost"),
    ]:
        with pytest.raises(SinkError, match=says):
            ur_robot.set_load(robot, robot, load, ur5e, **settings)
        assert robot.sent == []
    refusing = UR(answer=False)
    with pytest.raises(SinkError, match="setTargetPayload returned False"):
        ur_robot.set_load(refusing, refusing, result, ur5e, write=True)


@pytest.mark.full
@pytest.mark.parametrize("module", ["pylibfranka", "panda_py.libfranka"])
def test_the_vendors_client_takes_these_arguments(module):
    """The real client's set_load takes 1, 3 and 9 numbers; without a robot its signature is all there is."""
    client = pytest.importorskip(module, reason=f"{module} is not installed")
    signature = client.Robot.set_load.__doc__
    assert re.search(r"FixedSize\(3\).*FixedSize\(9\)", signature.splitlines()[0])
    assert "column-major" in signature or "load_inertia" in signature
