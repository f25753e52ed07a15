"""Forward dynamics of the arm with a payload, and its derivatives: the process model of a filter.

    q̈ = (M + M_L)⁻¹·(tau − h − h_L),      M_L, h_L: the payload's inertia and bias torque, linear in phi
    ∂q̈/∂phi = −(M + M_L)⁻¹·Y(q, q̇, q̈)

by the articulated-body algorithm and its analytical derivatives (Pinocchio; Carpentier & Mansard, RSS 2018), the
payload counted to the last link.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armload.arms.model import Arm
from armload.arms.regressors import payload_regressor
from armload.inertia import InertialParameters, frame_change_matrix, to_order


class ForwardDerivatives(NamedTuple):
    """q̈ (n,) [rad/s²] and its derivatives by q, q̇ and tau (n, n), and by phi (n, 10)."""

    ddq: NDArray[np.float64]
    by_q: NDArray[np.float64]
    by_dq: NDArray[np.float64]
    by_tau: NDArray[np.float64]  # the inverse of the joint-space inertia
    by_phi: NDArray[np.float64]


class ForwardDynamics:
    """q̈ of an arm that holds a payload of given parameters, one state at a time.

    >>> from armload.arms import arm
    >>> panda = arm("panda")
    >>> q, dq, ddq = np.full(7, 0.3), np.full(7, 0.2), np.full(7, 0.5)
    >>> found = ForwardDynamics(panda)(q, dq, panda.torque(q, dq, ddq), np.zeros(10))
    >>> bool(np.allclose(found, ddq))
    True

    Args:
        arm: the bare arm (with whatever is attached).
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._last = self._model.inertias[arm.n].toDynamicParameters()
        placement = arm._frame_placement
        moved = frame_change_matrix(placement.rotation, placement.translation)
        self._payload = np.array([to_order(InertialParameters(column), "pinocchio") for column in moved.T]).T

    @cached_property
    def _model(self) -> pin.Model:
        return self.arm._model.copy()  # its own: the last link's inertia changes with the payload

    @cached_property
    def _data(self) -> pin.Data:
        return self._model.createData()

    def __call__(self, q: NDArray, dq: NDArray, tau: NDArray, phi: NDArray) -> NDArray[np.float64]:
        """q̈ (n,) [rad/s²] at q, q̇, tau (n,) with a payload phi (10,), a body that can exist."""
        self._hold(phi)
        return pin.aba(self._model, self._data, q, dq, tau).copy()

    def inverse(self, q: NDArray, dq: NDArray, ddq: NDArray, phi: NDArray) -> NDArray[np.float64]:
        """The torque (n,) [N·m] that gives q̈: recursive Newton–Euler with the payload."""
        self._hold(phi)
        return pin.rnea(self._model, self._data, q, dq, ddq).copy()

    def derivatives(self, q: NDArray, dq: NDArray, tau: NDArray, phi: NDArray) -> ForwardDerivatives:
        """q̈ and its derivatives at the same arguments."""
        self._hold(phi)
        pin.computeABADerivatives(self._model, self._data, q, dq, tau)
        data = self._data
        inverse = np.triu(data.Minv)
        inverse = inverse + np.triu(inverse, 1).T
        ddq = data.ddq.copy()
        Y = payload_regressor(self.arm.frame_motion(q[None]), dq[None], ddq[None])[0]
        return ForwardDerivatives(ddq, data.ddq_dq.copy(), data.ddq_dv.copy(), inverse, -inverse @ Y)

    def _hold(self, phi: NDArray) -> None:
        self._model.inertias[self.arm.n] = pin.Inertia.FromDynamicParameters(self._last + self._payload @ phi)
