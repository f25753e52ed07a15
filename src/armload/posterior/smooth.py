"""MAP least squares with the arm's rigid and its smooth mismatch: the physics of the default method."""

from __future__ import annotations

from armload.posterior.map import PosteriorLeastSquares
from armload.regression.noise import SMOOTH


class SmoothPosteriorLeastSquares(PosteriorLeastSquares):
    """MAP least squares with the arm's rigid and its smooth mismatch as unknowns: the physics of the default method.

    The smooth part (`JointFeatures`) is a Gaussian process over the pose and one over each joint's velocity. Only with
    it is the rest of the residual small enough to be taken for noise.

    >>> from armload.arms import arm
    >>> SmoothPosteriorLeastSquares(arm("panda")).name
    'map-gp'

    Arguments are those of `PosteriorLeastSquares`; without a profile the features are 128 of the pose, 12 of the
    velocity.
    """

    name = "map-gp"
    _noise = SMOOTH
    _smooth = True
    _iterations = 5
