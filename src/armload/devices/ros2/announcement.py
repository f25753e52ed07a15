"""What of an estimate is published: a body that can exist, nothing at all, or no message yet."""

from __future__ import annotations

import numpy as np

from armload.errors import InertiaError
from armload.estimators import Estimate
from armload.inertia import HELD, InertialParameters, is_consistent, nearest_body
from armload.online import OnlineEstimate

_KNOWN = 0.15  # [kg] standard deviation of the mass above which nothing is published, if it is also a tenth of the mass


def announced(estimate: Estimate) -> InertialParameters | None:
    """The body that is held, with a mass of 0 if nothing is; None: not known well enough to be published.

    A subscriber may put the answer into a controller, so it is always a body that can exist: the nearest one in the
    metric of the estimate's covariance. Nothing is published while a parameter is not known at all, the mass is not
    known to 0.15 kg or a tenth of itself, or it is clearly negative (something was taken off since the tare); nor while
    a live identifier still settles on a new payload, or the payload is likelier changing than not, or something
    touches the arm.
    """
    phi, covariance = estimate.phi, estimate.covariance
    if isinstance(estimate, OnlineEstimate) and (estimate.changing or estimate.touched):
        return None
    if not (np.isfinite(estimate.t) and np.all(np.isfinite(phi)) and np.all(np.isfinite(covariance))):
        return None
    mass, spread = float(phi[0]), float(np.sqrt(max(covariance[0, 0], 0.0)))
    if spread > max(_KNOWN, 0.1 * mass) or mass < -HELD * spread:
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
