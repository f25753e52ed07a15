"""How strong an arm's joints are, from its description alone: the scale of whatever is not known for that arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms.model import Arm

_POSES = 200
_WEAKEST = 0.15  # of the strongest joint: 0.14 of the Panda's, 0.17 of a UR10e's


def rated_effort(arm: Arm) -> NDArray[np.float64]:
    """Torque (n,) each joint is built for [N·m]: its effort limit; without one, twice what holding the arm can take.

    A joint is at least as strong as those it carries, and none is much weaker than the rest.
    """
    effort = arm.limits.effort
    if np.all(np.isfinite(effort)):
        return effort
    static = np.abs(arm.torque(poses(arm))).max(axis=0)
    carried = np.maximum.accumulate(static[::-1])[::-1]
    return np.where(np.isfinite(effort), effort, np.maximum(2.0 * np.maximum(carried, _WEAKEST * carried[0]), 1.0))


def poses(arm: Arm) -> NDArray[np.float64]:
    """A fixed set of poses (200, n) spread over the joint limits, at most one turn each [rad]."""
    low = np.maximum(arm.limits.position_low, -np.pi)
    high = np.minimum(arm.limits.position_high, np.pi)
    return low + (high - low) * np.random.default_rng(0).random((_POSES, arm.n))
