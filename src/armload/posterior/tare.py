"""What a tare says of an arm, accumulated once however often the same tare is asked.

A log, the search for changes of payload in it, each of its parts and the next log of the same day have one tare, which
is often longer than they are.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from armload.arms import Arm, rated_effort
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import Correction, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData
from armload.regression.noise import NoiseModel

_KEPT = 4  # [tares] of 2 MB with features: an arm as it was given and as it was found, with features and without


class TareData(NamedTuple):
    """data: the tare's regression, to be read, not to be added to. scales: found from it alone; None: those stated."""

    data: RegressionData
    scales: Scales | None


@lru_cache(maxsize=_KEPT)
def tare_data(
    tare: Recording, arm: Arm, gain: float, features: JointFeatures, noise: NoiseModel, iterations: int
) -> TareData:
    """What a tare says of an arm; the same objects give the same answer without being asked again.

    Args:
        tare: a recording of this arm. gain: λ of the lag [1/s]. features, noise: of the smooth part.
        iterations: of expectation–maximisation, for the scales; without features they are not sought.
    """
    data = RegressionData(Correction(arm, rated_effort(arm)), gain, features, noise.block)
    data.add(tare.t, tare.q, tare.dq, tare.tau)
    scales = solve([data], payload_prior_std(arm), None, noise, iterations).scales if features.size else None
    return TareData(data, scales)
