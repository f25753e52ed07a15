"""Whether what is said of a body is in metres and kg·m²: other units give one that no arm can hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.errors import PayloadError
from armload.inertia import InertialParameters

_FARTHEST = 5.0  # [m] a centre of mass farther from the flange than this is in other units
_WIDEST, _LIGHT = 1.0, 0.01  # [m] radius of gyration; [kg] below which inertia is what was known beforehand


def require_metres(com: NDArray[np.float64], what: str) -> None:
    """Raise `PayloadError` if a centre of mass (3,) [m] is too far from its frame to be in metres; what: says so."""
    if np.linalg.norm(com) > _FARTHEST:
        raise PayloadError(
            f"{what} puts the centre of mass {np.linalg.norm(com):.3g} m from the frame: "
            "expected metres; is it in millimetres?"
        )


def require_kilogram_square_metres(parameters: InertialParameters, what: str) -> None:
    """Raise `PayloadError` if a body is too wide for its inertia to be in kg·m²; what: says so.

    Its largest radius of gyration about the centre of mass is sqrt(max eig(I_com) / m) [m].
    """
    if parameters.mass <= _LIGHT:
        return
    reach = float(np.sqrt(np.abs(np.linalg.eigvalsh(parameters.inertia_com)).max() / parameters.mass))
    if reach > _WIDEST:
        raise PayloadError(
            f"{what} has the inertia of a body {reach:.3g} m wide about its centre of mass (radius of "
            f"gyration): expected at most {_WIDEST:g} m; is it in kg·m²?"
        )
