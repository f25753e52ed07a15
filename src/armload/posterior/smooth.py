"""MAP least squares with the arm's rigid and its smooth mismatch: the physics of the default method."""

from __future__ import annotations

from armload.arms import Arm
from armload.posterior.map import PosteriorLeastSquares
from armload.posterior.profile import Profile
from armload.posterior.same_motion import SameMotion
from armload.recording import Recording
from armload.regression import GaussianPrior, JointFeatures
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH


class SmoothPosteriorLeastSquares(PosteriorLeastSquares):
    """MAP least squares with the arm's rigid and its smooth mismatch as unknowns: the physics of the default method.

    The smooth part (`JointFeatures`) is a Gaussian process over the pose and one over each joint's velocity. Only with
    it is the rest of the residual small enough to be taken for noise.

    >>> from armload.arms import arm
    >>> SmoothPosteriorLeastSquares(arm("panda")).name
    'map-gp'

    Args:
        arm, tare, gain, prior, profile: as for `PosteriorLeastSquares`.
        features: of the smooth part; None: 128 of the pose, 12 of the velocity.
        same_motion: whether a tare along the run's own motion takes the posterior's place in the `evidence`.
    """

    name = "map-gp"
    _noise = SMOOTH
    _iterations = 5

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        gain: float = GAIN,
        prior: GaussianPrior | None = None,
        features: JointFeatures | None = None,
        same_motion: bool = False,
        profile: Profile | None = None,
    ) -> None:
        self.features = features or (JointFeatures(arm.n) if profile is None else profile.features)
        if same_motion and tare is not None:
            self._same_motion = SameMotion(arm, tare, gain)
        super().__init__(arm, tare, gain, prior, profile)

    @property
    def _features(self) -> JointFeatures:
        return self.features
