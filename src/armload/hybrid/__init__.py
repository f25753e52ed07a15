"""The hybrid: physics for what is known, learned parts for what is not, error bars that are checked."""

from armload.hybrid.calibration import Calibration
from armload.hybrid.evidence import TRAITS, Evidence, Physics
from armload.hybrid.identifier import HybridIdentifier, shipped_model
from armload.hybrid.mixture import MixturePosterior, MixturePrior
from armload.hybrid.model import HybridModel
from armload.hybrid.records import Records, measure_episodes
from armload.hybrid.streaming import StreamingHybrid
from armload.hybrid.training import Coverage, cross_validated, payload_mixture, train_hybrid

__all__ = [
    "TRAITS",
    "Calibration",
    "Coverage",
    "Evidence",
    "HybridIdentifier",
    "HybridModel",
    "MixturePosterior",
    "MixturePrior",
    "Physics",
    "Records",
    "StreamingHybrid",
    "cross_validated",
    "measure_episodes",
    "payload_mixture",
    "shipped_model",
    "train_hybrid",
]
