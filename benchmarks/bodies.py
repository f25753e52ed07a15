"""Bodies of a stated mass for the scripts of this folder."""

from __future__ import annotations

from armload import Payload
from armload.inertia import InertialParameters
from armload.payloads import draw_payload


def body_of(mass: float, seed: int) -> Payload:
    """A random body, made as heavy as that [kg] at the same shape: phi · mass / m.

    `draw_payload` takes what an arm is rated for: what it draws is lighter.
    """
    drawn = draw_payload("boxes", seed).parameters
    return Payload(f"{mass:g} kg", InertialParameters(drawn.phi * (mass / drawn.mass)))
