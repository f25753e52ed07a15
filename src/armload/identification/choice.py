"""Which method answers: the one place that makes an identifier of a name, of a model's file, or of nothing at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from armload.arms import Arm
from armload.errors import IdentificationError, ModelError
from armload.estimators import Identifier
from armload.identification.methods import METHODS
from armload.posterior import PosteriorLeastSquares, Profile
from armload.recording import Recording
from armload.regression import JointFeatures

DEFAULT = "hybrid"  # the method where nothing is named and the arm has a trained model
_ELSEWHERE = "map-gp"
# names of the catalogue that need neither a motion known beforehand nor a model of their own
LIVE = tuple(name for name, method in METHODS.items() if method.needs not in ("training", "motion"))


@dataclass(frozen=True, eq=False)
class Choice:
    """A method made ready for an arm.

    name: of the method. identifier: it has seen nothing of the run yet.
    why: the trained model's file, if it is one.
    error_known: whether its covariance says how large its errors are: how far an ensemble's members disagree does not.
    """

    name: str
    identifier: Identifier
    why: str = ""
    error_known: bool = True


def choose(
    arm: Arm,
    tare: Recording | None = None,
    method: str | Path | None = None,
    *,
    live: bool = False,
    profile: Profile | None = None,
    features: JointFeatures | None = None,
) -> Choice:
    """The method for a log or a live stream.

    Args:
        arm: the bare arm. tare: an earlier log of it, if there is one.
        method: a name of the catalogue, or a trained model's file; None: the most trustworthy for the arm.
        live: for a stream, where no motion is known beforehand.
        profile: what was learned of this arm from many logs.
        features: of the arm's smooth mismatch, of a method that has it as an unknown; None: the usual ones.

    Raises:
        ArmloadError: an unknown method, a model that is missing or of another arm, or a tare the method has no use for.
    """
    if isinstance(method, Identifier):
        raise IdentificationError(
            f"the method is {method!r}: expected a name or a model's file; an identifier of your own answers by "
            "its run(recording), and armload.lab.evaluation.compare sets it beside others"
        )
    choice = _chosen(arm, tare, default_for(arm) if method is None else str(method), live, profile, features)
    if live and isinstance(choice.identifier, PosteriorLeastSquares):
        choice.identifier.live = True
    return choice


def _chosen(
    arm: Arm,
    tare: Recording | None,
    name: str,
    live: bool,
    profile: Profile | None,
    features: JointFeatures | None,
) -> Choice:
    entry = METHODS.get(name)
    if entry is not None and not (Path(name).is_file() and entry.needs == "training"):
        if live and name not in LIVE:
            raise IdentificationError(
                f"the method {name} cannot follow a live stream: expected one of {', '.join(LIVE)}, or the file of a "
                "trained model"
            )
        return Choice(name, entry.make(arm, tare, profile, features))
    return _trained(arm, tare, model_file(name, LIVE if live else tuple(METHODS)), profile, features)


def _trained(
    arm: Arm, tare: Recording | None, file: Path, profile: Profile | None, features: JointFeatures | None
) -> Choice:
    from armload.posterior import HybridIdentifier, HybridModel

    if HybridModel.wrote(file):
        made = HybridIdentifier(arm, tare, HybridModel.load(file), features, profile)
        return Choice(made.name, made, str(file))
    from armload.ensembles import LearnedIdentifier, load_model

    model = load_model(file)
    if profile is not None:
        raise IdentificationError(f"the trained model {file} cannot use a profile: leave --profile out")
    if tare is not None:
        raise IdentificationError(
            f"the trained model {file} cannot use a tare (an empty arm lies outside its training): leave the tare "
            "out, or use the method map"
        )
    return Choice(model.kind, LearnedIdentifier(model, arm), str(file), error_known=model.error_std is not None)


def default_for(arm: Arm) -> str:
    """The name of the most trustworthy method for an arm: the hybrid where one is shipped, map-gp elsewhere.

    Raises:
        ModelError: a hybrid is shipped for the arm, and its file is missing or cannot be read.
    """
    from armload.posterior import HybridModel, shipped_model

    if HybridModel.shipped(arm) is None:
        return _ELSEWHERE
    model = shipped_model(arm)
    try:
        model.prior_for(arm)
    except ModelError:  # an arm of that name with other links
        return _ELSEWHERE
    return DEFAULT


def model_file(name: str | Path, names: Sequence[str]) -> Path:
    """The file of a trained model that was given in place of a method's name.

    Raises:
        IdentificationError: there is no such file; the message says what was meant, a file or one of `names`.
    """
    path, text = Path(name), str(name)
    if path.is_file():
        return path
    if path.suffix or len(path.parts) > 1:  # no method is called so
        state = "is not a file" if path.exists() else "does not exist"
        raise IdentificationError(
            f"the model {text} {state}: expected the .safetensors file that `armload train` wrote, or a method that "
            "`armload methods` lists"
        )
    near = get_close_matches(text, names, 1)
    raise IdentificationError(
        f"unknown method {text!r}: expected one of {', '.join(names)}, or the path of a trained model"
        + (f"; did you mean {near[0]!r}?" if near else "")
    )
