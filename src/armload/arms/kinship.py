"""Whether two descriptions are of the same arm, however their bases stand and whatever their files are called."""

from __future__ import annotations

import hashlib

import numpy as np

from armload.arms.model import Arm


def kinship(arm: Arm) -> str:
    """SHA-256 of an arm's links and of how they sit to each other: the same however its base stands."""
    R, p = arm.link_poses(np.linspace(-0.5, 0.7, arm.n))
    frame_R, frame_p = arm.frame_pose(np.linspace(-0.5, 0.7, arm.n))
    R, p = np.concatenate([R[0], frame_R]), np.concatenate([p[0], frame_p])
    digest = hashlib.sha256(np.round(arm.link_parameters, 6).tobytes())
    digest.update((np.round(R[0].T @ R, 6) + 0.0).tobytes())  # as seen from the first moving link
    digest.update((np.round((p - p[0]) @ R[0], 6) + 0.0).tobytes())
    return digest.hexdigest()
