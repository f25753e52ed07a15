"""What an arm is built for: the scale of everything in the simulator that is not known for that arm."""

from __future__ import annotations

import numpy as np

from armload.arms import Arm, poses, rated_effort
from armload.inertia import InertialParameters
from armload.motion.collision import PAYLOAD_REACH

_FULL = 0.7  # of what the joints could hold almost everywhere: 3.6 kg for the Panda (3), 11.2 for a UR10e (12.5)


def is_panda(arm: Arm) -> bool:
    """Whether it is the Panda: the one arm whose stiffness, mismatch and sensors are known figures here."""
    return arm.known_as == "panda" and arm.n == 7


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
