"""Pinocchio's model of an arm, from its description and the inertial parameters that take the place of the URDF's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armload.arms.parser_log import caught_parser_errors
from armload.errors import ArmError
from armload.inertia import InertialParameters, from_order, to_order


class BodyMotion(NamedTuple):
    """How a body frame moves with the joints, for N samples of an arm with n joints.

    jacobian: body Jacobian J (N, 6, n), angular rows first: twist (omega, v) = J·dq in the frame's axes.
    gravity: gravity g_b (N, 3) in the frame's axes [m/s²].
    """

    jacobian: NDArray[np.float64]
    gravity: NDArray[np.float64]


class Body(NamedTuple):
    """A frame fixed to a moving link: the link's joint (1 … n), rotation (3, 3) and translation (3,) [m] from there."""

    joint: int
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]


def built(
    name: str,
    urdf: str,
    joint_names: Sequence[str],
    frame: str,
    gravity: Sequence[float],
    links: NDArray[np.float64] | None,
    attached: InertialParameters | None,
) -> pin.Model:
    """The model of a serial chain.

    Args:
        name: for messages. urdf: text. joint_names: of the chain, in order. frame: behind its last joint.
        gravity: (3,) [m/s²]. links: (n, 10) parameters in place of the URDF's. attached: a payload about the frame.

    Raises:
        ArmError: the description cannot be used, is no serial chain of 1-axis joints, or no link has a mass.
    """
    messages: list[str] = []
    try:
        with caught_parser_errors() as messages:
            model = pin.buildModelFromXML(urdf)
    except (ValueError, RuntimeError) as error:
        reason = messages[0] if messages else " ".join(str(error).split())
        raise ArmError(f"the description of {name} cannot be used: {reason}") from None
    n = len(joint_names)
    if model.nv != n or list(model.names[1:]) != list(joint_names):
        raise ArmError(f"{name} is not a serial chain of 1-axis joints to the frame {frame!r}")
    model.gravity.linear = np.array(gravity)
    if links is not None:
        for k, phi in enumerate(links, start=1):
            model.inertias[k] = _inertia(InertialParameters(phi))
    if attached is not None:
        placement = placement_of(model, frame)
        moved = attached.moved(placement.rotation, placement.translation)
        last = from_order(model.inertias[n].toDynamicParameters(), "pinocchio")
        model.inertias[n] = _inertia(last + moved)  # added as numbers: a payload may weigh nothing
    if not any(model.inertias[k].mass > 0 for k in range(1, n + 1)):
        raise ArmError(f"no link of {name} has a mass: expected a URDF with <inertial> elements")
    return model


def placement_of(model: pin.Model, frame: str) -> pin.SE3:
    """Where a frame lies behind its joint."""
    return model.frames[model.getFrameId(frame, pin.FrameType.BODY)].placement


def carrier_pose(model: pin.Model) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (3, 3) and position (3,) [m] in the root of the link that carries the first joint."""
    joint = model.frames[model.getFrameId(model.names[1], pin.FrameType.JOINT)]
    carrier = model.frames[joint.parentFrame].placement
    return carrier.rotation.copy(), carrier.translation.copy()


def body_motions(
    model: pin.Model, data: pin.Data, gravity: Sequence[float], q: NDArray[np.float64], bodies: Sequence[Body]
) -> list[BodyMotion]:
    """Jacobian and gravity in the axes of each body, for samples q (N, n) [rad]."""
    N, n = q.shape
    J = np.empty((N, 6, n))  # world frame, linear rows first
    joints = {body.joint: (np.empty((N, 3, 3)), np.empty((N, 3))) for body in bodies}
    for k in range(N):
        J[k] = pin.computeJointJacobians(model, data, q[k]).reshape(6, n)  # one joint: pin gives a vector
        for joint, (R, p) in joints.items():
            placement = data.oMi[joint]
            R[k], p[k] = placement.rotation, placement.translation
    linear, angular = J[:, :3], J[:, 3:]
    out = []
    for joint, rotation, translation in bodies:
        R, p = joints[joint][0] @ rotation, joints[joint][1] + joints[joint][0] @ translation
        at_body = linear + np.cross(angular, p[:, :, None], axis=1)  # v_p = v_0 + omega × p
        Rt = np.swapaxes(R, 1, 2)
        jacobian = np.concatenate([Rt @ angular, Rt @ at_body], axis=1)  # (N, 6, n)
        jacobian[:, :, joint:] = 0.0  # joints beyond the body do not move it
        out.append(BodyMotion(jacobian, Rt @ np.array(gravity)))
    return out


def _inertia(parameters: InertialParameters) -> pin.Inertia:
    if parameters.mass == 0.0:  # Pinocchio keeps the CoM, which a massless body does not have
        if np.any(parameters.first_moment):
            raise ArmError("a link without mass has a first moment: Pinocchio cannot hold such a body; give it a mass")
        return pin.Inertia(0.0, np.zeros(3), parameters.inertia)
    return pin.Inertia.FromDynamicParameters(to_order(parameters, "pinocchio"))
