"""The ten numbers against the programs that write them, sampled bodies and brute force."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armload.errors import ArmloadError, InertiaError
from armload.inertia import (
    NAMES,
    ORDERS,
    UNITS,
    InertialParameters,
    com_to_phi,
    frame_change_matrix,
    from_log_cholesky,
    from_order,
    inertia_matrix,
    is_consistent,
    log_cholesky,
    log_cholesky_jacobian,
    near_consistent,
    nearest_consistent,
    phi_to_com,
    pseudo_inertia,
    pseudo_inertia_to_phi,
    skew,
    to_order,
    vech,
)
from armload.payloads import test_payload as make_payload

SEEDS = range(8)


def a_cloud(seed, points=6):
    """Point masses: (masses (N,) [kg], positions (N, 3) [m])."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.05, 0.6, points), rng.uniform(-0.2, 0.2, (points, 3))


def cloud_phi(masses, positions):
    """phi by its definition: sums over the points, nothing else."""
    inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, positions, strict=True))
    return np.array([masses.sum(), *(masses @ positions), *[inertia[i, j] for i in range(3) for j in range(i, 3)]])


def a_body(seed):
    return InertialParameters(cloud_phi(*a_cloud(seed)), "flange")


def a_placement(seed):
    rng = np.random.default_rng([seed, 1])
    return pin.SE3(pin.Quaternion(*(q := rng.normal(size=4)) / np.linalg.norm(q)).matrix(), rng.uniform(-0.5, 0.5, 3))


def pin_inertia(body):
    """Pinocchio's inertia from mass, CoM and inertia about the CoM, its own constructor."""
    return pin.Inertia(body.mass, body.com, body.inertia_com)


# ---------------------------------------------------------------------- definition and packing


@pytest.mark.parametrize("seed", SEEDS)
def test_parallel_axes_agree_with_point_masses(seed):
    masses, positions = a_cloud(seed)
    com = masses @ positions / masses.sum()
    about_com = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, positions - com, strict=True))
    np.testing.assert_allclose(com_to_phi(masses.sum(), com, about_com), cloud_phi(masses, positions), atol=1e-14)
    m, r, inertia = phi_to_com(cloud_phi(masses, positions))
    np.testing.assert_allclose(m, masses.sum())
    np.testing.assert_allclose(r, com, atol=1e-14)
    np.testing.assert_allclose(inertia, about_com, atol=1e-14)


