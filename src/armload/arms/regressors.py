"""The regressors: how payload (and link) parameters enter the joint torques, linearly.

All are written for N samples at once. nu = (omega, v) is the twist of a body frame in its own axes, J its body Jacobian
(angular rows first), g_b gravity in its axes. With A_h(nu)·phi the body's spatial momentum and A_g(g_b)·phi the wrench
needed against gravity,

    A_h = [[0, −[v]×, L(omega)], [v, [omega]×, 0]]      A_g = [[0, [g_b]×, 0], [−g_b, 0, 0]]      (6, 10)

where L(omega)·vech(I) = I·omega. Sources: Niemeyer & Slotine, IJRR 1991; Haddadin, De Luca, Albu-Schäffer, T-RO 2017.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms.model import Arm
from armload.arms.rigid_body import BodyMotion
from armload.errors import ArmError
from armload.inertia import inertia_matrix, skew
from armload.runtime.real_numbers import reals

# L(omega)·vech(I) = I·omega: the constant tensor (3, 6, 3)
_L = np.moveaxis(inertia_matrix(np.eye(6)), 0, 1)


class MomentumRegressor(NamedTuple):
    """tau = d/dt(Y_p·phi) + (Y_g − Y_c)·phi: a body's torque without any acceleration; each (N, n, 10)."""

    momentum: NDArray[np.float64]  # Y_p = Jᵀ·A_h
    drift: NDArray[np.float64]  # Y_g − Y_c


def payload_regressor(motion: BodyMotion, dq: ArrayLike, ddq: ArrayLike) -> NDArray[np.float64]:
    """Y (N, n, 10): tau_L = Y(q, dq, ddq)·phi, what the joints must add for the payload (the paper's B, eq. 4).

    The spatial Newton–Euler equation f = A_h(a) + nu ×* A_h(nu) + A_g, with spatial acceleration a = J·ddq + J̇·dq.

    Args:
        motion: the payload frame's motion, from `Arm.frame_motion(q)`.
        dq, ddq: (N, n) [rad/s, rad/s²].

    Raises:
        ArmError: no numbers, or of other samples or joints.
    """
    J = motion.jacobian
    dq, ddq = _rows(motion, dq), _rows(motion, ddq)
    nu, J_tilde = _twist_and_jacobian_rate(J, dq)
    J_dot = J_tilde - _motion_cross(nu[:, :, None], J)
    a = np.einsum("tij,tj->ti", J, ddq) + np.einsum("tij,tj->ti", J_dot, dq)
    V = _momentum_matrix(a) + _force_cross(nu) @ _momentum_matrix(nu) + _gravity_matrix(motion.gravity)
    return np.swapaxes(J, 1, 2) @ V


def momentum_regressor(motion: BodyMotion, dq: ArrayLike) -> MomentumRegressor:
    """Y_p and Y_g − Y_c of a body: tau = d/dt(Y_p·phi) − Y_c·phi + Y_g·phi, with no acceleration anywhere.

    Y_p = Jᵀ·A_h(nu), Y_c = J̃ᵀ·A_h(nu), Y_g = Jᵀ·A_g(g_b), where J̃_j = nu_j × J_j and nu_j is the twist of link j seen
    at the body's frame (J̃ = J̇ + nu × J).

    Args:
        motion: the body's motion, from `Arm.frame_motion(q)` or one of `Arm.link_motions(q)`.
        dq: (N, n) [rad/s].

    Raises:
        ArmError: no numbers, or of other samples or joints.
    """
    J = motion.jacobian
    nu, J_tilde = _twist_and_jacobian_rate(J, _rows(motion, dq))
    A_h, Jt = _momentum_matrix(nu), np.swapaxes(J, 1, 2)
    return MomentumRegressor(Jt @ A_h, Jt @ _gravity_matrix(motion.gravity) - np.swapaxes(J_tilde, 1, 2) @ A_h)


def full_arm_regressor(arm: Arm, q: ArrayLike, dq: ArrayLike) -> MomentumRegressor:
    """Y_p and Y_g − Y_c (N, n, 10·n) over the inertial parameters of all moving links (`Arm.link_parameters`)."""
    parts = [momentum_regressor(motion, dq) for motion in arm.link_motions(np.atleast_2d(q))]
    return MomentumRegressor(
        np.concatenate([part.momentum for part in parts], axis=2),
        np.concatenate([part.drift for part in parts], axis=2),
    )


def leaning_torque(arm: Arm, q: ArrayLike) -> NDArray[np.float64]:
    """How the arm's own torque (N, n, 2) changes as gravity is turned about the axes of `Arm.horizontal` [N·m/rad]."""
    change = np.cross(arm.horizontal, arm.gravity)  # (2, 3) [m/s²/rad]
    weights = [replace(arm, gravity=tuple(np.asarray(arm.gravity) + sign * g)) for g in change for sign in (0.5, -0.5)]
    up, down, up_too, down_too = (other.torque(np.atleast_2d(q)) for other in weights)
    return np.stack([up - down, up_too - down_too], axis=2)


def _rows(motion: BodyMotion, values: ArrayLike) -> NDArray[np.float64]:
    """Joint velocities or accelerations (N, n) of the samples of a motion, or (1, n) of all of them."""
    samples, _, joints = motion.jacobian.shape
    try:
        out = np.atleast_2d(reals(values))
    except ValueError as error:
        raise ArmError(f"joint rates are {error}: expected real numbers ({samples}, {joints})") from None
    if out.shape not in ((samples, joints), (1, joints)):
        raise ArmError(f"joint rates have shape {out.shape}: expected ({samples}, {joints}) as the motion has")
    return out


def _twist_and_jacobian_rate(J: NDArray, dq: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    twists = np.cumsum(J * dq[:, None, :], axis=2)  # nu_j, (N, 6, n)
    return twists[:, :, -1], _motion_cross(twists, J)


def _motion_cross(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Spatial cross product a × b of twists stacked along axis 1."""
    angular = np.cross(a[:, :3], b[:, :3], axis=1)
    linear = np.cross(a[:, :3], b[:, 3:], axis=1) + np.cross(a[:, 3:], b[:, :3], axis=1)
    return np.concatenate([angular, linear], axis=1)


def _force_cross(nu: NDArray) -> NDArray[np.float64]:
    """nu ×* as a matrix (N, 6, 6) on momenta and wrenches (angular rows first)."""
    out = np.zeros((len(nu), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = skew(nu[:, :3])
    out[:, :3, 3:] = skew(nu[:, 3:])
    return out


def _momentum_matrix(twist: NDArray) -> NDArray[np.float64]:
    """A_h (N, 6, 10)."""
    omega, v = twist[:, :3], twist[:, 3:]
    A = np.zeros((len(twist), 6, 10))
    A[:, :3, 1:4] = -skew(v)
    A[:, :3, 4:] = np.einsum("ikj,tj->tik", _L, omega)
    A[:, 3:, 0] = v
    A[:, 3:, 1:4] = skew(omega)
    return A


def _gravity_matrix(gravity: NDArray) -> NDArray[np.float64]:
    """A_g (N, 6, 10)."""
    A = np.zeros((len(gravity), 6, 10))
    A[:, :3, 1:4] = skew(gravity)
    A[:, 3:, 0] = -gravity
    return A
