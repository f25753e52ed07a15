"""The arms against Pinocchio, MuJoCo, finite differences and an exact lag; and the traps others have paid for."""

import copy
import pickle
import re
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import FrozenInstanceError, replace
from multiprocessing import get_context

import cloudpickle
import mujoco
import numpy as np
import pinocchio as pin
import pytest

from armload.arms import (
    ARMS,
    Arm,
    arm,
    full_arm_regressor,
    momentum_regressor,
    payload_regressor,
    prefixed_frame,
    rated_effort,
    rated_mass,
)
from armload.arms.facts import description_of
from armload.arms.strength import poses
from armload.devices.guard import flange_of
from armload.errors import ArmError, ArmloadError, InertiaError, PayloadError
from armload.inertia import InertialParameters, is_consistent, to_order
from armload.payloads import franka_hand, hand_on, read_payload
from armload.posterior import HybridModel
from armload.regression import FilteredRegression, first_order_lag

LEVEL, TILTED = (0.0, 0.0, -9.81), (3.0, -2.0, -9.1)
PAYLOAD = InertialParameters.from_com(
    1.7, (0.03, -0.05, 0.11), [[9e-3, 1e-3, -2e-3], [1e-3, 1.1e-2, 5e-4], [-2e-3, 5e-4, 7e-3]]
)


@pytest.fixture(params=[LEVEL, TILTED], ids=["level", "tilted"])
def mounted_arm(any_arm, request):
    """An arm of every family, upright and on a tilted base."""
    return replace(any_arm, gravity=request.param)


def motion(n, t):
    """An analytic motion through the middle of the workspace: q, dq, ddq at the times t (N,)."""
    joints = np.arange(n)
    w = 2 * np.pi / 6.0 * (1 + joints % 4)  # harmonics of 6 s, as in the paper
    a, pose = 0.5 / (1 + joints % 3), 0.3 * np.cos(1.0 + 2.0 * joints) - 0.8 * (joints == 3)
    angle = np.asarray(t)[:, None] * w + joints
    return pose + a * np.sin(angle), a * w * np.cos(angle), -a * w**2 * np.sin(angle)


def random_states(n, count=20, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2, 2, (count, n)), rng.normal(size=(count, n)), 5 * rng.normal(size=(count, n))


def load_torque(an_arm, q, dq, ddq, payload=PAYLOAD):
    """RNEA(arm + payload) − RNEA(arm), both by Pinocchio, the payload put on with its own appendBodyToJoint."""
    model = pin.buildModelFromXML(an_arm.urdf)
    model.gravity.linear = np.array(an_arm.gravity)
    loaded = model.copy()
    body = pin.Inertia(payload.mass, payload.com, payload.inertia_com)
    loaded.appendBodyToJoint(model.njoints - 1, body, model.frames[model.getFrameId(an_arm.frame)].placement)
    a, b = model.createData(), loaded.createData()
    rows = zip(q, dq, ddq, strict=True)
    return np.array([pin.rnea(loaded, b, *x) - pin.rnea(model, a, *x) for x in rows])


