"""What of an estimate is published: a body that can exist, nothing at all, or no message yet."""

from __future__ import annotations

import numpy as np

from armload.arms import Arm
from armload.errors import InertiaError
from armload.estimators import Estimate
from armload.inertia import HELD, InertialParameters, is_consistent, nearest_body
from armload.online import OnlineEstimate
from armload.online.thresholds import STEP_STD
from armload.regression import payload_prior_std

# [of the mass] standard deviation that is published, too, where it is more than `STEP_STD`: of what is far heavier than
# the arm is rated for, or at its rating. A convention: a payload to a tenth is of use to a controller
_SHARE = 0.1


def announced(estimate: Estimate, arm: Arm) -> InertialParameters | None:
    """The body that is held, with a mass of 0 if nothing is; None: not known well enough to be published.

    A subscriber may put the answer into a controller, so it is always a body that can exist: the nearest one in the
    metric of the estimate's covariance. Nothing is published while a parameter is not known at all, the mass's standard
    deviation [kg] is above a twentieth of what the arm is rated for (0.15 kg of a Panda) and a tenth of the mass, or
    the mass is clearly negative (something was taken off since the tare); nor while a live identifier still settles on
    a new payload, or the payload is likelier changing than not, or something touches the arm.

    Args:
        estimate: about any frame of the arm. arm: the one that was identified; what it is rated for is the scale.
    """
    phi, covariance = estimate.phi, estimate.covariance
    if isinstance(estimate, OnlineEstimate) and (estimate.changing or estimate.touched):
        return None
    if not (np.isfinite(estimate.t) and np.all(np.isfinite(phi)) and np.all(np.isfinite(covariance))):
        return None
    mass, spread = float(phi[0]), float(np.sqrt(max(covariance[0, 0], 0.0)))
    if spread > max(STEP_STD * payload_prior_std(arm)[0], _SHARE * mass) or mass < -HELD * spread:
        return None
    if mass <= HELD * spread:
        return InertialParameters.zero(estimate.frame)
    if is_consistent(phi):
        return estimate.parameters
    try:
        nearest = nearest_body(phi, covariance)
    except (InertiaError, np.linalg.LinAlgError):
        return None
    return InertialParameters(nearest, estimate.frame)