def test_the_six_inertia_numbers_are_the_upper_triangle_by_rows():
    matrix = np.array([[11.0, 12, 13], [12, 22, 23], [13, 23, 33]])
    assert vech(matrix).tolist() == [11, 12, 13, 22, 23, 33]
    np.testing.assert_array_equal(inertia_matrix([11, 12, 13, 22, 23, 33]), matrix)
    assert NAMES == ("m", "m·rx", "m·ry", "m·rz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    assert len(UNITS) == 10


def test_skew_is_the_cross_product():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", skew(a), b), np.cross(a, b), atol=1e-15)


def test_parameters_read_back_what_was_given():
    inertia = np.array([[5e-3, 1e-3, -2e-3], [1e-3, 6e-3, 5e-4], [-2e-3, 5e-4, 7e-3]])
    body = InertialParameters.from_com(1.5, (0.01, -0.02, 0.03), inertia, "flange")
    assert body.mass == 1.5
    assert body.frame == "flange"
    np.testing.assert_allclose(body.com, (0.01, -0.02, 0.03))
    np.testing.assert_allclose(body.first_moment, (0.015, -0.03, 0.045))
    np.testing.assert_allclose(body.inertia_com, inertia, atol=1e-16)
    np.testing.assert_allclose(body.inertia, pin_inertia(body).matrix()[3:, 3:], atol=1e-16)


def test_parameters_cannot_be_changed_from_outside():
    numbers = a_body(0).phi.copy()
    body = InertialParameters(numbers)
    numbers[0] = 99.0
    assert body.mass != 99.0
    with pytest.raises(ValueError, match="read-only"):
        body.phi[0] = 1.0


# ---------------------------------------------------------------------- other programs' orders


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_order_round_trips(order, seed):
    body = a_body(seed)
    back = from_order(to_order(body, order), order, "flange")
    np.testing.assert_allclose(back.phi, body.phi, atol=1e-14)
    assert back.frame == "flange"


@pytest.mark.parametrize("seed", SEEDS)
def test_pinocchio_order_is_to_dynamic_parameters(seed):
    body = a_body(seed)
    theirs = pin_inertia(body).toDynamicParameters()
    np.testing.assert_allclose(to_order(body, "pinocchio"), theirs, atol=1e-14)
    np.testing.assert_allclose(from_order(theirs, "pinocchio").phi, body.phi, atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_mujoco_compiles_our_fullinertia_to_the_same_body(seed):
    body = a_body(seed)
    mass, x, y, z, *six = (repr(float(v)) for v in to_order(body, "mujoco"))
    inertial = f'<inertial mass="{mass}" pos="{x} {y} {z}" fullinertia="{" ".join(six)}"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body><freejoint/>{inertial}</body></worldbody></mujoco>"
    )
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[1])
    R = axes.reshape(3, 3)
    assert model.body_mass[1] == pytest.approx(body.mass, rel=1e-12)
    np.testing.assert_allclose(model.body_ipos[1], body.com, atol=1e-14)
    np.testing.assert_allclose(R @ np.diag(model.body_inertia[1]) @ R.T, body.inertia_com, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_pinocchio_reads_our_urdf_inertial_as_the_same_body(seed):
    body = a_body(seed)
    mass, x, y, z, *six = (repr(float(v)) for v in to_order(body, "urdf"))
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    inertia = " ".join(f'{name}="{value}"' for name, value in zip(names, six, strict=True))
    model = pin.buildModelFromXML(
        f"""<robot name="r"><link name="base"/><link name="body"><inertial><origin xyz="{x} {y} {z}" rpy="0 0 0"/>
        <mass value="{mass}"/><inertia {inertia}/></inertial></link>
        <joint name="j" type="revolute"><parent link="base"/><child link="body"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    )
    read = model.inertias[1]
    np.testing.assert_allclose(from_order(read.toDynamicParameters(), "pinocchio").phi, body.phi, atol=1e-14)


def test_franka_takes_the_inertia_about_the_com_column_by_column():
    # libfranka's I_load is an Eigen matrix: I(row, column) at [row + 3·column]
    body = a_body(3)
    numbers = to_order(body, "franka")
    assert numbers.shape == (13,)
    np.testing.assert_allclose(numbers[:4], [body.mass, *body.com])
    for row in range(3):
        for column in range(3):
            assert numbers[4 + row + 3 * column] == pytest.approx(body.inertia_com[row, column], abs=1e-15)


def test_a_lopsided_franka_matrix_is_refused():
    numbers = to_order(a_body(3), "franka")
    numbers[4 + 0 + 3 * 1] += 1e-3
    with pytest.raises(InertiaError, match="not symmetric"):
        from_order(numbers, "franka")


def test_ur_order_lists_the_diagonal_first():
    # URScript set_target_payload: [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] about the centre of gravity
    inertia = np.array([[5e-3, 1e-3, -2e-3], [1e-3, 6e-3, 5e-4], [-2e-3, 5e-4, 7e-3]])
    body = InertialParameters.from_com(2.0, (0.1, 0.2, 0.3), inertia)
    np.testing.assert_allclose(
        to_order(body, "ur"), [2.0, 0.1, 0.2, 0.3, 5e-3, 6e-3, 7e-3, 1e-3, -2e-3, 5e-4], atol=1e-15
    )


# ---------------------------------------------------------------------- frames and sums


@pytest.mark.parametrize("seed", SEEDS)
def test_change_of_frame_is_pinocchios_action_on_inertia(seed):
    body, placement = a_body(seed), a_placement(seed)
    moved = body.moved(placement.rotation, placement.translation, "base")
    np.testing.assert_allclose(
        to_order(moved, "pinocchio"), placement.act(pin_inertia(body)).toDynamicParameters(), atol=1e-13
    )
    assert moved.frame == "base"


@pytest.mark.parametrize("seed", SEEDS)
def test_change_of_frame_moves_the_points(seed):
    masses, positions = a_cloud(seed)
    placement = a_placement(seed)
    seen = positions @ placement.rotation.T + placement.translation
    T = frame_change_matrix(placement.rotation, placement.translation)
    np.testing.assert_allclose(T @ cloud_phi(masses, positions), cloud_phi(masses, seen), atol=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_changes_of_frame_compose_and_undo(seed):
    a, b = a_placement(seed), a_placement(seed + 100)
    T = lambda p: frame_change_matrix(p.rotation, p.translation)  # noqa: E731
    np.testing.assert_allclose(T(a) @ T(b), T(a * b), atol=1e-12)
    np.testing.assert_allclose(T(a.inverse()) @ T(a), np.eye(10), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_add_and_subtract_like_pinocchio_inertias(seed):
    a, b = a_body(seed), a_body(seed + 50)
    both = a + b
    np.testing.assert_allclose(
        to_order(both, "pinocchio"), (pin_inertia(a) + pin_inertia(b)).toDynamicParameters(), atol=1e-14
    )
    np.testing.assert_allclose((both - b).phi, a.phi, atol=1e-14)
    np.testing.assert_allclose((both + -b).phi, a.phi, atol=1e-14)
    np.testing.assert_array_equal((a + InertialParameters.zero()).phi, a.phi)
    assert (a + InertialParameters.zero()).frame == "flange"


def test_bodies_about_different_frames_do_not_add():
    with pytest.raises(InertiaError, match=r"frame 'flange' and about frame 'tool0'.*moved"):
        a_body(0) + InertialParameters(a_body(1).phi, "tool0")


# ---------------------------------------------------------------------- consistency


clouds = st.integers(1, 8).flatmap(
    lambda n: st.tuples(
        arrays(float, n, elements=st.floats(1e-3, 5.0)),
        arrays(float, (n, 3), elements=st.floats(-1.0, 1.0)),
    )
)
coordinates = arrays(float, 10, elements=st.floats(-1.5, 1.5))


@given(clouds)
def test_any_cloud_of_masses_is_consistent(cloud):
    assert is_consistent(cloud_phi(*cloud))


@given(clouds)
def test_pseudo_inertia_is_the_second_moment_of_the_points(cloud):
    masses, positions = cloud
    points = np.column_stack([positions, np.ones(len(masses))])
    expected = points.T @ (masses[:, None] * points)
    phi = cloud_phi(masses, positions)
    np.testing.assert_allclose(pseudo_inertia(phi), expected, atol=1e-12)
    np.testing.assert_allclose(pseudo_inertia_to_phi(expected), phi, atol=1e-12)


@pytest.mark.parametrize(
    "phi",
    [
        [-1.0, 0, 0, 0, 1, 0, 0, 1, 0, 1],  # negative mass
        [0.0, 0, 0, 0, 1, 0, 0, 1, 0, 1],  # no mass, but inertia
        [1.0, 0, 0, 0, 1, 0, 0, 1, 0, 3],  # Izz > Ixx + Iyy: the triangle inequality
        [1.0, 0.5, 0, 0, 0.1, 0, 0, 0.1, 0, 0.1],  # less inertia than a point at its centre of mass
        [1.0, 0, 0, 0, 1, 2, 0, 1, 0, 1],  # indefinite inertia
    ],
)
def test_bodies_that_cannot_exist_are_inconsistent(phi):
    assert not is_consistent(phi)


@given(coordinates)
def test_log_cholesky_is_one_to_one(theta):
    phi = from_log_cholesky(theta)
    assert is_consistent(phi)
    np.testing.assert_allclose(log_cholesky(phi), theta, atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_log_cholesky_coordinates_give_the_body_back(seed):
    phi = a_body(seed).phi
    np.testing.assert_allclose(from_log_cholesky(log_cholesky(phi)), phi, atol=1e-13)


def test_log_cholesky_follows_the_published_factor():
    alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3 = theta = np.linspace(-0.4, 0.5, 10)
    U = np.exp(alpha) * np.array(
        [[np.exp(d1), s12, s13, t1], [0, np.exp(d2), s23, t2], [0, 0, np.exp(d3), t3], [0, 0, 0, 1]]
    )
    np.testing.assert_allclose(pseudo_inertia(from_log_cholesky(theta)), U @ U.T, atol=1e-14)


def test_log_cholesky_of_an_inconsistent_body_says_what_to_do():
    with pytest.raises(InertiaError, match="nearest_consistent"):
        log_cholesky([1.0, 0, 0, 0, 1, 0, 0, 1, 0, 3])


# ---------------------------------------------------------------------- nearest consistent parameters


def an_estimate(seed):
    """A noisy estimate of a body (inconsistent for these seeds), and its information matrix."""
    rng = np.random.default_rng([seed, 2])
    sigma = np.array([0.05, 0.01, 0.01, 0.01] + [0.02] * 6)
    mixing = np.eye(10) + 0.3 * rng.normal(size=(10, 10))
    root = np.diag(1 / sigma) @ mixing
    return a_body(seed).phi + 2.0 * sigma * rng.normal(size=10), root.T @ root


def distance(x, phi, information=None):
    if information is None:  # kg, 0.1 kg·m, 0.01 kg·m²
        information = np.diag([1.0] + [10.0**2] * 3 + [100.0**2] * 6)
    return np.sqrt((x - phi) @ information @ (x - phi))


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_nearest_consistent_is_consistent_and_idempotent(seed, weighted):
    phi, information = an_estimate(seed)
    information = information if weighted else None
    assert not is_consistent(phi)
    x = nearest_consistent(phi, information)
    assert is_consistent(x)
    np.testing.assert_allclose(nearest_consistent(x, information), x, atol=1e-6)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_no_consistent_candidate_is_nearer(seed, weighted):
    phi, information = an_estimate(seed)
    information = information if weighted else None
    x = nearest_consistent(phi, information)
    best = distance(x, phi, information)
    rng = np.random.default_rng(seed)
    # bodies of every distance: around the answer (through its own chart), and clouds around the truth
    theta = log_cholesky(x)
    steps = 10.0 ** rng.uniform(-6, 0, 400)
    candidates = [from_log_cholesky(theta + s * rng.normal(size=10)) for s in steps]
    candidates += [cloud_phi(*a_cloud(k)) for k in range(50)]
    candidates += [x + s * (c - x) for s, c in zip(steps, candidates, strict=False)]  # the set is convex
    nearer = [distance(c, phi, information) for c in candidates]
    assert min(nearer) >= best * (1 - 1e-5)  # the margin keeps the answer off the very border


def test_the_weight_decides_which_number_gives_way():
    phi = np.array([1.0, 0.3, 0, 0, 0.05, 0, 0, 0.05, 0, 0.05])  # the first moment asks for more inertia
    trust_moment, trust_inertia = np.eye(10), np.eye(10)
    trust_moment[1, 1] = trust_inertia[7, 7] = trust_inertia[9, 9] = trust_inertia[4, 4] = 1e6
    trust_moment[0, 0] = trust_inertia[0, 0] = 1e6
    assert nearest_consistent(phi, trust_moment)[1] == pytest.approx(0.3, abs=1e-4)
    assert nearest_consistent(phi, trust_moment)[7] > 0.08
    assert nearest_consistent(phi, trust_inertia)[7] == pytest.approx(0.05, abs=1e-4)
    assert nearest_consistent(phi, trust_inertia)[1] < 0.25


@pytest.mark.parametrize("seed", SEEDS)
def test_a_consistent_body_is_its_own_nearest(seed):
    phi = a_body(seed).phi
    np.testing.assert_array_equal(nearest_consistent(phi), phi)


@settings(max_examples=50)
@given(arrays(float, 10, elements=st.floats(-2.0, 2.0)))
def test_any_ten_numbers_have_a_nearest_body(phi):
    assert is_consistent(nearest_consistent(phi))


# ---------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("attempt", "says"),
    [
        (lambda: InertialParameters(np.ones(9)), r"shape \(9,\): expected 10 numbers"),
        (lambda: InertialParameters(np.array([1.0, np.nan] + [0] * 8)), "not finite at m·rx"),
        (lambda: InertialParameters(["a"] * 10), "not numeric"),
        (lambda: from_order(np.ones(10), "gazebo"), "unknown order 'gazebo': expected one of paper, pinocchio, mujoco"),
        (lambda: to_order(a_body(0), "gazebo"), "unknown order 'gazebo': expected one of paper, pinocchio, mujoco"),
        (lambda: from_order(np.ones(10), "franka"), "10 numbers given in the order 'franka': expected 13"),
        (lambda: from_order(np.ones(13), "ur"), "13 numbers given in the order 'ur': expected 10"),
        (lambda: from_order(["x"] * 10, "ur"), "not numeric"),
        (lambda: InertialParameters.zero().com, "massless body has no centre of mass"),
        (lambda: to_order(InertialParameters.zero(), "gazebo"), "unknown order 'gazebo'"),
        (lambda: com_to_phi(float("inf"), (0, 0, 0), np.eye(3)), "mass is inf"),
        (lambda: com_to_phi(1.0, (0, 0), np.eye(3)), "com is .*expected 3 finite numbers"),
        (lambda: com_to_phi(1.0, "abc", np.eye(3)), "com is 'abc': expected 3 finite numbers"),
        (lambda: com_to_phi(1.0, (0, 0, 0), np.eye(2)), r"inertia_com has shape \(2, 2\)"),
        (lambda: com_to_phi(1.0, (0, 0, 0), np.triu(np.ones((3, 3)))), "not symmetric"),
        (lambda: frame_change_matrix(np.diag([1.0, 1, -1]), (0, 0, 0)), "not a proper 3×3 rotation"),
        (lambda: frame_change_matrix(2 * np.eye(3), (0, 0, 0)), "not a proper 3×3 rotation"),
        (lambda: frame_change_matrix(np.eye(3), (0, 0)), "translation is .*expected 3 finite numbers"),
        (lambda: nearest_consistent(np.full(10, np.nan)), "not finite"),
    ],
)
def test_errors_are_one_sentence(attempt, says):
    with pytest.raises(InertiaError, match=says) as caught:
        attempt()
    assert isinstance(caught.value, ArmloadError)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_near_body_is_a_body_and_hardly_farther_than_the_nearest(seed):
    phi, information = an_estimate(seed)
    x = near_consistent(phi, information)
    assert is_consistent(x)
    assert (
        distance(x, phi, information) ** 2
        <= distance(nearest_consistent(phi, information), phi, information) ** 2 + 2e-3
    )


@pytest.mark.parametrize("shift", [-1e-6, 1e-6])
def test_what_is_a_body_already_is_its_own_near_body(shift):
    phi = InertialParameters.from_com(1.0, (0.0, 0.1, 0.2), np.zeros((3, 3))).phi + shift * np.eye(10)[4]
    assert np.array_equal(near_consistent(phi, np.eye(10)), phi) == is_consistent(phi)


@pytest.mark.parametrize("wrong", [[1.0, 2.0], 1.0, [], np.ones(11), np.ones((4, 10)), "abc", None, make_payload()])
@pytest.mark.parametrize(
    "function",
    [is_consistent, log_cholesky, from_log_cholesky, log_cholesky_jacobian, phi_to_com, nearest_consistent],
)
def test_what_is_not_ten_numbers_is_refused_in_a_sentence(function, wrong):
    with pytest.raises(InertiaError, match="expected 10 numbers"):
        function(wrong)


@pytest.mark.parametrize(
    ("function", "wrong"),
    [
        (pseudo_inertia, np.ones(11)),
        (pseudo_inertia_to_phi, np.ones((3, 3))),
        (inertia_matrix, np.ones(10)),
        (vech, np.ones((2, 2))),
        (skew, np.ones(10)),
        (lambda mass: InertialParameters.from_com(mass, (0, 0, 0), np.eye(3)), [1.0, 2.0]),
        (lambda inertia: InertialParameters.from_com(1.0, (0, 0, 0), inertia), "abc"),
        (lambda rotation: frame_change_matrix(rotation, (0, 0, 0)), "abc"),
        (lambda payload: to_order(payload, "ur"), make_payload()),
        (log_cholesky, np.full(10, np.nan)),
    ],
)
def test_numbers_of_another_shape_are_refused_and_never_cut(function, wrong):
    with pytest.raises(InertiaError, match="expected"):
        function(wrong)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf])
def test_no_body_has_a_number_that_is_not_finite(odd):
    for k in range(10):
        assert not is_consistent(np.where(np.arange(10) == k, odd, make_payload().parameters.phi))


def test_parameters_are_added_to_parameters_only():
    with pytest.raises(TypeError, match="unsupported operand"):
        make_payload().parameters + make_payload()
