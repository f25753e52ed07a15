"""Wide, thin bodies that are carried at their centre: trays, bars, discs and rings across the flange.

Such a body has the mass and the centre of a compact one and several times its inertia. It lies across the flange's
axis, z, and is turned about it in any way, as a suction gripper or a gripper on its middle holds it. Stated sizes for
an arm rated for 3 kg: from a saucer to a tray that it still turns beside its own links, from sheet metal to a board.
With 0.6 m as the longest, the prior guesses inertias that a log does not tell up to a third worse
(`benchmarks/wide_and_light.py`). Made of solids, so consistent by construction; lengths as in `shapes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.inertia import InertialParameters
from armload.payloads import solids
from armload.payloads.shapes import Shape

_LONGEST, _THICK = (0.12, 0.45), (0.002, 0.02)  # [m] longest side or diameter, and thickness; evenly in their logarithm
_BROADEST_BAR = 0.05  # [m] a bar is between as broad as thick and so broad
_OFF, _ALONG = 0.015, (0.0, 0.12)  # [m] standard deviation of the centre off the axis, and where it is along it
_HOLLOW = 0.95  # share of a ring's diameter that may be its hole


def _evenly(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """A length, evenly in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(limits))))


def _centre(rng: np.random.Generator, scale: float) -> NDArray[np.float64]:
    return scale * np.array([*rng.normal(0.0, _OFF, size=2), rng.uniform(*_ALONG)])


def _turn(rng: np.random.Generator) -> NDArray[np.float64]:
    """A rotation (3, 3) about z by any angle."""
    c, s = np.cos(angle := rng.uniform(0.0, 2.0 * np.pi)), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def tray(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A tray, a sheet, a board: 0.4 to 1 times as broad as long."""
    long, thick = _evenly(rng, _LONGEST), _evenly(rng, _THICK)
    size = scale * np.array([long, rng.uniform(0.4, 1.0) * long, thick])
    return solids.box(size, mass=mass, rotation=_turn(rng), translation=_centre(rng, scale))


def bar(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A bar, a batten."""
    long, thick = _evenly(rng, _LONGEST), _evenly(rng, _THICK)
    size = scale * np.array([long, rng.uniform(thick, _BROADEST_BAR), thick])
    return solids.box(size, mass=mass, rotation=_turn(rng), translation=_centre(rng, scale))


def ring(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A disc with a hole of any size: a full disc less the disc inside it."""
    outer, thick = 0.5 * scale * _evenly(rng, _LONGEST), scale * _evenly(rng, _THICK)
    inner, at = rng.uniform(0.05, _HOLLOW) * outer, _centre(rng, scale)
    full = mass * outer**2 / (outer**2 - inner**2)
    disc = solids.cylinder(outer, thick, mass=full, translation=at)
    return disc - solids.cylinder(inner, thick, mass=full - mass, translation=at)


WIDE: dict[str, Shape] = {"tray": tray, "bar": bar, "ring": ring}
