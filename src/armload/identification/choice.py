"""Which method answers: the one place that makes an identifier of a name, of a model's file, or of nothing at all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import Identifier
from armload.identification.methods import METHODS, default_for, model_file
from armload.recording import Recording

# names of the catalogue that need neither a motion known beforehand nor a model of their own
LIVE = tuple(name for name, method in METHODS.items() if method.needs not in ("training", "motion"))


@dataclass(frozen=True, eq=False)
class Choice:
    """A method made ready for an arm.

    identifier: it has seen nothing of the run yet. prior: whether it starts from a prior on the payload.
    why: why this one, in a sentence.
    """

    identifier: Identifier
    prior: bool
    why: str


def choose(arm: Arm, tare: Recording | None = None, method: str | Path | None = None, *, live: bool = False) -> Choice:
    """The method for a log or a live stream.

    Args:
        arm: the bare arm. tare: an earlier log of it, if there is one.
        method: a name of the catalogue, or a trained model's file; None: the most trustworthy for the arm.
        live: for a stream, where no motion is known beforehand.

    Raises:
        ArmloadError: an unknown method, a model that is missing or of another arm, or a tare the method has no use for.
    """
    name = default_for(arm) if method is None else str(method)
    entry = METHODS.get(name)
    if entry is not None and not (Path(name).is_file() and entry.needs == "training"):
        if live and name not in LIVE:
            raise IdentificationError(
                f"the method {name} cannot follow a live stream: expected one of {', '.join(LIVE)}, or the file of a "
                "trained model"
            )
        why = f"{name} holds for any motion and payload" if method is None else "asked for"
        if method is None and tare is None:
            why += "; without a tare the error bars allow for the model's errors"
        return Choice(entry.make(arm, tare), entry.prior, why)
    return _trained(arm, tare, model_file(name, LIVE if live else tuple(METHODS)))


def _trained(arm: Arm, tare: Recording | None, file: Path) -> Choice:
    from armload.posterior import HybridIdentifier, HybridModel

    if HybridModel.wrote(file):
        made = HybridIdentifier(arm, tare, HybridModel.load(file))
        return Choice(made, True, f"asked for; {file} was trained for this arm")
    from armload.ensembles import LearnedIdentifier, load_model

    model = load_model(file)
    if tare is not None:
        raise IdentificationError(
            f"the trained model {file} cannot use a tare (an empty arm lies outside its training): leave the tare "
            "out, or use the method map"
        )
    return Choice(LearnedIdentifier(model, arm), True, f"asked for; {file} was trained on this arm and motion")
