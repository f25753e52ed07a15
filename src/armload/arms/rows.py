"""The momentum form of one sample at a time, for a live robot: the same numbers as `regressors`, at its pace.

With j = (a, l) a column of a body's Jacobian, nu = (omega, v) its twist and g gravity, all in its axes,

    jᵀ·A_h(nu) = [l·v,   v × a + l × omega,   aᵀ·L(omega)]          jᵀ·A_g(g) = [−l·g,   a × g,   0]

Pinocchio gives the joints' Jacobian and the poses, compiled loops the rest.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numba import njit
from numpy.typing import NDArray

from armload.arms.model import Arm


class MomentumRow:
    """Y_p and Y_g − Y_c of the payload frame and of all moving links, for one sample at a time.

    >>> from armload.arms import arm
    >>> momentum, drift = MomentumRow(arm("panda"))(np.zeros(7), np.zeros(7))
    >>> momentum.shape, drift.shape
    ((7, 80), (7, 80))

    Args:
        arm: the arm; its model and data are the row's own, so that rows may be computed beside other work.
    """

    def __init__(self, arm: Arm) -> None:
        n = arm.n
        self.arm, self._model = arm, arm._model.copy()
        self._data = self._model.createData()
        placement = arm._frame_placement
        self._rotation, self._translation = placement.rotation.copy(), placement.translation.copy()
        self._gravity = np.array(arm.gravity)
        self._R, self._p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
        self._joints = np.array([n, *range(1, n + 1)])

    def __call__(self, q: NDArray, dq: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Y_p and Y_g − Y_c (n, 10 + 10·n): payload first, then the links; q, dq (n,) [rad, rad/s]."""
        n = self.arm.n
        J = pin.computeJointJacobians(self._model, self._data, q).reshape(6, n)
        oMi, R, p = self._data.oMi, self._R, self._p
        for k in range(1, n + 1):
            pose = oMi[k]
            R[k], p[k] = pose.rotation, pose.translation
        R[0] = R[n] @ self._rotation
        p[0] = p[n] + R[n] @ self._translation
        return _momentum_rows(np.ascontiguousarray(J), R, p, self._joints, self._gravity, dq)


@njit(cache=True, nogil=True)
def _cross(a, b, out):  # pragma: no cover - compiled
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def _momentum_rows(J, R, p, joints, gravity, dq):  # pragma: no cover - compiled
    n, bodies = dq.shape[0], joints.shape[0]
    momentum, drift = np.zeros((n, 10 * bodies)), np.zeros((n, 10 * bodies))
    angular, linear, twist = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 6))
    g, x, y, z = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    rate_a, rate_l = np.empty(3), np.empty(3)
    for b in range(bodies):
        m, first = joints[b], 10 * b
        for i in range(3):
            g[i] = R[b, 0, i] * gravity[0] + R[b, 1, i] * gravity[1] + R[b, 2, i] * gravity[2]
        for i in range(6):
            twist[0, i] = 0.0
        for c in range(m):
            _cross(J[3:, c], p[b], x)  # v_p = v_0 + omega × p
            for i in range(3):
                x[i] += J[i, c]
            for i in range(3):
                angular[c, i] = R[b, 0, i] * J[3, c] + R[b, 1, i] * J[4, c] + R[b, 2, i] * J[5, c]
                linear[c, i] = R[b, 0, i] * x[0] + R[b, 1, i] * x[1] + R[b, 2, i] * x[2]
                if c > 0:
                    twist[c, i], twist[c, 3 + i] = twist[c - 1, i], twist[c - 1, 3 + i]
                else:
                    twist[c, i], twist[c, 3 + i] = 0.0, 0.0
                twist[c, i] += angular[c, i] * dq[c]
                twist[c, 3 + i] += linear[c, i] * dq[c]
        omega, v = twist[m - 1, :3].copy(), twist[m - 1, 3:].copy()
        for c in range(m):
            a, l = angular[c], linear[c]  # noqa: E741
            _project(a, l, omega, v, momentum[c, first : first + 10], 1.0, x, y)
            # −J̃ᵀ·A_h, J̃ = nu_c × j
            _cross(twist[c, :3], a, rate_a)
            _cross(twist[c, :3], l, rate_l)
            _cross(twist[c, 3:], a, z)
            for i in range(3):
                rate_l[i] += z[i]
            _project(rate_a, rate_l, omega, v, drift[c, first : first + 10], -1.0, x, y)
            drift[c, first] -= l[0] * g[0] + l[1] * g[1] + l[2] * g[2]
            _cross(a, g, x)
            for i in range(3):
                drift[c, first + 1 + i] += x[i]
    return momentum, drift


@njit(cache=True, nogil=True)
def _project(a, l, omega, v, out, sign, x, y):  # noqa: E741  # pragma: no cover - compiled
    out[0] = sign * (l[0] * v[0] + l[1] * v[1] + l[2] * v[2])
    _cross(v, a, x)
    _cross(l, omega, y)
    for i in range(3):
        out[1 + i] = sign * (x[i] + y[i])
    out[4] = sign * a[0] * omega[0]
    out[5] = sign * (a[0] * omega[1] + a[1] * omega[0])
    out[6] = sign * (a[0] * omega[2] + a[2] * omega[0])
    out[7] = sign * a[1] * omega[1]
    out[8] = sign * (a[1] * omega[2] + a[2] * omega[1])
    out[9] = sign * a[2] * omega[2]
