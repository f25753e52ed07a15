"""MuJoCo and Pinocchio, two engines written by different people, agree on every shipped arm."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from armload.arms import Arm
from armload.inertia import InertialParameters, to_order
from armload.simulation import World, build_model

TOLERANCE = 1e-9  # [N·m], [kg·m²]
PAYLOAD = InertialParameters.from_com(
    1.7, (0.03, -0.02, 0.09), [[9e-3, 1e-3, -2e-3], [1e-3, 7e-3, 5e-4], [-2e-3, 5e-4, 8e-3]]
)
TILTED = (3.0, -2.0, -9.1)


def as_written(arm: Arm, payload: InertialParameters | None = None) -> mujoco.MjModel:
    """MuJoCo's own reading of the URDF, the payload a body of its own welded to the frame, inertia about its CoM."""
    spec = mujoco.MjSpec.from_string(arm.urdf)
    spec.option.gravity = arm.gravity
    if payload is not None:
        body = spec.body(arm.frame).add_body(name="payload")
        numbers = to_order(payload, "mujoco")
        body.explicitinertial = True
        body.mass, body.ipos, body.fullinertia = numbers[0], numbers[1:4], numbers[4:]
    return spec.compile()


def assert_same_dynamics(model: mujoco.MjModel, arm: Arm) -> None:
    rng = np.random.default_rng(7)
    data, M = mujoco.MjData(model), np.zeros((arm.n, arm.n))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    for q, dq, ddq in rng.uniform(-2.5, 2.5, size=(20, 3, arm.n)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, arm.torque(q, dq, ddq), rtol=0, atol=TOLERANCE)
        mujoco.mj_fullM(model, data, M)
        np.testing.assert_allclose(M, arm.mass_matrix(q), rtol=0, atol=TOLERANCE)
        data.qvel[:] = data.qacc[:] = 0.0
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, arm.torque(q), rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), TILTED], ids=["upright", "tilted"])
@pytest.mark.parametrize("payload", [None, PAYLOAD], ids=["bare", "loaded"])
def test_engines_agree_on_the_urdf_as_written(every_arm, payload, gravity):
    arm = replace(every_arm, gravity=gravity)
    loaded = arm if payload is None else arm.with_payload(payload)
    assert_same_dynamics(as_written(arm, payload), loaded)


@pytest.mark.parametrize("payload", [None, PAYLOAD], ids=["bare", "loaded"])
def test_plant_is_the_urdf_with_the_payload_welded_on(every_arm, payload):
    arm = replace(every_arm, gravity=TILTED)
    loaded = arm if payload is None else arm.with_payload(payload)
    plant, welded = build_model(loaded), as_written(arm, payload)
    data, other = mujoco.MjData(plant), mujoco.MjData(welded)
    rng = np.random.default_rng(3)
    for q, dq in rng.uniform(-2.0, 2.0, size=(10, 2, arm.n)):
        for d, model in ((data, plant), (other, welded)):
            d.qpos[:], d.qvel[:] = q, dq
            mujoco.mj_forward(model, d)
        np.testing.assert_allclose(data.qfrc_bias, other.qfrc_bias, rtol=0, atol=TOLERANCE)
    assert_same_dynamics(plant, loaded)


def test_payloads_add_like_masses_in_mujoco(every_arm):
    other = InertialParameters.from_com(0.4, (-0.05, 0.0, 0.02), np.diag([1e-3, 2e-3, 2e-3]))
    spec = mujoco.MjSpec.from_string(every_arm.urdf)
    for name, payload in (("one", PAYLOAD), ("two", other)):
        body = spec.body(every_arm.frame).add_body(name=name)
        numbers = to_order(payload, "mujoco")
        body.explicitinertial = True
        body.mass, body.ipos, body.fullinertia = numbers[0], numbers[1:4], numbers[4:]
    assert_same_dynamics(spec.compile(), every_arm.with_payload(PAYLOAD + other))


def test_engines_agree_on_replaced_links_under_a_payload(every_arm):
    world = World.real_like(every_arm, seed=4)
    actual = every_arm.with_links(world.links).with_payload(PAYLOAD)
    assert_same_dynamics(build_model(actual), actual)


def test_mass_on_a_fixed_joint_counts_once(panda):
    inertial = (
        '<inertial><origin xyz="0.01 0.02 0.03" rpy="0.3 0.2 0.1"/><mass value="0.9"/>'
        '<inertia ixx="0.002" ixy="0.0002" ixz="0" iyy="0.003" iyz="0" izz="0.0025"/></inertial>'
    )
    text = panda.urdf.replace('<link name="panda_link8" />', f'<link name="panda_link8">{inertial}</link>')
    assert text != panda.urdf
    arm = Arm("panda with a flange", text, "panda_link8")
    assert_same_dynamics(as_written(arm), arm)
    plant = build_model(arm)
    assert_same_dynamics(plant, arm)
    assert plant.body_mass.sum() == pytest.approx(panda.link_parameters[:, 0].sum() + 0.9)
