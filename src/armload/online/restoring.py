"""What a saved state of a live identifier holds for: the same arm, method and trained model, or it is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.errors import IdentificationError
from armload.online.state import load_state, model_fingerprint, save_state

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.estimators import Identifier


def save_identifier(state: Any, arm: Arm, method: str, engine: Identifier, path: str | PathLike[str]) -> Path:
    """Write what a live identifier holds to a file, but for the arm and the trained model."""
    return save_state(state, _known_parts(arm, engine), path, _origin(arm, method, engine))


def load_identifier(path: str | PathLike[str], arm: Arm, method: str, engine: Identifier) -> Any:
    """Read what `save_identifier` wrote, for an identifier with the same arm and trained model.

    Raises:
        IdentificationError: the file is none, or of another arm or trained model.
    """
    own = _origin(arm, method, engine)
    return load_state(path, _known_parts(arm, engine), _same_origin(path, arm, own))


def _known_parts(arm: Arm, engine: Identifier) -> dict[str, Any]:
    """What a new identifier for the same arm has already: the arm and the trained parts."""
    parts = {name: value for name in ("model", "_payloads", "profile") if (value := getattr(engine, name, None))}
    return {"arm": arm, **parts}


def _origin(arm: Arm, method: str, engine: Identifier) -> dict[str, Any]:
    """What a state holds for: it refers to the arm and the trained model, and has neither in it."""
    model = _known_parts(arm, engine).get("model")
    return {
        "arm": arm.fingerprint,
        "name": arm.name,
        "method": method,
        "model": None if model is None else model_fingerprint(model),
        "profile": None if (profile := getattr(engine, "profile", None)) is None else profile.digest,
    }


def _same_origin(path: str | PathLike[str], arm: Arm, own: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], None]:
    """A check of a saved origin against one's own.

    Raises (when called):
        IdentificationError: the state is of another arm or trained model.
    """

    def check(saved: Mapping[str, Any]) -> None:
        if saved["arm"] != own["arm"]:
            raise IdentificationError(
                f"{path} was saved for {saved['name']}: {arm.name} is another arm, or has another frame, gravity "
                "or tool"
            )
        if saved["model"] not in (None, own["model"]):  # its numbers and this model's would be mixed
            there = "which has no trained model" if own["model"] is None else f"whose model is {own['model'][:12]}"
            raise IdentificationError(
                f"{path} was saved with the method {saved['method']} and its trained model "
                f"{saved['model'][:12]} (SHA-256): found the method {own['method']}, {there}; give the method or "
                "the model's file that it was saved with, or begin anew"
            )
        if saved["profile"] != own["profile"]:
            with_, given = (
                "without a profile" if x is None else f"with the profile {x}"
                for x in (saved["profile"], own["profile"])
            )
            raise IdentificationError(
                f"{path} was saved {with_}, found is a stream {given}: give the one it was saved with, or begin anew"
            )

    return check
