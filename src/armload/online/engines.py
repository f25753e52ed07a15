"""Which identifier a live stream is fed to: the streaming form where a method has one, else the method itself."""

from __future__ import annotations

from pathlib import Path

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import Identifier
from armload.identification import METHODS, default_for
from armload.posterior import (
    HybridModel,
    PosteriorLeastSquares,
    SmoothPosteriorLeastSquares,
    StreamingHybrid,
    StreamingIdentifier,
)
from armload.recording import Recording

# names of the catalogue that need neither a motion known beforehand nor a model of their own
LIVE = tuple(name for name, method in METHODS.items() if method.needs not in ("training", "motion"))


def engine(arm: Arm, tare: Recording | None = None, method: str | Path | None = None) -> Identifier:
    """An identifier for a live stream.

    Args:
        arm: the bare arm. tare: an earlier log of it, if there is one.
        method: a name of the catalogue, or a trained model's file; None: the most trustworthy for the arm.

    Raises:
        ArmloadError: an unknown method, a model of another arm, or a tare the method has no use for.
    """
    name = default_for(arm) if method is None else str(method)
    if name == "hybrid":
        return StreamingHybrid(arm, tare)
    if name == "map-gp":
        return StreamingIdentifier(SmoothPosteriorLeastSquares(arm, tare))
    if name == "map":
        return StreamingIdentifier(PosteriorLeastSquares(arm, tare))
    if name in LIVE:
        return METHODS[name].make(arm, tare)
    if not Path(name).is_file():
        raise IdentificationError(
            f"unknown method {name!r} for a live stream: expected one of {', '.join(LIVE)}, or the file of a model"
        )
    if HybridModel.wrote(name):
        return StreamingHybrid(arm, tare, HybridModel.load(name))
    from armload.ensembles import LearnedIdentifier, load_model

    if tare is not None:
        raise IdentificationError(f"the trained model {name} cannot use a tare: leave it out, or use another method")
    return LearnedIdentifier(load_model(name), arm)
