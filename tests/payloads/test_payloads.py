"""Payloads against other engines: MuJoCo's compiler, trimesh, Pinocchio; the container against the paper's rule."""

import json
from collections import Counter
from importlib import resources

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armload import payloads
from armload.errors import InertiaError, PayloadError
from armload.inertia import InertialParameters, from_order, is_consistent, to_order
from armload.payloads import Box, Payload, container, container_loadings, franka_hand, random_payloads, solids
from armload.payloads.container import EMPTY_MASS, POSITIONS, WEIGHT_MASS, position_centre
from armload.payloads.loadings import choose_loadings

lengths = st.floats(0.005, 0.5)
masses = st.floats(0.01, 5.0)
points = st.tuples(*[st.floats(-0.3, 0.3)] * 3)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: Rotation.from_rotvec(v).as_matrix())


def mujoco_body(geoms: str) -> InertialParameters:
    """What MuJoCo's compiler makes of a body of these geoms, about the body's origin."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="b"><freejoint/>{geoms}</body></worldbody></mujoco>'
    )
    x, y, z, w = model.body_iquat[1][[1, 2, 3, 0]]
    R = Rotation.from_quat([x, y, z, w]).as_matrix()
    inertia = R @ np.diag(model.body_inertia[1]) @ R.T
    return InertialParameters.from_com(float(model.body_mass[1]), model.body_ipos[1], inertia)


def mujoco_boxes(boxes: tuple[Box, ...]) -> InertialParameters:
    def text(v):
        return " ".join(repr(float(x)) for x in v)

    return mujoco_body(
        "".join(
            f'<geom type="box" size="{text(np.array(b.size) / 2)}" pos="{text(b.centre)}" mass="{b.mass!r}"/>'
            for b in boxes
        )
    )


# ---------------------------------------------------------------- solids


@settings(max_examples=50, deadline=None)
@given(size=st.tuples(lengths, lengths, lengths), mass=masses, R=turns, p=points)
def test_a_placed_box_is_pinocchios_box_moved_by_se3(size, mass, R, p):
    theirs = pin.SE3(R, np.array(p)).act(pin.Inertia.FromBox(mass, *size))
    ours = solids.box(size, mass=mass, rotation=R, translation=p)
    np.testing.assert_allclose(to_order(ours, "pinocchio"), theirs.toDynamicParameters(), atol=1e-12, rtol=1e-10)


@settings(max_examples=50, deadline=None)
@given(radius=lengths, length=lengths, mass=masses, R=turns, p=points)
def test_cylinder_and_sphere_are_pinocchios(radius, length, mass, R, p):
    place = pin.SE3(R, np.array(p))
    ours = solids.cylinder(radius, length, mass=mass, rotation=R, translation=p)
    theirs = place.act(pin.Inertia.FromCylinder(mass, radius, length))
    np.testing.assert_allclose(to_order(ours, "pinocchio"), theirs.toDynamicParameters(), atol=1e-12, rtol=1e-10)
    ours = solids.sphere(radius, mass=mass, translation=p)
    theirs = place.act(pin.Inertia.FromSphere(mass, radius))
    np.testing.assert_allclose(to_order(ours, "pinocchio"), theirs.toDynamicParameters(), atol=1e-12, rtol=1e-10)


def test_density_gives_the_mass_mujoco_gives():
    cases = [
        (solids.box((0.04, 0.06, 0.1), density=2700), '<geom type="box" size=".02 .03 .05" density="2700"/>'),
        (solids.cylinder(0.03, 0.1, density=7850), '<geom type="cylinder" size=".03 .05" density="7850"/>'),
        (solids.sphere(0.04, density=1240), '<geom type="sphere" size=".04" density="1240"/>'),
    ]
    for ours, geom in cases:
        np.testing.assert_allclose(ours.phi, mujoco_body(geom).phi, rtol=1e-12, atol=1e-15)


@settings(max_examples=50, deadline=None)
@given(size=st.tuples(lengths, lengths, lengths), cut=st.floats(0.1, 0.9), mass=masses, R=turns, p=points)
def test_two_halves_of_a_box_compose_to_the_box(size, cut, mass, R, p):
    R, p = np.asarray(R), np.asarray(p)
    a, b, c = size
    left = solids.box((a * cut, b, c), mass=mass * cut, rotation=R, translation=p + R @ [-a * (1 - cut) / 2, 0, 0])
    right = solids.box(
        (a * (1 - cut), b, c), mass=mass * (1 - cut), rotation=R, translation=p + R @ [a * cut / 2, 0, 0]
    )
    whole = solids.box(size, mass=mass, rotation=R, translation=p)
    np.testing.assert_allclose(solids.compose([left, right]).phi, whole.phi, rtol=1e-9, atol=1e-12)


def test_parts_about_different_frames_do_not_compose():
    with pytest.raises(InertiaError, match="cannot be combined"):
        solids.compose([solids.sphere(0.1, mass=1, frame="a"), solids.sphere(0.1, mass=1, frame="b")])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({}, "neither mass nor density"),
        ({"mass": 1, "density": 1000}, "both mass and density"),
        ({"mass": 0}, "mass of the box is 0"),
        ({"mass": float("nan")}, "mass of the box is nan"),
        ({"density": -1}, "density of the box is -1"),
        ({"mass": "heavy"}, "'heavy'"),
    ],
)
def test_a_solid_needs_one_positive_mass_or_density(arguments, says):
    with pytest.raises(PayloadError, match=says):
        solids.box((0.1, 0.1, 0.1), **arguments)


@pytest.mark.parametrize("size", [(0.1, 0.1), (0.1, 0.0, 0.1), (0.1, -0.1, 0.1), (0.1, float("inf"), 0.1), "cube"])
def test_a_box_needs_three_positive_sides(size):
    with pytest.raises(PayloadError, match="size of the box"):
        Box(size, (0, 0, 0), 1.0)


# ---------------------------------------------------------------- payloads of boxes


def test_payloads_add_like_masses_in_mujoco():
    for payload in [*random_payloads(20, seed=1), *container_loadings()[::8], payloads.test_payload()]:
        np.testing.assert_allclose(payload.parameters.phi, mujoco_boxes(payload.boxes).phi, rtol=1e-8, atol=1e-10)


def test_a_payload_that_cannot_exist_is_refused():
    flat = InertialParameters.from_com(1.0, (0, 0, 0.1), np.diag([0.001, 0.001, 0.003]))
    with pytest.raises(PayloadError, match=r"principal moments.*0\.001, 0\.001, 0\.003"):
        Payload("impossible", flat)
    with pytest.raises(PayloadError, match="mass of -1 kg"):
        Payload("antimatter", -solids.sphere(0.1, mass=1.0))
    assert Payload("nothing", InertialParameters.zero()).parameters.mass == 0


# ---------------------------------------------------------------- the container


@pytest.fixture(scope="module")
def loadings():
    return container_loadings()


@pytest.fixture(scope="module")
def committed():
    return json.loads(resources.files("armload.payloads").joinpath("container_loadings.json").read_text("utf-8"))


def test_the_committed_loadings_are_those_of_the_rule(committed):
    assert committed["loadings"] == choose_loadings()
    assert tuple(committed["positions"]) == POSITIONS


def test_there_are_77_loadings_and_no_two_are_alike(loadings):
    phi = np.array([p.parameters.phi for p in loadings])
    assert len(loadings) == len({p.name for p in loadings}) == 77
    distance = np.abs(phi[:, None] - phi[None]) / np.ptp(phi, axis=0).clip(1e-9)
    assert np.all(distance.max(axis=-1)[~np.eye(77, dtype=bool)] > 0.01)
    assert all(is_consistent(x) for x in phi)


def test_masses_of_the_loadings_are_the_papers(loadings):
    weights = Counter(round((p.parameters.mass - EMPTY_MASS) / WEIGHT_MASS, 9) for p in loadings)
    assert weights == {0: 1, 1: 8, 2: 19, 3: 16, 4: 17, 5: 16}
    assert loadings[0].parameters.mass == pytest.approx(0.790, abs=1e-12)
    assert loadings[-1].parameters.mass == pytest.approx(2.163, abs=1e-12)
    assert round(WEIGHT_MASS, 3) == 0.275


def test_each_loading_has_a_partner_of_its_mass_that_differs_in_one_component_of_the_com(loadings):
    mass = np.array([p.parameters.mass for p in loadings])
    com = np.array([p.parameters.com for p in loadings])
    for k in range(1, 6):
        group = com[np.isclose(mass, EMPTY_MASS + k * WEIGHT_MASS)]
        differs = np.abs(group[:, None] - group[None]) > 1e-7  # (N, N, 3); steps are of millimetres
        single = differs & (differs.sum(axis=-1, keepdims=True) == 1)
        assert np.all(single.any(axis=(1, 2))), f"a loading with {k} weights has no partner"
        assert np.all(single.any(axis=(0, 1))), f"with {k} weights no component changes by itself"


def test_the_loadings_of_one_mass_have_mirrored_and_turned_partners(loadings):
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    seen = {(round(p.parameters.mass, 6), *np.round(p.parameters.com, 6) + 0.0) for p in loadings}
    for image in (quarter, np.diag([-1, 1, 1])):
        assert {(m, *np.round(image @ r, 6) + 0.0) for m, *r in seen} == seen


def test_weights_fit_into_the_container_and_move_the_com_as_named():
    empty = container().parameters
    for position in POSITIONS:
        code = "".join("1" if p == position else "0" for p in POSITIONS)
        loaded = container(code)
        weight = loaded.parameters - empty
        np.testing.assert_allclose(weight.com, position_centre(position), atol=1e-12)
        assert weight.mass == pytest.approx(WEIGHT_MASS)
        slot = position.split()[0]
        r = loaded.parameters.com
        axis = "XY".index(slot[1])
        assert np.sign(r[axis]) == (1 if slot[0] == "+" else -1)
    rz = [container(f"{bottom}{top}000000").parameters.com[2] for bottom, top in ((1, 0), (0, 1))]
    assert rz[1] > rz[0] > 0


@pytest.mark.parametrize("payload", [container("11111111"), payloads.test_payload()], ids=lambda p: p.name)
def test_no_two_boxes_of_the_container_overlap(payload):
    low = np.array([np.array(b.centre) - np.array(b.size) / 2 for b in payload.boxes])
    high = np.array([np.array(b.centre) + np.array(b.size) / 2 for b in payload.boxes])
    depth = (np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])).min(axis=-1)
    assert np.all(depth[~np.eye(len(low), dtype=bool)] < 1e-12)
    assert np.all(low[:, 2] >= -1e-12)


@pytest.mark.parametrize("loading", ["", "1111111", "111111111", "0000000x", "2000000０"])
def test_a_loading_is_eight_digits(loading):
    with pytest.raises(PayloadError, match="expected 8 digits"):
        container(loading)


def test_the_test_payload_is_outside_the_77_and_within_their_range(loadings):
    phi = np.array([p.parameters.phi for p in loadings])
    com = np.array([p.parameters.com for p in loadings])
    test = payloads.test_payload().parameters
    assert np.abs(phi[:, 0] - test.mass).min() > 0.1
    assert np.linalg.norm(com - test.com, axis=1).min() > 0.004
    inside = (test.phi > phi.min(axis=0)) & (test.phi < phi.max(axis=0))
    assert inside.tolist() == [True] * 5 + [False] + [True] * 4  # Ixy: slots on the axes make it 0 in all 77
    assert np.all(np.abs(phi[:, 5]) < 1e-12)
    assert 0 < abs(test.phi[5]) < 5e-4


# ---------------------------------------------------------------- the Franka Hand


def test_the_hand_on_the_flange_is_pinocchios_hand_turned_by_minus_45_degrees():
    urdf = """<robot name="r"><link name="panda_link8"/><link name="panda_hand"><inertial><origin xyz="-0.01 0 0.03"/>
      <mass value="0.73"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.0025" iyz="0" izz="0.0017"/></inertial></link>
      <joint name="j" type="fixed"><parent link="panda_link8"/><child link="panda_hand"/>
      <origin rpy="0 0 -0.785398163397448" xyz="0 0 0"/></joint></robot>"""
    model = pin.buildModelFromXML(urdf)
    hand = franka_hand().parameters
    assert hand.frame == "panda_link8"
    np.testing.assert_allclose(to_order(hand, "pinocchio"), model.inertias[0].toDynamicParameters(), atol=1e-12)


def test_the_hand_goes_on_the_panda(panda):
    q = np.array([0.1, -0.5, 0.2, -2.0, 0.3, 1.8, 0.4])
    heavier = panda.with_payload(franka_hand().parameters).torque(q) - panda.torque(q)
    assert np.abs(heavier).max() > 1.0  # [N·m] 0.73 kg at half a metre and more


# ---------------------------------------------------------------- random families


def test_random_payloads_are_consistent_within_their_limits_and_repeatable():
    family = random_payloads(200, seed=5)
    for payload in family:
        assert 1 <= len(payload.boxes) <= 4
        assert 0.2 <= payload.parameters.mass <= 2.8
        assert is_consistent(payload.parameters.phi)
        size, centre = np.array([b.size for b in payload.boxes]), np.array([b.centre for b in payload.boxes])
        assert np.all((size >= 0.02) & (size <= 0.12))
        assert np.all(np.abs(centre[:, :2]) <= 0.08)
        assert np.all((centre[:, 2] >= 0) & (centre[:, 2] <= 0.16))
    assert {len(p.boxes) for p in family} == {1, 2, 3, 4}
    assert random_payloads(3, seed=5) != random_payloads(3, seed=6)
    again = random_payloads(7, seed=5)
    assert all(np.array_equal(a.parameters.phi, b.parameters.phi) for a, b in zip(again, family, strict=False))
    one, same, other = (payloads.random_payload(s).parameters.phi for s in (8, 8, 9))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_random_payloads_leave_the_containers_family(loadings):
    narrow = np.array([p.parameters.phi for p in loadings])
    wide = np.array([p.parameters.phi for p in random_payloads(200, seed=5)])
    assert np.all(wide.std(axis=0) > narrow.std(axis=0))


@pytest.mark.parametrize("seed", [-1, 0.5])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(PayloadError, match="seed is"):
        payloads.random_payload(seed)


# ---------------------------------------------------------------- meshes


def write_mesh(mesh, path):
    mesh.export(path)
    return path


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off"])
def test_a_box_mesh_is_the_closed_form_box(tmp_path, suffix):
    R, p = Rotation.from_rotvec([0.3, -0.7, 1.1]).as_matrix(), np.array([0.01, 0.02, 0.06])
    path = write_mesh(trimesh.creation.box((0.04, 0.06, 0.1)), tmp_path / f"part.{suffix}")
    payload = payloads.from_mesh(path, density=2700, rotation=R, translation=p)
    exact = solids.box((0.04, 0.06, 0.1), density=2700, rotation=R, translation=p)
    np.testing.assert_allclose(payload.parameters.phi, exact.phi, rtol=1e-6, atol=1e-9)  # files keep about 8 digits
    assert payload.name == "part"


def test_a_mesh_in_millimetres_with_a_mass_is_the_mesh_in_metres(tmp_path):
    solid = trimesh.creation.annulus(
        0.02, 0.05, 0.08, transform=trimesh.transformations.translation_matrix([0.1, 0, 0])
    )
    metres = write_mesh(solid, tmp_path / "m.ply")
    millimetres = write_mesh(solid.copy().apply_scale(1000), tmp_path / "mm.ply")
    a = payloads.from_mesh(metres, mass=1.7, translation=(0, 0, 0.04)).parameters
    b = payloads.from_mesh(millimetres, mass=1.7, scale=0.001, translation=(0, 0, 0.04)).parameters
    np.testing.assert_allclose(a.phi, b.phi, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose([a.mass, *a.com], [1.7, 0.1, 0, 0.04], atol=1e-6)


def test_a_mesh_agrees_with_mujocos_mesh_inertia(tmp_path):
    a = trimesh.creation.icosphere(subdivisions=1, radius=0.05).apply_translation([0.01, 0.02, 0.03])
    a.vertices *= [1.0, 1.3, 0.7]
    path = write_mesh(a, tmp_path / "blob.stl")
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" file="{path}" inertia="exact"/></asset><worldbody><body><freejoint/>'
        '<geom type="mesh" mesh="m" density="1200"/></body></worldbody></mujoco>'
    )
    R = Rotation.from_quat(model.body_iquat[1][[1, 2, 3, 0]]).as_matrix()
    theirs = InertialParameters.from_com(
        float(model.body_mass[1]), model.body_ipos[1], R @ np.diag(model.body_inertia[1]) @ R.T
    )
    ours = payloads.from_mesh(path, density=1200).parameters
    np.testing.assert_allclose(ours.phi, theirs.phi, rtol=1e-5, atol=1e-8)


def test_a_mesh_turned_inside_out_is_the_same_solid(tmp_path):
    solid = trimesh.creation.box((0.04, 0.06, 0.1))
    right = payloads.from_mesh(write_mesh(solid, tmp_path / "a.ply"), mass=1.0).parameters.phi
    solid.invert()
    wrong = payloads.from_mesh(write_mesh(solid, tmp_path / "b.ply"), mass=1.0).parameters.phi
    np.testing.assert_allclose(right, wrong, rtol=1e-9, atol=1e-15)


def test_a_mesh_that_cannot_be_used_says_why(tmp_path):
    solid = trimesh.creation.box((0.1, 0.1, 0.1))
    good = write_mesh(solid, tmp_path / "good.stl")
    with pytest.raises(PayloadError, match="neither mass nor density"):
        payloads.from_mesh(good)
    with pytest.raises(PayloadError, match="both mass and density"):
        payloads.from_mesh(good, mass=1, density=1)
    with pytest.raises(PayloadError, match="scale of the mesh is 0"):
        payloads.from_mesh(good, mass=1, scale=0)
    with pytest.raises(InertiaError, match="rotation"):
        payloads.from_mesh(good, mass=1, rotation=2 * np.eye(3))
    with pytest.raises(PayloadError, match=r"100 m long.*scale=0\.001"):
        payloads.from_mesh(write_mesh(solid.copy().apply_scale(1000), tmp_path / "mm.stl"), mass=1)
    with pytest.raises(PayloadError, match="does not exist"):
        payloads.from_mesh(tmp_path / "none.stl", mass=1)
    open_box = trimesh.Trimesh(solid.vertices, solid.faces[:-2])
    with pytest.raises(PayloadError, match="not watertight"):
        payloads.from_mesh(write_mesh(open_box, tmp_path / "open.ply"), mass=1)
    faces = solid.faces.copy()
    faces[0] = faces[0][::-1]
    with pytest.raises(PayloadError, match="face different ways"):
        payloads.from_mesh(
            write_mesh(trimesh.Trimesh(solid.vertices, faces, process=False), tmp_path / "f.ply"), mass=1
        )


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("junk.stl", b"\x00\x01\x02"),
        ("junk.stl", b""),
        ("junk.obj", b"hello\n"),
        ("junk.ply", b"ply\nformat ascii"),
        ("part.sldprt", b"x"),
        ("noext", b"x"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
    ],
)
def test_an_unreadable_mesh_is_one_sentence_that_names_the_file(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(PayloadError, match=name) as caught:
        payloads.from_mesh(tmp_path / name, mass=1)
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------- other programs' numbers


def test_a_payload_survives_the_numbers_of_other_programs():
    phi = payloads.test_payload().parameters
    for order in ("pinocchio", "mujoco", "ur", "franka", "urdf"):
        np.testing.assert_allclose(from_order(to_order(phi, order), order).phi, phi.phi, atol=1e-12)
