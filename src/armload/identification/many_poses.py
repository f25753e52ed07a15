"""A log of more poses than an arm's smooth mismatch has functions for.

The mismatch of a joint is sought among 128 smooth functions of the pose. Their kernel differs from that of the Gaussian
process they stand for by 1/√128 from pose to pose. In a log of few poses that is nothing; in one of very many the
functions are used up, and what they miss looks like another arm than at the tare, or a payload that moves or changes.
Such a log is read once more with as many functions as a profile may have.
"""

from __future__ import annotations

import numpy as np

from armload.arms import Arm
from armload.posterior.profile_learning import CAPACITIES
from armload.recording import Recording
from armload.regression import JointFeatures
from armload.regression.features import distinct_poses

# [poses] beyond which a log is one of many: motions of all kinds have 1 to 6.3 in a minute, those everywhere in the
# joints' range 14 (test_only_a_log_of_very_many_poses_is_one); logs in one place are not doubted, however long
# (`benchmarks/ever_new_poses.py`)
_MANY = 8.0
_LOOKED_AT = 400  # samples of a log, evenly: their kernel is a matrix


def more_features(log: Recording, arm: Arm) -> JointFeatures | None:
    """The most functions of the pose, for a log of very many poses; None: the usual ones do."""
    q = log.q[np.linspace(0, len(log) - 1, min(len(log), _LOOKED_AT)).astype(int)]
    return JointFeatures(arm.n, CAPACITIES[-1]) if distinct_poses(q) > _MANY else None