def exact_lag(t, torque, gain, nodes=5):
    """F[torque] at the even times t from rest: the exact solution of y' = λ·(u − y), integrals by Gauss–Legendre."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    h = t[1] - t[0]
    inside = (x + 1) / 2 * h  # (nodes,)
    u = torque((t[:-1, None] + inside).ravel()).reshape(len(t) - 1, nodes, -1)
    pushes = np.einsum("k,tki->ti", gain * np.exp(-gain * (h - inside)) * w * h / 2, u)
    y = np.zeros((len(t), u.shape[2]))
    for k, push in enumerate(pushes):
        y[k + 1] = np.exp(-gain * h) * y[k] + push
    return y


# ---------------------------------------------------------------------- the model


def test_pandas_links_weigh_what_was_published(panda):
    # Gaz et al. 2019; the same in five public sources
    published = [4.97068, 0.64693, 3.2286, 3.5879, 1.22595, 1.66656, 0.73552]
    np.testing.assert_allclose(panda.link_parameters[:, 0], published, rtol=2e-5)


def test_pandas_flange_is_where_the_maker_says(panda):
    # denavit–hartenberg figures: d1 + d3 + d5 + flange along z, a4 − a5 cancel, a7 along x; flange looks down at q = 0
    R, p = panda.frame_pose(np.zeros((1, 7)))
    np.testing.assert_allclose(p[0], [0.088, 0, 0.333 + 0.316 + 0.384 - 0.107], atol=1e-12)
    np.testing.assert_allclose(R[0], np.diag([1.0, -1, -1]), atol=1e-12)


def test_fr3s_links_weigh_what_was_published():
    # libfranka's test URDF; franka_description has the same. The FR3 v2 is another arm (2.4377 2.2375 …)
    published = [2.92747, 2.93554, 2.2449, 2.6156, 2.32712, 1.81704, 0.62714]
    np.testing.assert_allclose(arm("fr3").link_parameters[:, 0], published, rtol=1e-5)


def test_fr3_moves_like_a_panda(panda):
    q = random_states(7)[0]
    for ours, pandas in zip(arm("fr3").frame_pose(q), panda.frame_pose(q), strict=True):
        np.testing.assert_allclose(ours, pandas, atol=1e-12)


def test_fr3s_inertias_about_the_links_origins_are_franka_descriptions():
    # robots/fr3/inertials.yaml since 0.3.0: xx xy xz yy yz zz of links 1, 2, 5 and 7, rounded
    links = arm("fr3").link_parameters
    for k, published in {
        0: [0.02392732, 1.331790e-05, -0.00011405, 0.02248216, -0.00199503, 0.00635010],
        1: [0.04193895, 0.00020257, 0.00407778, 0.02514515, -0.00422522, 0.06170214],
        4: [0.05161028, -0.00571517, -0.00356732, 0.04787730, 0.01067399, 0.01642363],
        6: [0.00021092, -2.433299e-05, 4.564480e-05, 0.00017719, 8.744070e-05, 5.99319e-05],
    }.items():
        np.testing.assert_allclose(links[k, 4:], published, atol=6e-9)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_every_built_in_arm_says_what_it_may_carry(name):
    an_arm = arm(name)
    assert an_arm.rated_payload is not None
    assert 0 < an_arm.rated_payload < an_arm.link_parameters[:, 0].sum()


@pytest.mark.parametrize("name", sorted(ARMS))
def test_links_are_bodies_that_can_exist(name):
    for phi in arm(name).link_parameters:
        assert is_consistent(phi)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_mujoco_agrees_on_mass_matrix_gravity_and_inverse_dynamics(name):
    an_arm = arm(name)
    model = mujoco.MjModel.from_xml_string(an_arm.urdf)
    model.opt.gravity[:] = an_arm.gravity
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    data = mujoco.MjData(model)
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(model.njnt)]
    assert names == list(an_arm.joint_names)
    for q, dq, ddq in zip(*random_states(an_arm.n), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(an_arm.torque(q, dq, ddq), data.qfrc_inverse, atol=1e-9)
        M = np.array([an_arm.torque(q, None, e) - an_arm.torque(q) for e in np.eye(an_arm.n)]).T
        np.testing.assert_allclose(an_arm.mass_matrix(q), M, atol=1e-9)
        data.qvel[:] = data.qacc[:] = 0
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(an_arm.torque(q), data.qfrc_inverse, atol=1e-9)


def test_momentum_and_drift_are_the_inverse_dynamics(mounted_arm):
    t0, h = 1.3, 1e-3
    stencil = np.array([-3, -2, -1, 1, 2, 3])
    weights = np.array([-1, 9, -45, 45, -9, 1]) / (60 * h)  # sixth order
    p, _ = mounted_arm.momentum(*motion(mounted_arm.n, t0 + h * stencil)[:2])
    q, dq, ddq = motion(mounted_arm.n, np.array([t0]))
    _, drift = mounted_arm.momentum(q, dq)
    np.testing.assert_allclose(weights @ p + drift[0], mounted_arm.torque(q, dq, ddq)[0], atol=1e-7)


def test_one_sample_and_many_give_the_same_torque(panda):
    q, dq, ddq = random_states(7, 3)
    rows = [panda.torque(*row) for row in zip(q, dq, ddq, strict=True)]
    assert rows[0].shape == (7,)
    np.testing.assert_array_equal(panda.torque(q, dq, ddq), rows)


def test_static_torque_holds_a_known_mass_at_a_known_lever():
    # a pendulum of 2 kg at 0.5 m, turning about y, at angle q from straight down: tau = m·g·l·sin q
    pendulum = Arm("pendulum", URDF_PENDULUM, "tip")
    for q in (-1.0, 0.0, 0.4, 2.0):
        assert pendulum.torque([q])[0] == pytest.approx(2.0 * 9.81 * 0.5 * np.sin(q), abs=1e-12)


# ---------------------------------------------------------------------- the regressors


def test_momentum_form_is_the_load_torque_without_acceleration(mounted_arm):
    h = 1e-3
    stencil = np.array([-3, -2, -1, 1, 2, 3])
    weights = np.array([-1, 9, -45, 45, -9, 1]) / (60 * h)
    for t0 in (0.0, 0.7, 2.9, 4.4):
        q, dq, _ = motion(mounted_arm.n, t0 + h * stencil)
        p = momentum_regressor(mounted_arm.frame_motion(q), dq).momentum @ PAYLOAD.phi  # (6, n)
        q, dq, ddq = motion(mounted_arm.n, np.array([t0]))
        drift = momentum_regressor(mounted_arm.frame_motion(q), dq).drift @ PAYLOAD.phi
        np.testing.assert_allclose(weights @ p + drift[0], load_torque(mounted_arm, q, dq, ddq)[0], rtol=0, atol=1e-7)


def test_payload_regressor_is_the_load_torque(mounted_arm):
    q, dq, ddq = random_states(mounted_arm.n)
    Y = payload_regressor(mounted_arm.frame_motion(q), dq, ddq)
    assert Y.shape == (len(q), mounted_arm.n, 10)
    np.testing.assert_allclose(Y @ PAYLOAD.phi, load_torque(mounted_arm, q, dq, ddq), rtol=0, atol=1e-10)


def test_payload_regressor_is_pinocchios_once_rnea_has_set_gravity(mounted_arm):
    # trap: pin.frameBodyRegressor reads data.a_gf, which only rnea fills: without it gravity is missing
    model = pin.buildModelFromXML(mounted_arm.urdf)
    model.gravity.linear = np.array(mounted_arm.gravity)
    data = model.createData()
    frame = model.getFrameId(mounted_arm.frame)
    states = random_states(mounted_arm.n, 5)
    ours = payload_regressor(mounted_arm.frame_motion(states[0]), *states[1:])
    pinocchio_order = np.array([to_order(InertialParameters(e), "pinocchio") for e in np.eye(10)])  # (ours, theirs)
    for Y, q, dq, ddq in zip(ours, *states, strict=True):
        pin.rnea(model, data, q, dq, ddq)
        wrench = pin.frameBodyRegressor(model, data, frame)  # (6, 10), linear rows first
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
        np.testing.assert_allclose(Y, J.T @ wrench @ pinocchio_order.T, atol=1e-10)


def test_at_rest_only_mass_and_first_moment_show(mounted_arm):
    q = random_states(mounted_arm.n)[0]
    still = np.zeros_like(q)
    Y = payload_regressor(mounted_arm.frame_motion(q), still, still)
    np.testing.assert_array_equal(Y[:, :, 4:], 0.0)
    np.testing.assert_allclose(Y @ PAYLOAD.phi, load_torque(mounted_arm, q, still, still), atol=1e-10)


def test_frame_jacobian_is_pinocchios_with_angular_rows_first(mounted_arm):
    model = pin.buildModelFromXML(mounted_arm.urdf)
    data = model.createData()
    q = random_states(mounted_arm.n, 4)[0]
    jacobian, gravity = mounted_arm.frame_motion(q)
    R, p = mounted_arm.frame_pose(q)
    for k in range(len(q)):
        J = pin.computeFrameJacobian(model, data, q[k], model.getFrameId(mounted_arm.frame))
        np.testing.assert_allclose(jacobian[k], np.vstack([J[3:], J[:3]]), atol=1e-12)
        np.testing.assert_allclose(gravity[k], R[k].T @ mounted_arm.gravity, atol=1e-12)
        pin.framesForwardKinematics(model, data, q[k])
        np.testing.assert_allclose(p[k], data.oMf[model.getFrameId(mounted_arm.frame)].translation, atol=1e-12)


def test_full_arm_regressor_gives_the_bare_arms_momentum_and_drift(mounted_arm):
    q, dq, _ = random_states(mounted_arm.n)
    Y = full_arm_regressor(mounted_arm, q, dq)
    links = mounted_arm.link_parameters.ravel()
    assert Y.momentum.shape == (len(q), mounted_arm.n, 10 * mounted_arm.n)
    p, drift = mounted_arm.momentum(q, dq)
    np.testing.assert_allclose(Y.momentum @ links, p, atol=1e-10)
    np.testing.assert_allclose(Y.drift @ links, drift, atol=1e-10)


# ---------------------------------------------------------------------- the lag and the filtered regression


@pytest.mark.parametrize("gain", [10.0, 20.0])
def test_filtered_regression_is_exact_and_second_order(mounted_arm, gain):
    n = mounted_arm.n
    torque = lambda t: load_torque(mounted_arm, *motion(n, t))  # noqa: E731
    coarse = np.arange(251) / 500.0
    exact = exact_lag(coarse, torque, gain)
    size = np.abs(exact).max()
    errors = {}
    for every in (1, 2):  # 500 Hz and 1 kHz, compared at the same instants
        t = np.arange(250 * every + 1) / (500.0 * every)
        q, dq, ddq = motion(n, t)
        tau = mounted_arm.torque(q, dq, ddq) + torque(t)
        r, W = FilteredRegression(mounted_arm, gain)(t, q, dq, tau)
        errors[every] = [np.abs(x[::every] - exact).max() / size for x in (r, W @ PAYLOAD.phi)]
    for coarse_error, fine_error in zip(errors[1], errors[2], strict=True):
        assert fine_error < 5e-5
        assert 3.8 < coarse_error / fine_error < 4.2


def test_filtered_regression_is_exact_from_the_very_first_sample(mounted_arm):
    # F[Y_p] must start at Y_p(0) and the others at 0, also when the arm is already moving; after one step r ≈ λ·h·tau
    n, h, gain = mounted_arm.n, 1e-3, 20.0
    t = 2.2 + np.arange(4) * h
    q, dq, ddq = motion(n, t)
    assert np.abs(dq[0]).max() > 0.1
    load = load_torque(mounted_arm, q, dq, ddq)
    r, W = FilteredRegression(mounted_arm, gain)(t, q, dq, mounted_arm.torque(q, dq, ddq) + load)
    np.testing.assert_allclose(r[0], 0, atol=1e-12)
    np.testing.assert_allclose(W[0] @ PAYLOAD.phi, 0, atol=1e-12)
    exact = exact_lag(t, lambda s: load_torque(mounted_arm, *motion(n, s)), gain)
    np.testing.assert_allclose(W @ PAYLOAD.phi, exact, atol=1e-4 * np.abs(exact).max())
    np.testing.assert_allclose(r, exact, atol=1e-4 * np.abs(exact).max())


def test_filtering_the_signals_first_is_not_the_same(panda):
    # the same-filter rule: F[Y(q, dq, ddq)] ≠ Y(F[q], F[dq], F[ddq]), and W is the former
    t = np.arange(3001) / 1000.0
    q, dq, ddq = motion(7, t)
    gain = 10.0
    W = FilteredRegression(panda, gain)(t, q, dq, panda.torque(q, dq, ddq))[1]
    right = first_order_lag(t, payload_regressor(panda.frame_motion(q), dq, ddq), gain)
    lagged = [first_order_lag(t, x, gain, initial=x[0]) for x in (q, dq, ddq)]
    wrong = payload_regressor(panda.frame_motion(lagged[0]), *lagged[1:])
    size = np.abs(right[1000:] @ PAYLOAD.phi).max()
    assert np.abs((W - right)[1000:] @ PAYLOAD.phi).max() < 1e-4 * size
    assert np.abs((wrong - right)[1000:] @ PAYLOAD.phi).max() > 1e-2 * size


@pytest.mark.parametrize("cuts", [[1], [1, 2, 3], [400], [7, 350, 351, 799]])
def test_feeding_in_pieces_changes_nothing(panda, cuts):
    t = np.cumsum(np.random.default_rng(0).uniform(0.5e-3, 2e-3, 800))
    q, dq, ddq = motion(7, t)
    tau = panda.with_payload(PAYLOAD).torque(q, dq, ddq)
    r, W = FilteredRegression(panda)(t, q, dq, tau)
    piecewise = FilteredRegression(panda)
    parts = [piecewise(*part) for part in zip(*(np.split(x, cuts) for x in (t, q, dq, tau)), strict=True)]
    np.testing.assert_array_equal(np.concatenate([part[0] for part in parts]), r)
    np.testing.assert_array_equal(np.concatenate([part[1] for part in parts]), W)


def test_reset_forgets_the_past(panda):
    t = np.arange(50) / 1000.0
    q, dq, ddq = motion(7, t)
    tau = panda.torque(q, dq, ddq) + 1.0
    regression = FilteredRegression(panda)
    first = regression(t, q, dq, tau)
    regression.reset()
    again = regression(t, q, dq, tau)
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])


def test_lag_of_a_ramp_at_uneven_times_is_the_closed_form():
    gain, rng = 8.0, np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.2e-3, 3e-3, 2000))
    u = np.column_stack([np.ones_like(t), t - t[0]])
    s = t - t[0]
    y = first_order_lag(t, u, gain, initial=[0.5, 0.0])
    np.testing.assert_allclose(y[:, 0], 1 - 0.5 * np.exp(-gain * s), atol=2e-5)
    np.testing.assert_allclose(y[:, 1], s - (1 - np.exp(-gain * s)) / gain, atol=2e-5)


def test_jitter_and_lost_samples_do_not_bias_the_regression(panda):
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.choice([0.8e-3, 1e-3, 1.6e-3, 8.8e-3], 1500, p=[0.3, 0.4, 0.27, 0.03]))
    q, dq, ddq = motion(7, t)
    tau = panda.with_payload(PAYLOAD).torque(q, dq, ddq)
    r, W = FilteredRegression(panda, 20.0)(t, q, dq, tau)
    found = np.linalg.lstsq(W.reshape(-1, 10), r.ravel(), rcond=None)[0]
    np.testing.assert_allclose(found[:4], PAYLOAD.phi[:4], atol=1e-3)


# ---------------------------------------------------------------------- what counts as part of the arm


def test_an_attached_payload_is_added_to_the_last_link(mounted_arm):
    loaded = mounted_arm.with_payload(PAYLOAD)
    states = random_states(mounted_arm.n)
    np.testing.assert_allclose(
        loaded.torque(*states) - mounted_arm.torque(*states), load_torque(mounted_arm, *states), atol=1e-10
    )
    added = loaded.link_parameters - mounted_arm.link_parameters
    np.testing.assert_array_equal(added[:-1], 0.0)
    assert added[-1, 0] == pytest.approx(PAYLOAD.mass)


def test_attached_payloads_add_up(panda):
    twice = panda.with_payload(PAYLOAD).with_payload(PAYLOAD)
    np.testing.assert_allclose(twice.link_parameters, panda.with_payload(PAYLOAD + PAYLOAD).link_parameters)
    np.testing.assert_allclose(
        twice.with_payload(-PAYLOAD - PAYLOAD).link_parameters, panda.link_parameters, atol=1e-12
    )


def test_what_is_attached_stays_where_it_is_whatever_frame_it_or_the_arm_is_given_about(panda):
    states, at_7 = random_states(7, 3), InertialParameters(PAYLOAD.phi, "panda_link7")
    expected = panda.with_payload(panda.in_frame(at_7)).torque(*states)
    assert not np.allclose(panda.with_payload(PAYLOAD).torque(*states), expected, atol=0.1)
    about_7 = replace(panda, frame="panda_link7").with_payload(at_7)
    for loaded in (
        panda.with_payload(at_7),
        replace(panda, attached=at_7),
        about_7,
        replace(about_7, frame="panda_link8"),
        panda.with_payload(-PAYLOAD).with_payload(at_7).with_payload(PAYLOAD),
    ):
        np.testing.assert_allclose(loaded.torque(*states), expected, atol=1e-10)
    np.testing.assert_array_equal(
        panda.with_payload(InertialParameters(PAYLOAD.phi, "flange")).link_parameters,
        panda.with_payload(PAYLOAD).link_parameters,
    )
    for attach in (panda.with_payload, lambda payload: replace(panda, attached=payload)):
        with pytest.raises(ArmError, match="joints lie between"):
            attach(InertialParameters(PAYLOAD.phi, "panda_link4"))


def test_attaching_nothing_changes_nothing(panda):
    states = random_states(7, 3)
    empty = panda.with_payload(InertialParameters.zero())
    np.testing.assert_allclose(empty.torque(*states), panda.torque(*states), atol=1e-12)
    assert empty.fingerprint == panda.fingerprint


def test_links_without_mass_weigh_nothing(panda):
    links = panda.link_parameters.copy()
    links[-1] = 0.0
    q = random_states(7, 1)[0]
    assert panda.with_links(links).torque(q)[0, -1] == pytest.approx(0, abs=1e-12)
    with pytest.raises(ArmError, match="without mass has a first moment"):
        panda.with_links(links + 0.1 * np.eye(7, 10, k=-5))


def test_links_can_be_replaced(panda):
    links = panda.link_parameters * 1.1
    heavier = panda.with_links(links)
    states = random_states(7, 3)
    np.testing.assert_allclose(heavier.torque(*states), 1.1 * panda.torque(*states), rtol=1e-12)
    np.testing.assert_allclose(heavier.link_parameters, links, rtol=1e-12)


def test_fingerprint_knows_the_axis_of_a_joint():
    def one(axis):
        return Arm(
            "x", robot(link("base"), joint("j", "revolute", "base", "a", axis=axis), link("a", 1.0, com="0.3 0.1 0.2"))
        )

    a, b = one("0.6 0.8 0"), one("0.6 0 0.8")
    assert not np.allclose(a.torque([0.4]), b.torque([0.4]))
    assert a.fingerprint != b.fingerprint
    assert a.fingerprint == one("0.6 0.8 0").fingerprint


def test_fingerprint_follows_the_physics_and_not_the_name(panda):
    other = {
        "mass": panda.with_links(panda.link_parameters * (1 + 1e-3)),
        "payload": panda.with_payload(PAYLOAD),
        "frame": arm("panda", frame="panda_link7"),
        "gravity": arm("panda", gravity=TILTED),
        "arm": arm("ur10e"),
    }
    prints = {panda.fingerprint, *(a.fingerprint for a in other.values())}
    assert len(prints) == 1 + len(other)
    assert replace(panda, name="another name").fingerprint == panda.fingerprint
    assert arm("panda").fingerprint == panda.fingerprint


def test_an_arm_cannot_be_changed(panda):
    with pytest.raises(FrozenInstanceError):
        panda.frame = "panda_link0"


def torque_of(an_arm, q):
    return an_arm.torque(q)


def test_an_arm_travels_to_worker_processes(panda):
    loaded = panda.with_payload(PAYLOAD)
    q = random_states(7, 4)[0]
    expected = loaded.torque(q)
    for travelled in (
        copy.deepcopy(loaded),
        pickle.loads(pickle.dumps(loaded)),
        cloudpickle.loads(cloudpickle.dumps(loaded)),
    ):
        np.testing.assert_array_equal(travelled.torque(q), expected)
        assert travelled.fingerprint == loaded.fingerprint
        np.testing.assert_array_equal(travelled.limits.velocity, loaded.limits.velocity)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        np.testing.assert_array_equal(pool.submit(torque_of, loaded, q).result(), expected)


def test_limits_are_the_makers(panda):
    np.testing.assert_allclose(panda.limits.velocity, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_allclose(panda.limits.effort, [87] * 4 + [12] * 3)
    np.testing.assert_allclose(panda.limits.position_high, [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
    np.testing.assert_allclose(
        panda.limits.position_low, [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    )
    np.testing.assert_allclose(panda.limits.acceleration, [15, 7.5, 10, 12.5, 15, 20, 20])
    assert np.all(np.isinf(arm("ur10e").limits.jerk))


def test_the_middle_of_a_range_without_two_ends_is_within_it_and_no_warning():
    limits = arm("gen3").limits
    endless = np.isinf(limits.position_low)
    assert endless.any()
    np.testing.assert_array_equal(limits.middle[endless], 0.0)
    one_end = replace(limits, position_low=np.where(endless, 0.5, limits.position_low))
    np.testing.assert_array_equal(one_end.middle[endless], 0.5)


# ---------------------------------------------------------------------- descriptions


def link(name, mass=None, extra="", com="0 0 0", rpy="0 0 0", inertia="0.01 0.02 0.025"):
    if mass is None:
        return f'<link name="{name}">{extra}</link>'
    xx, yy, zz = inertia.split()
    return (
        f'<link name="{name}">{extra}<inertial><origin xyz="{com}" rpy="{rpy}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial></link>'
    )


def joint(
    name,
    kind,
    parent,
    child,
    xyz="0 0 0.2",
    axis="0 1 0",
    extra='<limit lower="-2" upper="2" effort="9" velocity="3"/>',
):
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/>{extra}</joint>'
    )


def robot(*parts):
    return '<?xml version="1.0"?><robot name="test">' + "".join(parts) + "</robot>"


URDF_PENDULUM = robot(
    link("base"),
    link("rod", 2.0, com="0 0 -0.5"),
    joint("hinge", "revolute", "base", "rod"),
    link("tip"),
    joint("end", "fixed", "rod", "tip", "0 0 -1"),
)
MESH = '<visual><geometry><mesh filename="package://nowhere/arm.dae"/></geometry></visual>'
URDF_GRIPPER = robot(
    '<material name="grey"><color rgba="1 1 1 1"/></material><transmission name="t"/><gazebo/>',
    link("world"),
    joint("mount", "fixed", "world", "base"),
    link("base", 1.0, MESH),
    joint("pan", "continuous", "base", "upper", axis="0 0 1", extra='<dynamics damping="5" friction="3"/>'),
    link("upper", 3.0, MESH + MESH.replace("visual", "collision"), com="0 0 0.1", rpy="0.3 -0.4 0.5"),
    joint("lift", "revolute", "upper", "fore"),
    link("fore", 2.0, MESH, com="0.02 0 0.15", rpy="0.1 0.2 0.3"),
    joint("wrist", "fixed", "fore", "tool", "0 0 0.3"),
    link("tool"),
    joint("hand_mount", "fixed", "tool", "hand", "0 0 0.05"),
    link("hand", 0.5, com="0 0 0.04"),
    joint("finger1", "prismatic", "hand", "left", "0 0 0.06"),
    link("left", 0.05),
    joint(
        "finger2",
        "prismatic",
        "hand",
        "right",
        "0 0 0.06",
        extra='<limit lower="0" upper="0.04" effort="9" velocity="1"/><mimic joint="finger1"/>',
    ),
    link("right", 0.07),
)


def test_fingers_mimics_continuous_joints_and_meshes_load():
    gripper = Arm("gripper", URDF_GRIPPER, "tool")
    assert gripper.joint_names == ("pan", "lift")
    assert np.isinf(gripper.limits.position_high[0])
    assert gripper.limits.position_high[1] == 2.0
    # fingers off the chain are fixed where they stand, and weigh: 2 + .5 + .05 + .07 kg move with the last joint
    np.testing.assert_allclose(gripper.link_parameters[:, 0], [3.0, 2.62])


def test_mujoco_agrees_on_a_description_with_turned_inertials():
    # trap: MuJoCo once dropped the rpy of a URDF's <inertial><origin>
    gripper = Arm("gripper", URDF_GRIPPER, "tool")
    model = mujoco.MjModel.from_xml_string(gripper.urdf)
    data = mujoco.MjData(model)
    for q, dq, ddq in zip(*random_states(2, 5), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(gripper.torque(q, dq, ddq), data.qfrc_inverse, atol=1e-9)


def test_fixed_joints_may_have_no_axis():
    # as some exporters write them
    bolted = ONE_LINK.replace("</robot>", link("b", 2.0) + joint("k", "fixed", "a", "b", axis="0 0 0") + "</robot>")
    np.testing.assert_allclose(Arm("x", bolted).link_parameters[:, 0], 3.0)


def test_a_prismatic_joint_lifts_the_weight():
    lift = Arm("lift", robot(link("base"), joint("z", "prismatic", "base", "load", axis="0 0 1"), link("load", 3.0)))
    assert lift.torque([0.1], [0.0], [2.0])[0] == pytest.approx(3.0 * (9.81 + 2.0))


def test_the_default_frame_is_the_last_link():
    assert Arm("pendulum", URDF_PENDULUM).frame == "tip"
    no_fingers = URDF_GRIPPER.split('<joint name="finger1"')[0] + "</robot>"
    assert Arm("g", no_fingers).frame == "hand"
    assert arm("panda").frame == "panda_link8"
    assert arm("fr3").frame == "fr3_link8"
    assert arm("ur5e").frame == arm("ur10e").frame == "tool0"


def two_arms():
    sides = []
    for side in ("left", "right"):
        upper, fore, tool = (f"{side}_{name}" for name in ("upper", "fore", "tool"))
        sides += [link(upper, 3.0), link(fore, 2.0), link(tool)]
        sides += [joint(f"{side}_pan", "revolute", "base", upper), joint(f"{side}_lift", "revolute", upper, fore)]
        sides += [joint(f"{side}_end", "fixed", fore, tool)]
    return robot(link("base"), *sides)


@pytest.mark.parametrize(
    ("urdf", "says"),
    [
        (two_arms(), r"'left_tool' and 'right_tool' among them: name the link .* with --frame"),
        (URDF_GRIPPER, r"'left' and 'right' among them: name the link .* with --frame"),
    ],
)
def test_of_several_ends_that_could_carry_the_payload_none_is_guessed(urdf, says):
    with pytest.raises(ArmError, match=says):
        Arm("x", urdf)
    assert Arm("x", two_arms(), "left_tool").joint_names == ("left_pan", "left_lift")


def test_a_joint_that_another_one_drives_is_no_joint_of_the_chain():
    # its torque is its own in no log: the drive of the other joint bears it
    driven = URDF_PENDULUM.replace('type="revolute">', 'type="revolute"><mimic joint="crank" multiplier="-1"/>')
    with pytest.raises(ArmError, match="joint 'hinge' of x, which moves the frame 'tip', mimics 'crank'"):
        Arm("x", driven)


def test_any_frame_can_carry_the_payload():
    for frame in ("panda_link7", "panda_link4"):
        chosen = arm("panda", frame=frame)
        assert chosen.frame == frame
        q, dq, ddq = random_states(chosen.n, 3)
        Y = payload_regressor(chosen.frame_motion(q), dq, ddq)
        np.testing.assert_allclose(Y @ PAYLOAD.phi, load_torque(chosen, q, dq, ddq), atol=1e-10)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_a_file_with_the_links_of_a_known_arm_is_that_arm(tmp_path, name):
    known = arm(name)
    (tmp_path / "cell.urdf").write_text(known.urdf)
    found = arm(tmp_path / "cell.urdf", known.frame, gravity=(0.0, 9.81, 0.0))
    facts = ("rated_payload", "link_spread", "motor_torque", "acceleration", "jerk")
    assert [getattr(found, fact) for fact in facts] == [getattr(known, fact) for fact in facts]
    assert (found.name, found.known_as, found.gravity) == ("cell", name, (0.0, 9.81, 0.0))


def test_a_file_with_other_links_is_no_known_arm(tmp_path):
    known = arm("ur10e")
    heavier = known.urdf.replace('<mass value="', '<mass value="1')
    assert heavier != known.urdf
    (tmp_path / "ur10e.urdf").write_text(heavier)
    found = arm(tmp_path / "ur10e.urdf")
    assert (found.rated_payload, found.motor_torque, found.link_spread) == (None, False, 10.0)
    assert found.name == "ur10e.urdf"  # a result of it must not be taken for one of the built-in arm
    (tmp_path / "ur10e.urdf").write_text(known.urdf)
    assert arm(tmp_path / "ur10e.urdf").name == "ur10e"


def test_an_arm_whose_first_joint_turns_about_another_axis_is_no_known_arm(tmp_path):
    known = arm("panda")
    first = known.urdf.index('name="panda_joint1"')
    axis = known.urdf.index('xyz="0 0 1"', known.urdf.index("<axis", first))
    turned = known.urdf[:axis] + 'xyz="0 1 0"' + known.urdf[axis + len('xyz="0 0 1"') :]
    (tmp_path / "cell.urdf").write_text(turned)
    found = arm(tmp_path / "cell.urdf", known.frame)
    q = np.linspace(0.3, 0.9, 7)
    assert np.abs(found.torque(q) - known.torque(q)).max() > 1.0
    assert found.known_as is None


def test_a_known_arm_whose_links_and_joints_have_a_prefix_is_that_arm(tmp_path):
    known = arm("ur10e")
    prefixed = re.sub(r'(name|link)="(?!ur10e)', r'\1="left_', known.urdf)
    (tmp_path / "two_arms.urdf").write_text(prefixed)
    found = arm(tmp_path / "two_arms.urdf", "left_tool0")
    assert found.joint_names == tuple(f"left_{name}" for name in known.joint_names)
    assert (found.known_as, found.rated_payload, found.motor_torque) == ("ur10e", 12.5, True)


def side_by_side(tmp_path, *arms):
    """A file of several built-in arms (name, pattern of names, how they are called) on one table."""
    parts = [link("table")]
    for name, old, new in arms:
        text = description_of(name)
        inside = text[text.index(">", text.index("<robot")) + 1 : text.rindex("</robot>")]
        parts.append(re.sub(rf'(name|link)="{old}', rf'\1="{new}', inside))
        base = re.search(r'<link name="([^"]*)"', parts[-1])[1]
        parts.append(joint(f"{base}_place", "fixed", "table", base, xyz="0 0.5 0.4"))
    path = tmp_path / "cell.urdf"
    path.write_text(robot(*parts))
    return path


@pytest.mark.parametrize(
    ("arms", "frames"),
    [
        ((("panda", "", "left_"), ("panda", "", "right_")), ("left_panda_link8", "right_panda_link8")),
        ((("panda", "panda_", "panda_1_"), ("panda", "panda_", "panda_2_")), ("panda_1_link8", "panda_2_link8")),
        ((("panda", "panda_", "fer_"), ("ur5e", "", "")), ("fer_link8", "tool0")),
        ((("ur5e", "", ""), ("ur10e", "", "right_")), ("tool0", "right_tool0")),
        ((("iiwa7", "", "left_"), ("panda", "", "")), ("left_lbr_link_ee", "panda_link8")),
    ],
)
def test_each_of_two_known_arms_in_a_file_is_that_arm(tmp_path, arms, frames):
    path = side_by_side(tmp_path, *arms)
    for (name, _, _), frame in zip(arms, frames, strict=True):
        found, known = arm(path, frame), arm(name)
        facts = ("known_as", "rated_payload", "link_spread", "motor_torque", "acceleration", "jerk")
        assert [getattr(found, fact) for fact in facts] == [getattr(known, fact) for fact in facts]
        assert flange_of(found) == prefixed_frame(found, known.frame) == found.frame == frame
        assert HybridModel.load(HybridModel.shipped(found)).into_frame(found) is None


def called(tmp_path, name, old, new):
    """A file of a built-in arm whose links and joints are called otherwise."""
    path = tmp_path / "cell.urdf"
    path.write_text(re.sub(rf'(name|link)="{old}_', rf'\1="{new}_', arm(name).urdf))
    return path


@pytest.mark.parametrize(
    ("name", "called_so", "flange"),
    [
        ("panda", None, "panda_link8"),
        ("fr3", None, "fr3_link8"),
        ("panda", "left_panda", "left_panda_link8"),
        ("panda", "fer", "fer_link8"),
        ("fr3", "fer", "fer_link8"),
        ("fr3", "right", "right_link8"),
    ],
)
def test_the_franka_hand_sits_on_the_flange_of_any_franka_whatever_it_is_called(tmp_path, name, called_so, flange):
    robot = name if called_so is None else called(tmp_path, name, name, called_so)
    hand = hand_on(arm(robot, flange)).parameters
    assert hand.frame == flange
    np.testing.assert_array_equal(hand.phi, franka_hand().parameters.phi)
    # about link 7 the flange's origin is 0.107 m along z, axes parallel
    np.testing.assert_allclose(
        arm(robot, flange.replace("link8", "link7")).in_frame(hand).phi,
        hand.moved(np.eye(3), [0, 0, 0.107]).phi,
        atol=1e-12,
    )


def test_a_frame_that_the_arm_does_not_have_is_an_error_and_so_is_the_franka_hand_on_another_make(any_arm):
    payload = InertialParameters(PAYLOAD.phi, "elsewhere_link8")
    with pytest.raises(ArmError, match=f"{any_arm.name} has no frame 'elsewhere_link8'"):
        any_arm.in_frame(payload)
    if any_arm.name not in ("panda", "fr3"):
        with pytest.raises(PayloadError, match=f"{any_arm.name} has no flange of a Franka.* such as '{any_arm.frame}'"):
            hand_on(any_arm)


@pytest.mark.parametrize("frame", ["panda_link6", "panda_link5", "panda_link4"])
def test_a_payload_behind_a_joint_that_does_not_move_the_frame_is_not_moved_to_it(frame):
    behind = InertialParameters(PAYLOAD.phi, "panda_link8")
    with pytest.raises(ArmError, match="joints lie between the two"):
        arm("panda", frame).in_frame(behind)
    with pytest.raises(ArmError, match="joints lie between the two"):
        arm("panda").in_frame(InertialParameters(PAYLOAD.phi, frame))


@pytest.mark.parametrize(("name", "frame"), [("panda", "panda_link8"), ("ur10e", "tool0")])
@pytest.mark.parametrize("at", ["flange", "tip"])
def test_a_known_arm_with_a_tool_in_its_file_is_that_arm_with_the_tool_attached(tmp_path, name, frame, at):
    known = arm(name)
    tool = link("tip", 0.9, com="0.01 0 0.05", inertia="0.002 0.003 0.0015")
    joint_to_tip = (
        f'<joint name="tip_joint" type="fixed"><parent link="{frame}"/><child link="tip"/>'
        '<origin xyz="0 0.02 0.1" rpy="0.3 0 0.7"/></joint>'
    )
    (tmp_path / "cell.urdf").write_text(known.urdf.replace("</robot>", f"{joint_to_tip}{tool}</robot>"))
    found = arm(tmp_path / "cell.urdf", frame if at == "flange" else "tip")
    assert (found.known_as, found.rated_payload, found.link_spread) == (name, known.rated_payload, known.link_spread)
    assert found.attached.mass == pytest.approx(0.9)
    as_written = Arm("cell", (tmp_path / "cell.urdf").read_text(), found.frame)
    states = random_states(found.n, 5)
    np.testing.assert_allclose(found.torque(*states), as_written.torque(*states), atol=1e-9)
    bare = replace(found, attached=None, frame=frame)
    np.testing.assert_allclose(bare.torque(*states), known.torque(*states), atol=1e-9)


def test_the_strength_of_joints_without_limits_is_about_that_of_the_ratings():
    known = arm("ur10e")
    limitless = replace(known, urdf=re.sub(r'effort="[^"]*"', 'effort="0"', known.urdf))
    assert not np.isfinite(limitless.limits.effort).any()
    ratio = rated_effort(limitless) / known.limits.effort
    assert np.all((ratio > 0.3) & (ratio < 2.0))
    np.testing.assert_array_equal(rated_effort(known), known.limits.effort)


def test_an_arm_whose_limits_do_not_hold_its_own_weight_is_rated_as_one_without_them():
    # as of arms that springs bear (Baxter, PR2): its limits would leave room for nothing
    def two_links(effort):
        limit = f'<limit lower="-2" upper="2" effort="{effort}" velocity="3"/>'
        return Arm(
            "spring",
            robot(
                link("base"),
                joint("lift", "revolute", "base", "upper", extra=limit),
                link("upper", 6.0, com="0 0 0.2"),
                joint("bend", "revolute", "upper", "fore", "0 0 0.4", extra=limit.replace(f'"{effort}"', '"30"')),
                link("fore", 3.0, com="0 0 0.15"),
                joint("end", "fixed", "fore", "tool", "0 0 0.3"),
                link("tool"),
            ),
        )

    weight = np.abs(two_links(60).torque(poses(two_links(60)))).max(axis=0)[0]
    assert 20.0 < weight < 30.0
    assert rated_mass(two_links(20)) == pytest.approx(rated_mass(two_links(2.0 * weight)))
    assert 1.0 < rated_mass(two_links(20)) < 5.0
    assert rated_mass(two_links(1.2 * weight)) < rated_mass(two_links(2.0 * weight))  # a limit that holds is believed


def test_an_arm_loads_from_a_urdf_file(tmp_path, panda):
    path = tmp_path / "mine.urdf"
    path.write_text(panda.urdf, encoding="utf-8")
    mine = arm(path, frame="panda_link8")
    assert mine.name == "mine"
    assert mine.fingerprint == panda.fingerprint
    assert arm(str(path)).frame == "panda_link8"


ONE_LINK = robot(link("base"), joint("j", "revolute", "base", "a"), link("a", 1.0))


@pytest.mark.parametrize(("name", "meant"), [("UR5e", "ur5e"), ("FR3", "fr3"), ("iiwa-14", "iiwa14")])
def test_a_built_in_arm_that_is_written_otherwise_is_asked_about(name, meant):
    with pytest.raises(ArmError, match=f"unknown robot '{name}'.*did you mean '{meant}'"):
        arm(name)


@pytest.mark.parametrize(
    ("attempt", "says"),
    [
        (
            lambda: arm("pandas"),
            r"unknown robot 'pandas': expected one of fr3, gen3, .*panda, .*ur5e, .*xarm7",
        ),
        (lambda: arm("panda", frame="tool0"), r"unknown frame 'tool0' in panda: expected one of .*panda_link8$"),
        (lambda: arm("ur10e", frame="wrist_3"), r"unknown frame 'wrist_3'.*; did you mean 'wrist_3_link'\?"),
        (lambda: arm("panda", gravity=(0, 0)), r"gravity is \(0, 0\): expected 3 finite numbers"),
        (lambda: arm("panda", gravity=("a", 0, 0)), r"gravity is .*expected 3 finite numbers"),
        (lambda: arm("panda", gravity=(0, 0, -981)), "magnitude 981 m/s²: expected about 9.81"),
        (lambda: arm("panda", gravity=(0, 0, -1)), r"magnitude 1 m/s²: expected .*give it in m/s², not in g"),
        (lambda: arm("panda", gravity=(0, 0, -32.2)), r"magnitude 32.2 m/s²: expected .*1.5 to 20 anywhere"),
        (lambda: arm("panda", gravity=(0, 0, 0)), "magnitude 0 m/s²: expected about 9.81"),
        (lambda: arm("panda", frame="panda_link0"), "no joint of panda moves the frame 'panda_link0'"),
        (lambda: Arm("x", "joints: 7"), "x is not a URDF"),
        (lambda: Arm("x", ""), "x is not a URDF"),
        (lambda: Arm("x", "<sdf/>"), "its root element is <sdf>, expected <robot>"),
        (lambda: Arm("x", robot(link("a"))), "x has no joints"),
        (
            lambda: Arm("x", robot(link("a"), link("b"), joint("j", "fixed", "a", "b"))),
            "no joint of x moves the frame 'b'",
        ),
        (lambda: Arm("x", robot(link("a"), joint("j", "revolute", "a", "b"))), "joint 'j' of x has no <child> among"),
        (
            lambda: Arm("x", ONE_LINK.replace('<parent link="base"/>', "")),
            "joint 'j' of x has no <parent> among the links",
        ),
        (lambda: Arm("x", ONE_LINK.replace('<child link="a"/>', "")), "joint 'j' of x has no <child>"),
        (
            lambda: Arm("x", ONE_LINK.replace('parent link="base"', 'parent link="nowhere"')),
            "joint 'j' of x has no <parent>",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('parent link="base"', 'parent link="a"')),
            "no joint of x moves the frame 'base'",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace("</robot>", joint("k", "fixed", "a", "base") + "</robot>")),
            "run in a circle",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('value="1.0"', 'value="heavy"')),
            "x: <mass> of link 'a' has value = 'heavy', expected finite numbers",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('value="1.0"', 'value="nan"')),
            "x: <mass> of link 'a' has value = 'nan', expected finite numbers",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('ixx="0.01"', 'ixx="inf"')),
            "x: <inertia> of link 'a' has ixx = 'inf', expected finite numbers",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('value="1.0"', 'value="-1.0"')),
            "x: <mass> of link 'a' has value = '-1.0', expected a mass of at least 0",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('xyz="0 1 0"', 'xyz="0 0 0"')),
            "x: <axis> of joint 'j' has xyz = '0 0 0', expected a direction",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('value="1.0"', 'value=""')),
            "x: <mass> of link 'a' has value = '', expected a number",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('value="1.0"', 'value="1_0"')),
            "x: <mass> of link 'a' has value = '1_0', expected finite numbers",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('xyz="0 1 0"', 'xyz="0 1"')),
            "x: <axis> of joint 'j' has xyz = '0 1', expected three numbers",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('lower="-2"', 'lower="3"')),
            "x: <limit> of joint 'j' has lower = 3, upper = 2, .*expected lower below upper",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('effort="9"', 'effort="-9"')),
            "x: <limit> of joint 'j' has .*effort = -9 .*expected .*no negative limit",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace("</robot>", joint("k", "fixed", "base", "a") + "</robot>")),
            "the link 'a' of x is carried by two joints, 'j' and 'k': expected a tree",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace('type="revolute"', 'type="revolte"')),
            "joint 'j' of x has the type 'revolte': expected one of revolute, continuous",
        ),
        (
            lambda: Arm("x", ONE_LINK.replace("</robot>", '<m:include xmlns:m="http://ros.org/wiki/xacro"/></robot>')),
            "x holds <xacro:include>: expected a plain URDF; expand it first",
        ),
        (lambda: Arm("x", ONE_LINK.replace('type="revolute"', 'type="floating"')), "no joint of x moves"),
        (lambda: Arm("x", ONE_LINK.replace('value="1.0"', 'value="0.0"')), "no link of x has a mass"),
        (lambda: arm("panda").torque(np.zeros(6)), r"panda has 7 joints"),
        (lambda: arm("panda").torque(np.zeros(7), np.zeros(6)), r"panda has 7 joints"),
        (
            lambda: arm("panda").with_links(np.ones((6, 10))),
            r"link parameters have shape \(6, 10\): expected \(7, 10\)",
        ),
    ],
)
def test_errors_are_one_sentence(attempt, says):
    with pytest.raises(ArmError, match=says) as caught:
        attempt()
    assert isinstance(caught.value, ArmloadError)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("read", "kind"), [(arm, ArmError), (read_payload, PayloadError)])
def test_a_file_that_may_not_be_read_is_named_once(tmp_path, monkeypatch, read, kind):
    path = tmp_path / "x.urdf"
    path.write_text("kept for others")

    def denied(*_, **__):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(type(path), "read_text", denied)
    with pytest.raises(kind, match=r"^(robot description|payload file) \S*x\.urdf cannot be read: Permission denied$"):
        read(path)


def test_a_file_that_is_no_description_is_an_arm_error(tmp_path):
    binary = tmp_path / "binary.urdf"
    binary.write_bytes(bytes(range(256)))
    with pytest.raises(ArmError, match="cannot be read as text"):
        arm(binary)
    with pytest.raises(ArmError, match="is a folder: expected the path of a URDF file"):
        arm(tmp_path)
    (tmp_path / "torn.urdf").write_text("<robot", encoding="utf-8")
    with pytest.raises(ArmError, match=r"/torn\.urdf: torn is not a URDF"):
        arm(tmp_path / "torn.urdf")
    with pytest.raises(ArmError, match=r"missing\.urdf is not there: expected the path of a URDF file"):
        arm(tmp_path / "missing.urdf")


@pytest.mark.parametrize("call", ["in_frame", "as_payload", "with_payload"])
def test_a_whole_payload_is_told_to_give_its_parameters(call):
    with pytest.raises(InertiaError, match=r"a Payload was given: .* give its \.parameters"):
        getattr(arm("panda"), call)(franka_hand())


@pytest.mark.parametrize("shape", [(), (6,), (8,), (3, 7), (7, 7)])
def test_the_inertia_of_the_joints_is_of_one_position(shape):
    with pytest.raises(ArmError, match="panda has 7 joints"):
        arm("panda").mass_matrix(np.zeros(shape))


def test_positions_in_three_axes_are_refused():
    with pytest.raises(ArmError, match="panda has 7 joints"):
        arm("panda").torque(np.zeros((2, 7, 7)))


def test_threads_that_share_an_arm_get_the_numbers_that_one_alone_gets():
    """Pinocchio writes into one place and is read after it: not a place that another thread writes into meanwhile."""
    panda = arm("panda")

    def asked(q):
        motion, links = panda.frame_motion(q), panda.link_motions(q)
        return [motion.jacobian, motion.gravity, *panda.frame_pose(q), *panda.momentum(q, q), links[3].jacobian]

    positions = [random_states(7, 1000, seed)[0] for seed in range(4)]
    alone = [asked(q) for q in positions]
    with ThreadPoolExecutor(len(positions)) as pool:
        together = list(pool.map(asked, positions))
    assert all(np.array_equal(x, y) for a, b in zip(alone, together, strict=True) for x, y in zip(a, b, strict=True))


@pytest.mark.parametrize("name", ARMS)
def test_a_description_in_millimetres_is_refused_by_its_lengths(name, tmp_path):
    """Else its torques are called too small: they were "0% of the torque" that it needs to carry itself."""
    (tmp_path / "mine.urdf").write_text(scaled(description_of(name), 1e3))
    with pytest.raises(ArmError, match=r"links of mine are \d+ m long together.*expected 50 m at most.*are these mm\?"):
        arm(tmp_path / "mine.urdf", ARMS[name].flange)


def test_where_an_arm_stands_is_none_of_its_lengths(tmp_path):
    text = description_of("ur10e")
    first = re.search(r'<origin[^>]*xyz="([^"]*)"', text[text.index('<joint name="shoulder_pan_joint"') :])
    (tmp_path / "far.urdf").write_text(text.replace(first[0], first[0].replace(first[1], "200 0 0"), 1))
    assert arm(tmp_path / "far.urdf", "tool0").n == 6


def scaled(text, factor):
    """A description whose lengths are in another unit."""
    numbers = re.compile(r'xyz="([^"]*)"')
    lines = re.sub(
        r"<origin[^>]*>",
        lambda tag: numbers.sub(
            lambda xyz: f'xyz="{" ".join(str(factor * float(x)) for x in xyz[1].split())}"', tag[0]
        ),
        text,
    )
    assert lines != text
    return lines


@pytest.mark.parametrize(
    ("joint", "q", "dq", "allowed"),
    [  # by the formulas of libfranka's rate_limiting.h, joint by joint
        (0, 2.5, 1.0, -0.30 + np.sqrt(12.0 * (2.75010 - 2.5))),
        (0, 2.5, -1.0, 2.62),
        (1, -1.6, -1.0, -0.20 + np.sqrt(5.17 * (1.791800 - 1.6))),
        (2, -2.6, -1.0, -0.20 + np.sqrt(7.00 * (2.906500 - 2.6))),
        (3, -0.4, 1.0, -0.30 + np.sqrt(8.00 * (-0.1458 + 0.4))),
        (3, -2.9, -1.0, -0.30 + np.sqrt(8.00 * (3.048100 - 2.9))),
        (4, 2.6, 1.0, -0.35 + np.sqrt(34.0 * (2.81010 - 2.6))),
        (5, 0.7, -1.0, -0.35 + np.sqrt(11.0 * (-0.54092 + 0.7))),
        (5, 2.5, 1.0, 4.18),
        (6, 3.02, 1.0, 0.0),
    ],
)
def test_an_fr3_may_go_slower_towards_the_ends_of_its_ranges_as_its_maker_says(joint, q, dq, allowed):
    place, speed = np.zeros((1, 7)), np.zeros((1, 7))
    place[0, joint], speed[0, joint] = q, dq
    assert arm("fr3").limits.velocity_at(place, speed)[0, joint] == pytest.approx(allowed, abs=1e-12)


@pytest.mark.parametrize("rows", [((1.0,) * 7,) * 3, ((0.0,) * 7,) * 4, ((1.0,) * 6,) * 4])
def test_ends_of_velocity_limits_that_are_none_are_refused(panda, rows):
    with pytest.raises(ArmError, match="ends of the velocity limits"):
        replace(panda, velocity_ends=rows)
