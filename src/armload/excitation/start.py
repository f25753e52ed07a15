"""Where an arm of which nobody says where it stands may begin a motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import MotionError
from armload.excitation.constraints import Constraints
from armload.motion.collision import POSE_FLOOR, POSE_SELF, capsule_arm
from armload.motion.random_fourier import clear_poses, filled_limits

_DRAWN = 2000  # poses; of the built-in arms' the nearest or the third is allowed


def pose_to_begin_at(
    arm: Arm, allowed: Callable[[NDArray[np.float64]], Constraints], floor: float | None
) -> NDArray[np.float64]:
    """The middle of the joints' range (n,) if a motion may begin there, else the nearest pose of many where one may.

    Args:
        arm: any arm. allowed: what a motion from a pose (n,) is to keep to; MotionError where none may begin. floor:
            height in the base's frame [m]; None: there is none.

    Returns:
        A pose (n,) [rad, m]; the middle where none was found.
    """
    limits, middle = filled_limits(arm.limits), arm.limits.middle
    rng = np.random.default_rng(0)
    poses = clear_poses(arm, capsule_arm(arm), rng, floor, _DRAWN, POSE_FLOOR, POSE_SELF)
    far = np.linalg.norm((poses - middle) / (limits.position_high - limits.position_low), axis=1)
    for pose in (middle, *poses[np.argsort(far)]):
        try:
            allowed(pose)
        except MotionError:
            continue
        return pose
    return middle
