"""The load in a file: a saved result, or a payload file, each with how well it is known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from armload.devices import load_remarks as remarks_on
from armload.devices.load import Load
from armload.errors import SinkError
from armload.inertia import Z95
from armload.payloads.payload_file import payload_from, read_content


def read_load(path: str | Path) -> Load:
    """The load in a file: what `armload identify --json` printed, or a payload file, known as well as it says.

    Raises:
        PayloadError: the file is missing or malformed, or no body can have its parameters.
        SinkError: the fields of an identification in it are malformed.
    """
    content = read_content(path)
    payload = payload_from(content, path)
    parameters, robot, relative_to = (
        payload.parameters,
        _text(content, "robot", path),
        _text(content, "relative_to", path),
    )
    determined = _flags(content, "determined", path)
    if determined is None:
        load = Load(parameters, robot=robot, relative_to=relative_to, remarks=remarks_on.assumed(payload))
        if not payload.covariance.any():
            return load
        return replace(load, covariance=payload.covariance).with_parameters(parameters)
    std = None
    try:
        low, high = (np.array(content[key], dtype=float) for key in ("phi_low", "phi_high"))
        if low.shape == high.shape == (10,) and np.all(np.isfinite(high - low)) and np.all(high >= low):
            std = (high - low) / (2 * Z95)
    except (KeyError, TypeError, ValueError, OverflowError):
        pass  # written by hand: the numbers themselves are enough
    resting = _flags(content, "rests_on_prior", path) or (False,) * 10
    remarks = remarks_on.doubted(content.get("interval")) + remarks_on.of_a_part(content.get("segments"))
    remarks += remarks_on.leaning(determined, resting) + remarks_on.assumed(payload)
    try:
        inertia = (content[key] for key in ("inertia_com", "inertia_com_low", "inertia_com_high"))
        value, low, high = (np.diag(np.array(x, dtype=float)) for x in inertia)
        remarks += remarks_on.loose(value, high - low, determined)
    except (KeyError, TypeError, ValueError, OverflowError):
        pass
    covariance = payload.covariance if std is not None and payload.covariance.any() else None
    return Load(parameters, determined, robot, relative_to, std, remarks, covariance)


def _flags(content: dict[str, Any], key: str, path: str | Path) -> tuple[bool, ...] | None:
    value = content.get(key)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 10 or any(not isinstance(x, bool) for x in value):
        raise SinkError(f"{path}: {key} is {json.dumps(value)[:80]}, expected 10 times true or false")
    return tuple(value)


def _text(content: dict[str, Any], key: str, path: str | Path) -> str | None:
    value = content.get(key)
    if value is not None and not isinstance(value, str):
        raise SinkError(f"{path}: {key} is {json.dumps(value)[:80]}, expected text")
    return value
