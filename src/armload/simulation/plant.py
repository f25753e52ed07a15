"""The plant: an arm and its payload as a MuJoCo model under affine joint actuators.

Both engines read the same mesh-free URDF text. The inertial parameters of the moving bodies are then set from
`Arm.link_parameters`, so that replaced links, an attached hand and the payload all enter by one path, about the joint
frames. There are no contacts, no joint limits, no dry friction and no motor inertia: the torque is rigid body only, and
what else a real joint torque carries is added by `simulate.worlds`.

The integrator is `implicitfast`, a semi-implicit Euler step. With actuators of torque ctrl − kp·q − kd·dq it solves

    M(q_j)·(v_{j+1} − v_j)/h + c(q_j, v_j) + g(q_j) = ctrl_j − kp·q_j − kd·v_{j+1},      q_{j+1} = q_j + h·v_{j+1}

because the actuators' damping is implicit. This is a leapfrog: (v_{j+1} − v_j)/h is the central second difference of q
at q_j, and v lives half a step before its q. `simulate.rollout` logs accordingly.

Source: MuJoCo's documentation, chapter Computation, "Numerical integration"; the equation is tested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import ArmError
from armload.inertia import InertialParameters, to_order
from armload.simulation.controller import Gains

if TYPE_CHECKING:
    import mujoco

_NEWTON_STEPS = 20
_TOO_FAST = 100.0  # [rad/s, m/s] ten times what the joints of arms are built for: the integration is not stable
_SETTLED = 1e-9  # [N·m] torque left over at the start
_NUDGE = 1e-6  # [rad] finite difference for the Jacobian of the static balance


@contextmanager
def quiet() -> Iterator[None]:
    """MuJoCo's warnings go nowhere; it writes them into a file MUJOCO_LOG.TXT in the working folder otherwise.

    What they are about does not matter here (a joint whose limits leave it no room) or is found by who simulates (a run
    that diverges).
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)  # noqa: ARG005
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def diverged(dq: NDArray[np.float64]) -> bool:
    """Whether joint velocities (..., n) are no arm's any more, or not finite: MuJoCo integrates on for all that."""
    return not bool((np.abs(dq) < _TOO_FAST).all())


@quiet()
def build_model(arm: Arm, gains: Gains | None = None, step: float = 5e-4) -> mujoco.MjModel:
    """The arm, with all that is attached to it, as a MuJoCo model.

    Args:
        arm: as the world has it: `arm.with_links(...)`, `arm.with_payload(...)`; its gravity counts.
        gains: adds one actuator per joint with torque ctrl − kp·q − kd·dq. None: no actuators.
        step: time step h [s].

    Raises:
        ArmError: MuJoCo refuses the description or its inertias.
    """
    import mujoco

    try:
        spec = mujoco.MjSpec.from_string(arm.urdf)
        _set_inertias(spec, arm)
        for name in arm.joint_names:
            spec.joint(name).actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        if gains is not None:
            _add_actuators(spec, arm, gains)
        spec.option.gravity = arm.gravity
        spec.option.timestep = step
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        # neither contacts nor limits; and a run that diverges must show it instead of starting afresh
        spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        model = spec.compile()
    except ValueError as error:
        raise ArmError(
            f"MuJoCo cannot simulate {arm.name} with these inertias: {' '.join(str(error).split())}; every moving link "
            "needs a mass and an inertia that a body can have (armload.inertia.nearest_consistent makes one)"
        ) from None
    if model.nv != arm.n:
        raise ArmError(f"MuJoCo reads {model.nv} joints from the description of {arm.name}: expected {arm.n}")
    return model


def settled_start(
    model: mujoco.MjModel,
    gains: Gains,
    desired: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    feed_forward: NDArray[np.float64],
    disturbance: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """Where the controller holds the arm at the start, all transients gone: the q (n,) that solves

        ID(q, dq_d, ddq_d) + d(q) = tau_ff + kp·(q_d − q)        (ID: inverse dynamics with the payload)

    by Newton's method. At rest this is the static balance with the payload's sag.

    Args:
        model: from `build_model`.
        desired: q_d, dq_d, ddq_d (n,) each at the start.
        feed_forward: tau_ff (n,) [N·m].
        disturbance: joint torque d(q) (n,) that the arm does not see but the joints must supply.

    Raises:
        ArmError: no balance exists: the load is too heavy for the controller's stiffness.
    """
    import mujoco

    data = mujoco.MjData(model)
    q_d, data_qvel, data_qacc = desired

    def surplus(q: NDArray[np.float64]) -> NDArray[np.float64]:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, data_qvel, data_qacc
        mujoco.mj_inverse(model, data)
        extra = 0.0 if disturbance is None else disturbance(q)
        return data.qfrc_inverse + extra - feed_forward - gains.stiffness * (q_d - q)

    q = np.array(q_d)
    for _ in range(_NEWTON_STEPS):
        error = surplus(q)
        if np.max(np.abs(error)) < _SETTLED:
            return q
        nudges = _NUDGE * np.eye(model.nv)
        jacobian = np.stack([(surplus(q + nudge) - error) / _NUDGE for nudge in nudges], axis=1)
        q = q - np.linalg.solve(jacobian, error)
    raise ArmError(
        "the arm does not settle at the start of the motion: the payload is too heavy for the controller's stiffness "
        f"(torque left over: {np.max(np.abs(error)):.3g} N·m)"
    )


def _set_inertias(spec: mujoco.MjSpec, arm: Arm) -> None:
    """Write Arm.link_parameters into the moving bodies; fixed bodies, already counted in there, become massless."""
    links = dict(zip(arm.joint_names, arm.link_parameters, strict=True))
    for body in spec.bodies[1:]:  # the first is the world
        body.explicitinertial = True
        body.mass, body.ipos, body.iquat, body.inertia = 0.0, np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(3)
        if body.joints:
            numbers = to_order(InertialParameters(links[body.joints[0].name]), "mujoco")
            body.mass, body.ipos, body.fullinertia = numbers[0], numbers[1:4], numbers[4:]


def _add_actuators(spec: mujoco.MjSpec, arm: Arm, gains: Gains) -> None:
    """One general actuator per joint, in the joints' order: gain 1, bias (0, −kp, −kd)."""
    import mujoco

    for name, kp, kd in zip(arm.joint_names, gains.stiffness, gains.damping, strict=True):
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0] = 1.0
        actuator.biasprm[:3] = [0.0, -kp, -kd]
