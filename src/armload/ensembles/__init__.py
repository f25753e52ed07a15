"""Learned identification: bags of trees and networks, two-stage training, artefacts, compiled prediction, the stream.

Names are loaded on first use: predicting with a saved model needs neither scikit-learn nor JAX.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

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
    from armload.ensembles.window_networks import WindowNetworks

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
    "WindowNetworks",
    "load_model",
    "save_model",
]

__getattr__, __dir__ = on_first_use(__name__)
