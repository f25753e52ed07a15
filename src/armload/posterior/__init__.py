"""The default estimator: scales, sequential solution, payload prior, calibration, model file; and the bound."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.posterior.advice import Advice, advise
    from armload.posterior.bound_worlds import scales_of
    from armload.posterior.calibration import Calibration
    from armload.posterior.cramer_rao import TIMES, Bound, bound, efficiency
    from armload.posterior.evidence import TRAITS, Evidence
    from armload.posterior.hybrid import HybridIdentifier, shipped_model
    from armload.posterior.known import Known, KnownBody, KnownCentre, KnownMass
    from armload.posterior.map import PosteriorLeastSquares
    from armload.posterior.model_file import HybridModel, Training
    from armload.posterior.payload_prior import MixturePosterior, MixturePrior
    from armload.posterior.profile import Profile, SessionRecord
    from armload.posterior.profile_file import load_profile, save_profile
    from armload.posterior.profile_learning import check_new, learn_profile
    from armload.posterior.scales import Posterior
    from armload.posterior.smooth import SmoothPosteriorLeastSquares
    from armload.posterior.torque_gain import with_known_weight

__all__ = [
    "TIMES",
    "TRAITS",
    "Advice",
    "Bound",
    "Calibration",
    "Evidence",
    "HybridIdentifier",
    "HybridModel",
    "Known",
    "KnownBody",
    "KnownCentre",
    "KnownMass",
    "MixturePosterior",
    "MixturePrior",
    "Posterior",
    "PosteriorLeastSquares",
    "Profile",
    "SessionRecord",
    "SmoothPosteriorLeastSquares",
    "Training",
    "advise",
    "bound",
    "check_new",
    "efficiency",
    "learn_profile",
    "load_profile",
    "save_profile",
    "scales_of",
    "shipped_model",
    "with_known_weight",
]

__getattr__, __dir__ = on_first_use(__name__)
