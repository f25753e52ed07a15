"""Learned identification: bags of trees and networks, two-stage training, artefacts, compiled prediction, the stream.

Names are loaded on first use: predicting with a saved model needs neither scikit-learn nor JAX.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armload.ensembles.artefact import load_model, save_model
    from armload.ensembles.bagging import BaggingEnsemble
    from armload.ensembles.compiled import Compiled
    from armload.ensembles.learned import LearnedIdentifier
    from armload.ensembles.network import NetworkLearner
    from armload.ensembles.progress import Progress
    from armload.ensembles.stages import MixedEnsemble, TwoStage
    from armload.ensembles.trained_model import LearnedModel
    from armload.ensembles.tree import TreeLearner

__all__ = [
    "BaggingEnsemble",
    "Compiled",
    "LearnedIdentifier",
    "LearnedModel",
    "MixedEnsemble",
    "NetworkLearner",
    "Progress",
    "TreeLearner",
    "TwoStage",
    "load_model",
    "save_model",
]

_HOME = {
    "BaggingEnsemble": "bagging",
    "Compiled": "compiled",
    "LearnedIdentifier": "learned",
    "LearnedModel": "trained_model",
    "MixedEnsemble": "stages",
    "NetworkLearner": "network",
    "Progress": "progress",
    "TreeLearner": "tree",
    "TwoStage": "stages",
    "load_model": "artefact",
    "save_model": "artefact",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
