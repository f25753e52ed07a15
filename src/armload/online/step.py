"""By how much the mass has changed: the difference between the runs before and after, once both are known."""

from __future__ import annotations

import numpy as np

from armload.online.thresholds import STEP_STD
from armload.posterior import PosteriorLeastSquares


def mass_step(before: PosteriorLeastSquares, run: PosteriorLeastSquares, spread: float) -> float | None:
    """Change of mass [kg] from one run to another; None if they are not known well, or relative to different things.

    Args:
        spread: standard deviation of a payload's mass, before anything is known of it [kg].
    """
    now, then = run.last, before.last
    if run is before or float(np.hypot(now.std[0], then.std[0])) > STEP_STD * spread:
        return None
    if run.reference is before:
        return float(now.phi[0])
    if before.reference is run:
        return -float(then.phi[0])
    return float(now.phi[0] - then.phi[0]) if run.reference is before.reference else None
