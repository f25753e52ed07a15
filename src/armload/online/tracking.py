"""phi while samples are left out: the mixture of both hypotheses, the same payload and another."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from armload.inertia import Z95
from armload.online.lasting import Lasting
from armload.online.modes import Modes
from armload.online.runs import Gaussian
from armload.online.thresholds import LAG, LIKELY, UNLIKELY
from armload.posterior import PosteriorLeastSquares


class Tracker:
    """Follows phi to the last rows; the covariance is the wider the faster phi has moved since the last call.

    Attributes:
        lasting: a hand-over that may go on in the run; None: it does not.
    """

    def __init__(self) -> None:
        self._t, self._lagged = 0.0, np.zeros(10)  # [s] of the last call; the shift of phi, lagged
        self.lasting: Lasting | None = None

    def rest(self, shift: NDArray[np.float64]) -> bool:
        """Whether a change of phi (10,) is the rest of a hand-over amid which the run began: it goes the same way."""
        lasting = self.lasting
        return lasting is not None and lasting.went_on > LIKELY and float(shift[0] * lasting.pace[0]) > 0.0

    def row(self, run: PosteriorLeastSquares, louder: float) -> None:
        """A run has taken a row; `louder`: how large the noise is, in units of what it is taken for."""
        if run.reference is not None:  # its scales are of that run's rows: what they leave out, it leaves out
            run.louder = louder
        if self.lasting is not None:
            self.lasting.take(run.stream, louder)
            self.lasting = None if self.lasting.over(float(run.last.covariance[0, 0])) else self.lasting

    def of_now(self, last: Gaussian) -> Gaussian:
        """What the run says, and by how much a hand-over that may go on in it is ahead."""
        if self.lasting is None:
            return last
        return last[0] + self.lasting.ahead[0], last[1] + self.lasting.ahead[1]

    def track(self, modes: Modes, t: float, last: Gaussian) -> Gaussian:
        """phi (10,) and its covariance at a row at t [s]; `last`: what the run says, which did not take the row."""
        last = self.of_now(last)
        (shift, spread), p = modes.shift(going_on=True), modes.handing + modes.other + modes.taken_off
        self._lagged = self._lagged + min((t - self._t) / LAG, 1.0) * (shift - self._lagged)
        self._t, late = t, p * (shift - self._lagged)
        covariance = last[1] + p * spread + p * (1.0 - p) * np.outer(shift, shift) + np.outer(late, late)
        half, variance = Z95 * np.sqrt(np.diag(covariance)), np.diag(last[1])
        own, other = np.sqrt(variance), np.sqrt(variance + np.diag(spread))
        ends = p * np.abs(shift) + _reach(1.0 - p) * own, (1.0 - p) * np.abs(shift) + _reach(p) * other
        by = np.maximum(1.0, np.maximum(*ends) / half)
        return last[0] + p * shift, covariance * np.outer(by, by)


def _reach(p: float) -> float:
    """How far a 95 % interval of two payloads reaches beyond one of probability p, in its standard deviations.

    Each tail holds 2.5 %, though all of it may be that one's.
    """
    return NormalDist().inv_cdf(1.0 - 0.5 * UNLIKELY / p) if p > 0.5 * UNLIKELY else -np.inf
