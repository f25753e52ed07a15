"""How strong an arm's joints are: the scale of everything in the simulator that is not known for that arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm

_POSES = 200


def rated_effort(arm: Arm) -> NDArray[np.float64]:
    """Torque (n,) each joint is built for [N·m]: its effort limit; without one, twice what holding the arm can take."""
    effort = arm.limits.effort
    static = np.abs(arm.torque(poses(arm))).max(axis=0)
    return np.where(np.isfinite(effort), effort, 2.0 * np.maximum(static, 0.05 * static.max()))


def poses(arm: Arm) -> NDArray[np.float64]:
    """A fixed set of poses (200, n) spread over the joint limits, at most one turn each [rad]."""
    low = np.maximum(arm.limits.position_low, -np.pi)
    high = np.minimum(arm.limits.position_high, np.pi)
    return low + (high - low) * np.random.default_rng(0).random((_POSES, arm.n))
