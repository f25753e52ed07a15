"""How far a motion is beyond its constraints while it is designed, and the gradient of that.

    P = (1/T)·Σ_i ∫ max(0, |x_i(t)|/limit_i − 1)² dt

over positions, velocities, accelerations, jerks, torques with the worst payload, the tool's speed and clearances. The
torque comes from the momentum form that the rows need anyway, tau = d/dt(Y·phi) + D·phi with a difference quotient in
time, and the tool's speed from the column of a unit mass, v² = dqᵀ·Y_m: both pass the gradient of the rows. A finished
design is checked by other code (`verification.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.excitation.constraints import Constraints
from armload.excitation.rows import MotionRows, RowAdjoint

# of each limit while designing: what samples and difference quotients in time miss stays inside
_TIGHT = 0.985
_NEAR = 0.05  # [m] beyond a clearance counts like a limit passed by its own size
_ROOM = 0.1  # [rad] about which a position counts so
_STEP = 1e-5  # [rad] of the difference quotients of clearances, and of what velocity is left near the ends of a range
_LEFT = 0.05  # of the velocity limit that counts as left at the ends of a range
_EVERY = 2  # of the samples are looked at for clearances


class PenaltyValue(NamedTuple):
    """P, and how it changes with q, dq, ddq and the third derivative (N, n)."""

    value: float
    ddq: NDArray[np.float64]
    jerk: NDArray[np.float64]


class Penalty:
    """P of motions under given constraints.

    Args:
        constraints: what they keep to.
        spare: clearance beyond what is kept, at most half of what the start has beyond it [m].
    """

    def __init__(self, constraints: Constraints, spare: float = 0.0) -> None:
        self.constraints = constraints
        arm = constraints.arm
        self._links = arm.link_parameters.ravel()
        most = {name: _TIGHT * value for name, value in constraints.most.items()}
        self._most = {k: np.where(np.isfinite(v), v, 1e12) for k, v in most.items()}
        kept, has = constraints.around.kept(constraints.start), constraints.around.clearance(constraints.start[None])[0]
        self._kept = kept + np.minimum(spare, 0.5 * np.where(np.isfinite(has), has - kept, np.inf))
        room = 0.5 * (1.0 - _TIGHT) * (constraints.high - constraints.low)
        self._low, self._high = constraints.low + room, constraints.high - room

    def __call__(
        self,
        rows: MotionRows,
        ddq: NDArray[np.float64],
        jerk: NDArray[np.float64],
        change: RowAdjoint,
        weight: float,
    ) -> PenaltyValue:
        """P of a motion; `weight` times its change with q, dq and the momentum form is added to `change`."""
        N = len(rows.q)
        share = weight / N
        over = np.maximum(rows.q - self._high, 0.0) - np.maximum(self._low - rows.q, 0.0)
        total = float((over**2).sum()) / _ROOM**2
        change.q += 2.0 * share * over / _ROOM**2
        total += self._velocity(rows, change, share)
        out = []
        for name, x in (("acceleration", ddq), ("jerk", jerk)):
            value, slope = _hinge(x, self._most[name])
            total += value
            out.append(share * slope)
        total += self._torque(rows, change, share) + self._speed(rows, change, share)
        total += self._clearance(rows, change, share)
        return PenaltyValue(total / N, *out)

    def _velocity(self, rows: MotionRows, change: RowAdjoint, share: float) -> float:
        # v(q), and its slope with q where it has one; a part stays where nothing is left, so that there is a way back
        least = _LEFT * self._most["velocity"]

        def most(q: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.maximum(_TIGHT * self.constraints.fastest(q, rows.dq), least)

        here = most(rows.q)
        value, slope = _hinge(rows.dq, here)
        change.dq += share * slope
        if self.constraints.arm.limits.ends is None:
            return value
        steeper = (most(rows.q + _STEP) - most(rows.q - _STEP)) / (2.0 * _STEP)
        change.q -= share * slope * rows.dq / here * steeper
        return value

    def _torque(self, rows: MotionRows, change: RowAdjoint, share: float) -> float:
        corners, links, step = self.constraints.corners, self._links, rows.step
        own, bare = rows.momentum[:, :, 10:] @ links, rows.drift[:, :, 10:] @ links
        p = rows.momentum[:, :, :10] @ corners.T + own[:, :, None]  # (N, n, V)
        torque = np.gradient(p, step, axis=0) + rows.drift[:, :, :10] @ corners.T + bare[:, :, None]
        worst = np.abs(torque).argmax(axis=2)
        at = np.take_along_axis(torque, worst[:, :, None], axis=2)[:, :, 0]
        value, slope = _hinge(at, self._most["torque"])
        if value == 0.0:
            return 0.0
        phi = corners[worst] * (share * slope)[:, :, None]  # (N, n, 10), what each sample's torque adds
        change.drift[:, :, :10] += phi
        change.drift[:, :, 10:] += (share * slope)[:, :, None] * links
        change.momentum[:, :, :10] += _gradient_back(phi, step)
        change.momentum[:, :, 10:] += _gradient_back(share * slope, step)[:, :, None] * links
        return value

    def _speed(self, rows: MotionRows, change: RowAdjoint, share: float) -> float:
        if not np.isfinite(self.constraints.speed):
            return 0.0
        mass = rows.momentum[:, :, 0]
        square = (rows.dq * mass).sum(axis=1)
        value, slope = _hinge(square, (_TIGHT * self.constraints.speed) ** 2)
        change.momentum[:, :, 0] += share * slope[:, None] * rows.dq
        change.dq += share * slope[:, None] * mass
        return value

    def _clearance(self, rows: MotionRows, change: RowAdjoint, share: float) -> float:
        around, q = self.constraints.around, rows.q[::_EVERY]

        def short(poses: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.maximum(self._kept - around.clearance(poses), 0.0) / _NEAR  # (N, 3)

        now = short(q)
        near = np.flatnonzero(now.any(axis=1))
        for j in self.constraints.moving if len(near) else ():
            moved = q[near].copy()
            moved[:, j] += _STEP
            slope = (short(moved) - now[near]) / _STEP
            change.q[_EVERY * near, j] += _EVERY * share * 2.0 * (now[near] * slope).sum(axis=1)
        return _EVERY * float((now**2).sum())


def _hinge(x: NDArray[np.float64], most: NDArray[np.float64] | float) -> tuple[float, NDArray[np.float64]]:
    """Σ max(0, |x|/most − 1)², and its slope."""
    over = np.maximum(np.abs(x) / most - 1.0, 0.0)
    return float((over**2).sum()), 2.0 * over * np.sign(x) / most


def _gradient_back(x: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """The adjoint of `numpy.gradient` along the first axis."""
    out = np.zeros_like(x)
    out[2:] += x[1:-1] / (2.0 * step)
    out[:-2] -= x[1:-1] / (2.0 * step)
    out[1] += x[0] / step
    out[0] -= x[0] / step
    out[-1] += x[-1] / step
    out[-2] -= x[-1] / step
    return out
