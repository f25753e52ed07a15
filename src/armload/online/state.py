"""The state of a live identifier in one file: saved, and taken up again by another process as if nothing had been.

It refers to the arm, to the trained model and to the profile, has none of them in it, and is refused for others.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import Identifier
from armload.runtime.atomic import replacing
from armload.runtime.content import digest_of_numbers
from armload.runtime.packing import Packer, Unpacker
from armload.runtime.regular import check_regular

FORMAT = 32


def save_state(path: str | PathLike[str], state: dict[str, Any], arm: Arm, method: str, engine: Identifier) -> Path:
    """Write what a live identifier of an arm holds to a file; it appears whole or not at all.

    Raises:
        IdentificationError: the method keeps something that cannot be written.
        OSError: it cannot be written there, or what is there is no regular file.
    """
    with suppress(FileNotFoundError):
        check_regular(path)  # a pipe would keep the stream until somebody reads it
    packer = Packer(_known(arm, engine))
    try:
        tree = packer.node(state)
    except TypeError as error:
        raise IdentificationError(f"a live identifier of this kind cannot be saved: {error}") from None
    about = {"format": FORMAT, "saved": time.time(), "origin": _origin(arm, method, engine)}
    text = {**about, "tree": tree, "objects": packer.objects}
    arrays = {f"a{k}": array for k, array in enumerate(packer.arrays)}
    with replacing(Path(path)) as part, part.open("wb") as file:
        np.savez(file, allow_pickle=False, tree=np.frombuffer(json.dumps(text).encode(), dtype=np.uint8), **arrays)
    return Path(path)


def load_state(path: str | PathLike[str], arm: Arm, method: str, engine: Identifier) -> dict[str, Any]:
    """Read what `save_state` wrote, for an identifier of the same arm with the same trained model.

    Raises:
        IdentificationError: missing, damaged or foreign file, one of another armload, arm or trained model.
    """
    with _opened(path) as (text, data):
        if text["format"] != FORMAT:
            raise IdentificationError(f"{path} belongs to another version of armload: begin without it")
        _check_origin(path, text["origin"], _origin(arm, method, engine))
        arrays = [data[f"a{k}"] for k in range(len(data.files) - 1)]
        return Unpacker(text["objects"], arrays, _known(arm, engine)).value(text["tree"])


def saved_at(path: str | PathLike[str]) -> float:
    """When a state was saved [s since 1970], as it says itself: a copy's file has another date.

    Raises:
        IdentificationError: missing, damaged or foreign file.
    """
    with _opened(path) as (text, _):
        saved = float(text["saved"])
        if not math.isfinite(saved):
            raise IdentificationError(
                f"{path} says that it was saved at {saved}, expected seconds since 1970: begin without it"
            )
        return saved


@contextmanager
def _opened(path: str | PathLike[str]) -> Iterator[tuple[dict[str, Any], Any]]:
    """What a state says, and its arrays; whatever is wrong with them is an `IdentificationError`."""
    try:
        check_regular(path)
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
            yield json.loads(data["tree"].tobytes().decode()), data
    except FileNotFoundError:
        raise IdentificationError(f"no saved state at {path}: begin without it") from None
    except IdentificationError:
        raise
    except Exception as error:
        raise IdentificationError(f"{path} is no state of a live identifier ({error}): begin without it") from None


def _known(arm: Arm, engine: Identifier) -> dict[str, Any]:
    """What a new identifier for the same arm has already: the arm, the trained parts, and what the profile says."""
    names = ("model", "_payloads", "profile", "of_profile")
    return {"arm": arm, **{name: value for name in names if (value := getattr(engine, name, None))}}


def _origin(arm: Arm, method: str, engine: Identifier) -> dict[str, Any]:
    known = _known(arm, engine)
    model = digest_of_numbers(known["model"]) if "model" in known else None  # whatever its file says of it
    profile = known["profile"].digest if "profile" in known else None
    return {"arm": arm.fingerprint, "name": arm.name, "method": method, "model": model, "profile": profile}


def _check_origin(path: str | PathLike[str], saved: Mapping[str, Any], own: Mapping[str, Any]) -> None:
    if saved["arm"] != own["arm"]:
        raise IdentificationError(
            f"{path} was saved for {saved['name']}: {own['name']} is another arm, or has another frame, gravity or tool"
        )
    if saved["model"] not in (None, own["model"]):  # its numbers and this model's would be mixed
        there = "which has no trained model" if own["model"] is None else f"whose model is {own['model'][:12]}"
        raise IdentificationError(
            f"{path} was saved with the method {saved['method']} and its trained model {saved['model'][:12]} "
            f"(SHA-256): found the method {own['method']}, {there}; give the method or the model's file that it was "
            "saved with, or begin anew"
        )
    if saved["profile"] != own["profile"]:
        with_, given = (
            "without a profile" if each["profile"] is None else f"with the profile {each['profile']}"
            for each in (saved, own)
        )
        raise IdentificationError(
            f"{path} was saved {with_}, found is a stream {given}: give the one it was saved with, or begin anew"
        )
