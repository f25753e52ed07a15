"""An arm and payloads as JSON, for the reader's own process."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.inertia import InertialParameters


def arm_to_json(arm: Arm) -> dict[str, Any]:
    """All that makes an arm, for another process."""
    facts = {field.name: getattr(arm, field.name) for field in dataclasses.fields(arm)}
    facts["attached_error"] = None  # of no use to a reader
    if arm.attached is not None:
        facts["attached"] = parameters_to_json(arm.attached)
    if arm.links is not None:
        facts["links"] = np.asarray(arm.links).tolist()
    return facts


def arm_from_json(facts: dict[str, Any]) -> Arm:
    """The arm again."""
    facts = dict(facts)
    if facts["attached"] is not None:
        facts["attached"] = parameters_from_json(facts["attached"])
    if facts["links"] is not None:
        facts["links"] = np.array(facts["links"])
    for name in ("gravity", "acceleration", "jerk"):
        facts[name] = None if facts[name] is None else tuple(facts[name])
    if facts["velocity_ends"] is not None:
        facts["velocity_ends"] = tuple(map(tuple, facts["velocity_ends"]))
    return Arm(**facts)


def parameters_to_json(parameters: InertialParameters) -> dict[str, Any]:
    """Ten parameters and the name of their frame."""
    return {"phi": parameters.phi.tolist(), "frame": parameters.frame}


def parameters_from_json(facts: dict[str, Any]) -> InertialParameters:
    """The parameters again."""
    return InertialParameters(np.array(facts["phi"]), facts["frame"])


def payloads_to_json(payloads: Sequence[tuple[float, Any]]) -> list[list[Any]]:
    """(time, payload) pairs, each payload as its ten parameters and their frame, or None."""
    held = [(t, getattr(payload, "parameters", payload)) for t, payload in payloads]
    return [[float(t), None if parameters is None else parameters_to_json(parameters)] for t, parameters in held]


def payloads_from_json(pairs: list[list[Any]]) -> list[tuple[float, InertialParameters | None]]:
    """The pairs again."""
    return [(t, None if facts is None else parameters_from_json(facts)) for t, facts in pairs]
