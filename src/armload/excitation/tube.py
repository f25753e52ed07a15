"""The tube about a task's path in which the flange stays: so many millimetres, so many degrees.

To first order a change δ of the joints moves the payload frame by the twist J(q)·δ. While designing that is held below
the tube's size by a quadratic penalty, like the other constraints; a finished path is measured by its own poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.excitation.rows import RowAdjoint
from armload.motion import Motion

_TIGHT = 0.97  # of the tube while designing: second-order terms stay inside


@dataclass(frozen=True, eq=False)
class Tube:
    """At most `distance` [m] and `angle` [rad] from the poses of the path q (N, n)."""

    arm: Arm
    path: NDArray[np.float64]
    distance: float
    angle: float

    @cached_property
    def _jacobian(self) -> NDArray[np.float64]:
        """In units of the tube (N, 6, n)."""
        size = np.repeat([max(self.angle, 1e-9), max(self.distance, 1e-9)], 3) * _TIGHT
        return self.arm.frame_motion(self.path).jacobian / size[:, None]

    def __call__(self, q: NDArray[np.float64], change: RowAdjoint, weight: float) -> float:
        """weight·Σ max(0, |twist| − 1)²/N of positions q (N, n), its slope added to `change`."""
        twist = np.einsum("tij,tj->ti", self._jacobian, q - self.path)
        total, back = 0.0, np.zeros_like(twist)
        for part in (slice(0, 3), slice(3, 6)):
            size = np.linalg.norm(twist[:, part], axis=1)
            over = np.maximum(size - 1.0, 0.0)
            total += float((over**2).sum())
            back[:, part] = (2.0 * over / np.maximum(size, 1e-12))[:, None] * twist[:, part]
        share = weight / len(q)
        change.q += share * np.einsum("tij,ti->tj", self._jacobian, back)
        return share * total


Poses = tuple[NDArray[np.float64], NDArray[np.float64]]


def poses(arm: Arm, motion: Motion, rate: float) -> Poses:
    """Rotations (N, 3, 3) and places (N, 3) [m] of the payload frame on a motion."""
    return arm.frame_pose(motion.position(motion.instants(rate)))


def away(one: Poses, other: Poses) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance [m] and angle [rad] (N,) between the payload frame's poses on two motions that last as long."""
    (R, p), (S, r) = one, other
    # |R − S| = 2·√2·|sin(angle/2)|: exact for small angles, where the trace is not
    half = np.linalg.norm(R - S, axis=(1, 2)) / (2.0 * np.sqrt(2.0))
    return np.linalg.norm(p - r, axis=1), 2.0 * np.arcsin(np.minimum(half, 1.0))
