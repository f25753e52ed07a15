"""phi while samples are left out: the mixture of both hypotheses, the same payload and another."""

from __future__ import annotations

import numpy as np

from armload.online.modes import Modes
from armload.online.runs import Gaussian
from armload.online.thresholds import LAG


class Tracker:
    """Follows phi to the last rows; the covariance is the wider the faster phi has moved since the last call."""

    def __init__(self) -> None:
        self._t, self._lagged = 0.0, np.zeros(10)  # [s] of the last call; the shift of phi, lagged

    def track(self, modes: Modes, t: float, last: Gaussian) -> Gaussian:
        """phi (10,) and its covariance at a row at t [s]; `last`: what the run says, which did not take the row."""
        (shift, spread), p = modes.shift(going_on=True), modes.handing + modes.other
        self._lagged = self._lagged + min((t - self._t) / LAG, 1.0) * (shift - self._lagged)
        self._t, late = t, p * (shift - self._lagged)
        spread = p * spread + p * (1.0 - p) * np.outer(shift, shift) + np.outer(late, late)
        return last[0] + p * shift, last[1] + spread
