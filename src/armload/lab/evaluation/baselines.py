"""Two rows that belong into every table: what a method must beat before its errors mean anything.

A model trained on a narrow family of payloads carries that family as a prior. `TrainingMean` shows what the prior
alone is worth, `PriorLeastSquares` what least squares makes of the same prior and the same log.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.estimators import Estimate, Identifier
from armload.posterior import PosteriorLeastSquares
from armload.recording import Recording, Sample
from armload.regression import GaussianPrior


class TrainingMean(Identifier):
    """Predicts the mean of the training payloads, whatever the robot feels.

    >>> from armload.arms import arm
    >>> from armload.recording import Recording
    >>> log = Recording([0.0, 1.0], np.zeros((2, 7)), np.zeros((2, 7)), np.zeros((2, 7)))
    >>> float(TrainingMean(arm("panda"), np.arange(10.0), np.eye(10)).run(log).phi[3])
    3.0

    Args:
        arm: the arm, for its number of joints and its frame.
        mean: (10,).
        covariance: (10, 10), of the training payloads.
    """

    name = "training mean"

    def __init__(self, arm: Arm, mean: ArrayLike, covariance: ArrayLike) -> None:
        self.arm, self.prior = arm, GaussianPrior(np.asarray(mean), np.asarray(covariance))
        self.reset()

    def reset(self) -> None:
        """Start counting samples anew."""
        self._count = 0

    def update(self, sample: Sample) -> Estimate:
        """The same answer at every sample."""
        self._count += 1
        return Estimate(float(sample.t), self.prior.mean, self.prior.covariance, self._count, str(self.arm.frame))


class PriorLeastSquares(Identifier):
    """MAP least squares that knows the training payloads: phi ~ N(mean, covariance) instead of a weak prior.

    Everything else is `PosteriorLeastSquares`: the acceleration-free regression r = W·phi, the arm's own mismatch as
    further unknowns, each joint weighted by the long-run variance of its residual.

    Args:
        arm: the bare arm.
        mean, covariance: (10,), (10, 10) of the training payloads, as `GaussianPrior.of(...)` makes them.
        tare: an earlier log of the same arm; estimates are relative to what was mounted then.
    """

    name = "same-prior least squares"

    def __init__(self, arm: Arm, mean: ArrayLike, covariance: ArrayLike, tare: Recording | None = None) -> None:
        self.arm, self.prior = arm, GaussianPrior(np.asarray(mean), np.asarray(covariance))
        self._solver = PosteriorLeastSquares(arm, tare, prior=self.prior)

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._solver.reset()

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far."""
        return self._solver.update(sample)

    def trace(self, recording: Recording, every: int = 1) -> list[Estimate]:
        """The estimates along a recording: one per `every` samples, and always the last."""
        return self._solver.trace(recording, every)

    def at(self, recording: Recording, times: ArrayLike) -> list[Estimate]:
        """The estimates `times` [s] after a recording's first sample; nothing is solved in between."""
        return self._solver.at(recording, times)
