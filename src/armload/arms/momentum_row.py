"""The momentum form of one sample at a time, for a live robot: the same numbers as `regressors`, at its pace.

With j = (a, l) a column of a body's Jacobian, nu = (omega, v) its twist and g gravity, all in its axes,

    jᵀ·A_h(nu) = [l·v,   v × a + l × omega,   aᵀ·L(omega)]          jᵀ·A_g(g) = [−l·g,   a × g,   0]

A joint's axis and the placement before it come from Pinocchio; poses, Jacobian and rows are compiled loops, as handing
over one pose from Pinocchio to Python costs a microsecond.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armload.arms import Arm
from armload.runtime.kernels import kernel


class MomentumRow:
    """Y_p and Y_g − Y_c of the payload frame and of all moving links, for one sample at a time.

    >>> from armload.arms import arm
    >>> momentum, drift = MomentumRow(arm("panda"))(np.zeros(7), np.zeros(7))
    >>> momentum.shape, drift.shape
    ((7, 80), (7, 80))

    Args:
        arm: the arm.

    Attributes:
        chain: what `momentum_rows` needs of the arm: rotations and translations of the placements, axes of the joints,
            which of them turn, gravity.
    """

    def __init__(self, arm: Arm) -> None:
        model, rest, flange = arm._model, np.zeros(arm.n), arm._frame_placement
        data = model.createData()
        J = pin.computeJointJacobians(model, data, rest).reshape(6, arm.n)  # about the base's origin, linear rows first
        turning = np.any(J[3:] != 0.0, axis=0)
        along = np.where(turning, J[3:], J[:3])
        axes = [data.oMi[k + 1].rotation.T @ along[:, k] for k in range(arm.n)]
        before = [model.jointPlacements[k + 1] for k in range(arm.n)]
        self.arm = arm
        self.chain = (
            np.array([*(x.rotation for x in before), flange.rotation]),
            np.array([*(x.translation for x in before), flange.translation]),
            np.array(axes),
            turning,
            np.array(arm.gravity),
        )

    def __call__(self, q: NDArray, dq: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Y_p and Y_g − Y_c (n, 10 + 10·n): payload first, then the links; q, dq (n,) [rad, rad/s]."""
        return momentum_rows(*self.chain, q, dq)


@kernel
def _cross(a, b, out):  # pragma: no cover - compiled
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def _moved(R, p, rotation, translation, R_out, p_out):  # pragma: no cover - compiled
    """The pose (R, p) followed by a placement; p_out may be p."""
    for i in range(3):
        p_out[i] = p[i] + R[i, 0] * translation[0] + R[i, 1] * translation[1] + R[i, 2] * translation[2]
        for j in range(3):
            R_out[i, j] = R[i, 0] * rotation[0, j] + R[i, 1] * rotation[1, j] + R[i, 2] * rotation[2, j]


