"""Which of a payload's parameters an arm can tell at all, whatever it does: a SCARA's joints feel four of the ten."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armload.arms.model import Arm
from armload.arms.regressors import payload_regressor
from armload.arms.strength import poses

_NOTHING = 1e-8  # of the largest singular value, or of a parameter: rounding is 1e-15


@lru_cache(maxsize=16)
def tellable(arm: Arm) -> NDArray[np.bool_]:
    """Which of the ten parameters (10,) some motion determines.

    With Y the payload's regressors at poses all over the joints' ranges, at any velocity and acceleration, one below
    the other, phi_k is determined if e_k lies in the row space of Y.
    """
    q, rng = poses(arm), np.random.default_rng(0)
    dq, ddq = rng.standard_normal((2, *q.shape))
    Y = payload_regressor(arm.frame_motion(q), dq, ddq).reshape(-1, 10)
    size = np.linalg.norm(Y, axis=0)
    felt = size > _NOTHING * size.max()
    _, values, directions = np.linalg.svd(Y / np.where(felt, size, 1.0), full_matrices=True)
    hidden = directions[np.sum(values > _NOTHING * values[0]) :]
    return felt & (np.linalg.norm(hidden, axis=0) < np.sqrt(_NOTHING))
