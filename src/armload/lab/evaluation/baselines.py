"""Two rows that belong into every table: what a method must beat before its errors mean anything.

A model trained on a narrow family of payloads carries that family as a prior. `TrainingMean` is the prior without the
log, `PriorLeastSquares` is least squares with the same prior and the same log.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.estimators import Estimate, Identifier
from armload.posterior import PosteriorLeastSquares
from armload.recording import Recording
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

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:  # noqa: ARG002
        self._count += len(t)

    def _estimate(self, t: float) -> Estimate:
        return Estimate(t, self.prior.mean, self.prior.covariance, self._count, str(self.arm.frame))


class PriorLeastSquares(PosteriorLeastSquares):
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
        super().__init__(arm, tare, prior=GaussianPrior(np.asarray(mean), np.asarray(covariance)))
