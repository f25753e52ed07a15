"""Learned identification: bags of trees and networks, two-stage training, artefacts, compiled prediction, the stream.

Names are loaded on first use: predicting with a saved model needs neither scikit-learn nor JAX.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armload.learners.artefact import load_model, save_model
    from armload.learners.bagging import BaggingEnsemble
    from armload.learners.compiled import Compiled
    from armload.learners.held_out import held_out_error
    from armload.learners.model import LearnedModel
    from armload.learners.network import NetworkLearner
    from armload.learners.online import LearnedIdentifier
    from armload.learners.progress import Progress
    from armload.learners.stages import MixedEnsemble, TwoStage
    from armload.learners.support_vectors import SupportVectorLearner
    from armload.learners.tree import TreeLearner

__all__ = [
    "BaggingEnsemble",
    "Compiled",
    "LearnedIdentifier",
    "LearnedModel",
    "MixedEnsemble",
    "NetworkLearner",
    "Progress",
    "SupportVectorLearner",
    "TreeLearner",
    "TwoStage",
    "held_out_error",
    "load_model",
    "save_model",
]

_HOME = {
    "BaggingEnsemble": "bagging",
    "Compiled": "compiled",
    "LearnedIdentifier": "online",
    "LearnedModel": "model",
    "MixedEnsemble": "stages",
    "NetworkLearner": "network",
    "Progress": "progress",
    "SupportVectorLearner": "support_vectors",
    "TreeLearner": "tree",
    "TwoStage": "stages",
    "held_out_error": "held_out",
    "load_model": "artefact",
    "save_model": "artefact",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
