"""armload: tell a robot arm what it is holding, from joint position, velocity and torque.

    from armload import arm, read_recording
    from armload.identify import identify

    panda = arm("panda")
    print(identify(read_recording("run.csv", panda), panda))

The names below are imported when they are first used, so that `import armload` is instant. `armload.identify` and
`armload.simulate` are modules, with a function of the same name inside.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from armload.arms import ARMS, Arm, arm
    from armload.errors import ArmloadError
    from armload.hybrid import HybridIdentifier
    from armload.identifier import Estimate, Identifier
    from armload.identify import Identification
    from armload.inertia import InertialParameters
    from armload.learners import LearnedIdentifier, load_model, save_model
    from armload.least_squares import (
        FilteredRecursiveLeastSquares,
        PosteriorLeastSquares,
        RecursiveLeastSquares,
    )
    from armload.methods import METHODS
    from armload.motion import FourierMotion, Motion, check_motion, taie2024
    from armload.online import OnlineIdentifier
    from armload.payloads import Payload, read_payload, write_payload
    from armload.recording import Recording, Sample, read_recording, write_recording
    from armload.simulate import Sensors, World
    from armload.sources import open_source

_ROOMS = {
    "ARMS": "arms",
    "Arm": "arms",
    "arm": "arms",
    "ArmloadError": "errors",
    "HybridIdentifier": "hybrid",
    "Estimate": "identifier",
    "Identifier": "identifier",
    "METHODS": "methods",
    "Identification": "identify",
    "InertialParameters": "inertia",
    "LearnedIdentifier": "learners",
    "load_model": "learners",
    "save_model": "learners",
    "FilteredRecursiveLeastSquares": "least_squares",
    "PosteriorLeastSquares": "least_squares",
    "RecursiveLeastSquares": "least_squares",
    "FourierMotion": "motion",
    "OnlineIdentifier": "online",
    "Motion": "motion",
    "check_motion": "motion",
    "taie2024": "motion",
    "Payload": "payloads",
    "read_payload": "payloads",
    "write_payload": "payloads",
    "Recording": "recording",
    "Sample": "recording",
    "read_recording": "recording",
    "write_recording": "recording",
    "Sensors": "simulate",
    "World": "simulate",
    "open_source": "sources",
}

__all__ = [
    "ARMS",
    "METHODS",
    "Arm",
    "ArmloadError",
    "Estimate",
    "FilteredRecursiveLeastSquares",
    "FourierMotion",
    "HybridIdentifier",
    "Identification",
    "Identifier",
    "InertialParameters",
    "LearnedIdentifier",
    "Motion",
    "OnlineIdentifier",
    "Payload",
    "PosteriorLeastSquares",
    "Recording",
    "RecursiveLeastSquares",
    "Sample",
    "Sensors",
    "World",
    "__version__",
    "arm",
    "check_motion",
    "load_model",
    "open_source",
    "read_payload",
    "read_recording",
    "save_model",
    "taie2024",
    "write_payload",
    "write_recording",
]


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module 'armload' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"armload.{_ROOMS[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
