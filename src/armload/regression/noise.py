"""What is expected of the residual e, before anything is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.regression.block_means import BLOCK
from armload.regression.information import NOVELTY
from armload.regression.mismatch import Correction
from armload.regression.rows import REGRESSOR_RATE

# [s] a run shorter than this sees one value of a residual that changes slowly: its mean does not grow with 1/T. Two
# lags; until then a stream's posterior is made of all rows anew
MOMENT = 0.1


@dataclass(frozen=True)
class NoiseModel:
    """What is expected of the residual e.

    Args:
        residual: prior standard deviation of the unexplained torque over a block, as a fraction of the effort limit.
        block: length of the residual's batch means [s].
        floor: whether the residual is never taken to be smaller than `residual`: what is left of skew between the
            channels and of the sensors' quirks follows the motion, and does not average out.
        novelty: [s] beyond which more time on similar motions counts no more, as for a mismatch that is a function of
            the configuration and has no unknown of its own.
        overrated: by which factor the posterior's covariance is too small on arms unlike those the model was made for:
            squared error over variance, mean over simulated episodes (`overrating` in lab/training, 2 % trimmed).
        white: whether S is never taken to be smaller than that of white noise of the residual's power, 2·power/λ behind
            the lag. Few blocks do not tell it, and many smooth functions follow what they do: vibration that a slow
            log folds to low frequencies is white, and larger than all else.
    """

    residual: float
    block: float
    floor: bool
    novelty: float
    overrated: float = 1.0
    white: bool = False


# without features, the smooth mismatch is in the residual: it is large and repeats: 0.2–0.6 % of the effort limit of
# two Pandas over a block
RIGID = NoiseModel(residual=4e-3, block=BLOCK, floor=False, novelty=NOVELTY)
# what is left repeats all the same: errors hardly fall after half a minute (`benchmarks/minute_logs.py`), nor may the
# information grow for days, until its digits are gone
SMOOTH = NoiseModel(residual=1e-3, block=0.25, floor=True, novelty=60.0, overrated=2.25)


def whole_noise(correction: Correction, noise: NoiseModel) -> NDArray[np.float64]:
    """S (n,) that is expected of a run of `MOMENT` or more, before anything is seen [N²·m²·s]."""
    return (noise.residual * correction.effort) ** 2 * noise.block


def share_of_noise(seconds: float) -> float:
    """The fraction of `whole_noise` that a run of so many seconds shows."""
    return min(1.0, max(seconds, 1.0 / REGRESSOR_RATE) / MOMENT)
