"""The arm under joint torque control at 1 kHz: how a model-based controller moves with the payload it assumes.

At every step a law reads (t, q, dq) and commands the torque that the joints' sensors are to show. The torque loop in
the joints is ideal, so that a sensor's offset and the friction enter the motion as they do on a real arm:

    gain·[rigid body + friction(dq) + residual(q)] + offset = tau_command        [N·m]
    rigid body = M(q)·ddq + c(q, dq) + g(q) − tau_ext                            (with the payload)

Runs under stiff position control are `simulate`'s. Here the plant (MuJoCo, one semi-implicit step a period, see
`simulate.plant`) is called step by step: q is read at t_j, dq is the encoders' difference (q_j − q_{j−1})/h. A law that
takes its reference from the same differences is followed exactly, M·(v_{j+1} − v_j)/h + c(q_j, v_j) + g(q_j) = tau_j,
so that with the exact model nothing is left of the tracking error but rounding. Friction acts implicitly in velocity.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import ArmError
from armload.recording import Recording
from armload.simulation.plant import build_model, diverged, quiet
from armload.simulation.rollout import Clock, coriolis_missed
from armload.simulation.runs import payload_parameters
from armload.simulation.torque_laws import Law
from armload.simulation.worlds import World


@dataclass(frozen=True, eq=False)
class TorqueRun:
    """What happened under torque control, noise-free, one row per period of the loop.

    recording: t, q, dq and what the torque sensors show.
    command: what the law asked for, within the limits (N, n) [N·m].
    external: joint torque from outside (N, n) [N·m].
    acceleration: (v_{j+1} − v_j)/h (N, n) [rad/s²].
    """

    recording: Recording
    command: NDArray[np.float64] = field(repr=False)
    external: NDArray[np.float64] = field(repr=False)
    acceleration: NDArray[np.float64] = field(repr=False)


def torque_controlled(
    arm: Arm,
    law: Law,
    start: ArrayLike,
    duration: float,
    payload: Any | None = None,
    *,
    world: World | None = None,
    external: Law | None = None,
    rate: float = 1000.0,
    settle: float = 0.0,
) -> TorqueRun:
    """Let a law drive the arm by joint torque.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> from armload.simulation import JointImpedance
    >>> panda, motion = arm("panda"), taie2024()
    >>> run = torque_controlled(panda, JointImpedance(panda, motion), motion.position([0.0])[0], 0.5)
    >>> bool(np.abs(run.recording.q - motion.position(run.recording.t)).max() < 1e-9)
    True

    Args:
        arm: the nominal arm; what the controller makes of it is the law's.
        law: (t, q, dq) → commanded torque (n,); limited to the arm's efforts.
        start: q (n,) at rest [rad].
        duration: of the log [s].
        payload: what the arm really holds, about its payload frame; None: nothing.
        world: the arm as it really is; None: nominal.
        external: (t, q, dq) → joint torque from outside (n,), Jᵀ·wrench of a person, say; None: nothing touches.
        rate: of the loop and of the log [Hz].
        settle: the loop runs so long before the log begins, at negative t [s].

    Raises:
        ArmError: the start does not fit the arm, the arm runs away, or MuJoCo cannot simulate the arm.
        PayloadError: the payload is not made of ten inertial parameters.
    """
    import mujoco

    q = np.array(start, dtype=float)
    if q.shape != (arm.n,):
        raise ArmError(f"the start has shape {q.shape}: expected ({arm.n},), the joints of {arm.name}")
    world = world or World.nominal(arm)
    held, actual = payload_parameters(payload, arm), world.arm(arm)
    h, effort = float(1.0 / rate), arm.limits.effort
    model = build_model(actual if held is None else actual.with_payload(held), None, h)
    if world.rotor_inertia is not None:
        model.dof_armature[:] = world.rotor_inertia
    data = mujoco.MjData(model)
    data.qpos[:] = q
    before, count = round(settle * rate), round(duration * rate)
    times = h * np.arange(-before, count, dtype=float)
    gain = np.ones(arm.n) if world.gain is None else world.gain
    offset = world.measured(np.zeros((len(times), arm.n)), np.maximum(times, 0.0))
    rows = np.zeros((6, len(times), arm.n))  # q, v, v after, rigid-body torque, command, external
    lost = np.zeros(arm.n)
    for k, t in enumerate(times.tolist()):
        q, v = data.qpos.copy(), data.qvel.copy()
        if diverged(v):
            raise ArmError(
                f"the simulated {arm.name} ran away at {t:.3f} s: its law or its gains do not suit its links"
            )
        command = np.clip(law(t, q, v), -effort, effort)
        outside = np.zeros(arm.n) if external is None else external(t, q, v)
        joint = (command - offset[k]) / gain
        lost, slope = _lost(world, q, v, joint - lost)
        model.dof_damping[:] = slope  # implicit: the friction that acts is lost + slope·(v after − v)
        data.qfrc_applied[:] = joint - lost + slope * v + outside
        with quiet():
            mujoco.mj_step(model, data)
        rows[:, k] = q, v, data.qvel, joint - lost - slope * (data.qvel - v), command, outside
    model.dof_damping[:] = 0.0
    q, v, after, rigid, command, outside = rows[:, before:]
    dq, t = 0.5 * (v + after), times[before:]
    rigid = rigid + coriolis_missed(model, Clock(h, 1, count), q, v, after)
    tau = world.measured(rigid + world.disturbance(q, dq, rigid), t) + world.sticking(0)(dq)
    log = Recording(t, q, dq, tau, joint_names=arm.joint_names, source=f"simulated {arm.name}, torque-controlled")
    return TorqueRun(log, command, outside, (after - v) * rate)


def _lost(
    world: World, q: NDArray[np.float64], v: NDArray[np.float64], torque: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Friction and residual (n,) [N·m], and how the friction grows with velocity (n,), at least 0 [N·m·s/rad]."""
    if not world.disturbed:
        return np.zeros_like(q), np.zeros_like(q)
    friction, slope = world.friction.with_slope(v, torque)
    residual = 0.0 if world.residual is None else world.residual(q)[0]
    return friction + residual, slope