@kernel
def _poses(rotations, translations, axes, turning, q, R, p, lines):  # pragma: no cover - compiled
    """Poses of the payload frame and the joints, R (n + 1, 3, 3) and p (n + 1, 3), and the joints' axes (n, 3)."""
    n = q.shape[0]
    placed, joint, shift = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(3):  # of the base, until the end
        p[0, i] = 0.0
        for j in range(3):
            R[0, i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        _moved(R[k], p[k], rotations[k], translations[k], placed, p[k + 1])
        a, sin, cos = axes[k], 0.0, 1.0
        if turning[k]:
            sin, cos = np.sin(q[k]), np.cos(q[k])
        for i in range(3):
            shift[i] = 0.0 if turning[k] else q[k] * a[i]
            for j in range(3):
                joint[i, j] = (1.0 - cos) * a[i] * a[j]
        for i in range(3):
            joint[i, i] += cos
            joint[(i + 2) % 3, (i + 1) % 3] += sin * a[i]
            joint[(i + 1) % 3, (i + 2) % 3] -= sin * a[i]
        _moved(placed, p[k + 1], joint, shift, R[k + 1], p[k + 1])
        for i in range(3):
            lines[k, i] = placed[i, 0] * a[0] + placed[i, 1] * a[1] + placed[i, 2] * a[2]
    _moved(R[n], p[n], rotations[n], translations[n], R[0], p[0])


@kernel
def momentum_rows(rotations, translations, axes, turning, gravity, q, dq):  # pragma: no cover - compiled
    n = dq.shape[0]
    bodies = n + 1
    R, p, lines = np.empty((bodies, 3, 3)), np.empty((bodies, 3)), np.empty((n, 3))
    _poses(rotations, translations, axes, turning, q, R, p, lines)
    momentum, drift = np.zeros((n, 10 * bodies)), np.zeros((n, 10 * bodies))
    angular, linear, twist = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 6))
    g, x, y, z = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    rate_a, rate_l = np.empty(3), np.empty(3)
    for b in range(bodies):
        m, first = b if b > 0 else n, 10 * b
        for i in range(3):
            g[i] = R[b, 0, i] * gravity[0] + R[b, 1, i] * gravity[1] + R[b, 2, i] * gravity[2]
        for i in range(6):
            twist[0, i] = 0.0
        for c in range(m):
            for i in range(3):  # a point of the axis stands still: v_p = omega × (p − p_c)
                y[i], z[i] = (lines[c, i], p[b, i] - p[c + 1, i]) if turning[c] else (0.0, 0.0)
            _cross(y, z, x)
            for i in range(3):
                if not turning[c]:
                    x[i] = lines[c, i]
            for i in range(3):
                angular[c, i] = R[b, 0, i] * y[0] + R[b, 1, i] * y[1] + R[b, 2, i] * y[2]
                linear[c, i] = R[b, 0, i] * x[0] + R[b, 1, i] * x[1] + R[b, 2, i] * x[2]
                if c > 0:
                    twist[c, i], twist[c, 3 + i] = twist[c - 1, i], twist[c - 1, 3 + i]
                else:
                    twist[c, i], twist[c, 3 + i] = 0.0, 0.0
                twist[c, i] += angular[c, i] * dq[c]
                twist[c, 3 + i] += linear[c, i] * dq[c]
        omega, v = twist[m - 1, :3], twist[m - 1, 3:]
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


@kernel
def leaning_row(rotations, translations, axes, turning, turned, links, q):  # pragma: no cover - compiled
    """Torque (n, K) that holds the links (10·n,) against each of K accelerations of gravity `turned` (K, 3) alone."""
    n, K = q.shape[0], len(turned)
    R, p, lines = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n, 3))
    _poses(rotations, translations, axes, turning, q, R, p, lines)
    out, mass, moment = np.empty((n, K)), 0.0, np.zeros(3)  # of all links from a joint on, about the base's origin
    arm, force, x = np.empty(3), np.empty(3), np.empty(3)
    for c in range(n - 1, -1, -1):
        m, h = links[10 * c], links[10 * c + 1 : 10 * c + 4]
        mass += m
        for i in range(3):
            moment[i] += m * p[c + 1, i] + R[c + 1, i, 0] * h[0] + R[c + 1, i, 1] * h[1] + R[c + 1, i, 2] * h[2]
            arm[i] = moment[i] - mass * p[c + 1, i]
        for k in range(K):
            _cross(arm, turned[k], x)
            for i in range(3):
                force[i] = x[i] if turning[c] else mass * turned[k, i]
            out[c, k] = -(lines[c, 0] * force[0] + lines[c, 1] * force[1] + lines[c, 2] * force[2])
    return out


@kernel
def wrench_row(rotations, translations, axes, turning, q):  # pragma: no cover - compiled
    """Jᵀ (n, 6): torque of each joint by a unit force and a unit moment on the payload frame, in the base's axes."""
    n = q.shape[0]
    R, p, lines = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n, 3))
    _poses(rotations, translations, axes, turning, q, R, p, lines)
    out, arm = np.zeros((n, 6)), np.empty(3)
    for c in range(n):
        if turning[c]:
            for i in range(3):
                arm[i], out[c, 3 + i] = p[0, i] - p[c + 1, i], lines[c, i]
            _cross(lines[c], arm, out[c, :3])
        else:
            out[c, :3] = lines[c]
    return out


@kernel
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
