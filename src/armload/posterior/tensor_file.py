"""A safetensors file with JSON in its header: written whole or not at all; nothing in it is executed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import ModelError
from armload.runtime.atomic import replacing
from armload.runtime.content import content_digest

_DIGEST = "sha256"


def write_tensors(path: Path, tensors: Mapping[str, NDArray], name: str, header: Mapping[str, Any], what: str) -> None:
    """Write tensors, and a header under its name.

    Args:
        what: the file is, for the message.

    Raises:
        ModelError: the file cannot be written.
    """
    from safetensors.numpy import save

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            arrays = {key: np.ascontiguousarray(array) for key, array in tensors.items()}
            signed = {**header, _DIGEST: content_digest(header, arrays)}
            part.write_bytes(save(arrays, {name: json.dumps(signed)}))
    except OSError as error:
        raise ModelError(f"{what} cannot be written to {path}: {error.strerror}; name a file elsewhere") from None


def read_tensors(
    path: Path, name: str, missing: str, unreadable: str, foreign: str
) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """The tensors of a file, and its header.

    Args:
        name: of the header. missing, unreadable, foreign: what to say where the file is none, or none of ours.

    Raises:
        ModelError: one of these three, or the file is not as it was written.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="np") as file:
            text = (file.metadata() or {}).get(name)
            tensors = {key: np.ascontiguousarray(file.get_tensor(key)) for key in file.keys()}  # noqa: SIM118
    except FileNotFoundError:
        raise ModelError(missing) from None
    except (SafetensorError, OSError, ValueError, TypeError):
        raise ModelError(unreadable) from None
    if text is None:
        raise ModelError(foreign)
    try:
        header = json.loads(text)
        said = header.pop(_DIGEST, None)  # files of earlier versions have none
    except (ValueError, AttributeError, TypeError):
        raise ModelError(unreadable) from None
    if said not in (None, content_digest(header, tensors)):
        raise ModelError(f"{path} was altered after it was written (its SHA-256 differs): copy it again")
    return tensors, header
