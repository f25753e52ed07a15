"""How strong an arm's joints are: the scale of everything in the simulator that is not known for that arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.inertia import InertialParameters
from armload.motion.collision import PAYLOAD_REACH

_POSES = 200
_FULL = (
    0.7  # of what the joints could hold almost everywhere; gives 3.6 kg for the Panda (3) and 11.2 for a UR10e (12.5)
)


def rated_effort(arm: Arm) -> NDArray[np.float64]:
    """Torque (n,) each joint is built for [N·m]: its effort limit; without one, twice what holding the arm can take."""
    effort = arm.limits.effort
    static = np.abs(arm.torque(poses(arm))).max(axis=0)
    return np.where(np.isfinite(effort), effort, 2.0 * np.maximum(static, 0.05 * static.max()))


def rated_mass(arm: Arm) -> float:
    """What the arm may carry [kg]: the maker's figure, or 0.7 of what its joints hold in 95 % of all poses."""
    if arm.rated_payload is not None:
        return arm.rated_payload
    q = poses(arm)
    bare = arm.torque(q)
    kilogram = InertialParameters.from_com(1.0, (0.0, 0.0, PAYLOAD_REACH), 1e-3 * np.eye(3))
    lever = np.abs(arm.with_payload(kilogram).torque(q) - bare)
    room = np.maximum(rated_effort(arm) - np.abs(bare), 0.0)
    return float(max(0.05, _FULL * np.quantile((room / np.maximum(lever, 1e-3)).min(axis=1), 0.05)))


def poses(arm: Arm) -> NDArray[np.float64]:
    """A fixed set of poses (200, n) spread over the joint limits, at most one turn each [rad]."""
    low = np.maximum(arm.limits.position_low, -np.pi)
    high = np.minimum(arm.limits.position_high, np.pi)
    return low + (high - low) * np.random.default_rng(0).random((_POSES, arm.n))
