"""Bodies unlike those of any other family: held far off the flange's axis, with their mass far from their centre.

No prior is fitted on them; they test an estimator outside the training families. Made of solids, so consistent by
construction; lengths as in `shapes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.inertia import InertialParameters
from armload.payloads import solids
from armload.payloads.shapes import Shape, any_turn

_ASIDE = (0.14, 0.25)  # [m] centre of mass off the flange's axis; 99 % of the other families' lie within 0.14
_ALONG = (0.0, 0.16)  # [m] the same along the axis, as the other families have it
_LEAD = 11340.0  # [kg/m³]


def _aside(rng: np.random.Generator, scale: float) -> NDArray[np.float64]:
    """A place (3,) off the flange's axis, on any side of it [m]."""
    off, angle, along = rng.uniform(*_ASIDE), rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*_ALONG)
    return scale * np.array([off * np.cos(angle), off * np.sin(angle), along])


def dumbbell(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """Two balls of lead at the ends of a light rod, turned any way."""
    length, rod = scale * rng.uniform(0.2, 0.5), rng.uniform(0.03, 0.08)
    share = rng.uniform(0.3, 0.7) * (1.0 - rod)
    masses = mass * np.array([share, 1.0 - rod - share])
    rotation, at = any_turn(rng), _aside(rng, scale)
    axis = rotation[:, 2]
    ends = length * np.array([-0.5, 0.5])
    ends = ends - masses @ ends / mass  # so that the centre of mass is at the place drawn
    middle = at + ends.mean() * axis
    parts = [solids.cylinder(0.01 * scale, length, mass=rod * mass, rotation=rotation, translation=middle)]
    for m, end in zip(masses.tolist(), ends.tolist(), strict=True):
        radius = float(np.cbrt(m / (_LEAD * 4 / 3 * np.pi)))
        parts.append(solids.sphere(radius, mass=m, translation=at + end * axis))
    return solids.compose(parts)


def pole(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A thin rod as long as an arm's link, turned any way."""
    radius, length = scale * rng.uniform(0.004, 0.012), scale * rng.uniform(0.5, 0.9)
    return solids.cylinder(radius, length, mass=mass, rotation=any_turn(rng), translation=_aside(rng, scale))


def pane(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A wide thin plate, turned any way."""
    size = scale * np.append(rng.uniform(0.3, 0.6, size=2), rng.uniform(0.001, 0.005))
    return solids.box(size, mass=mass, rotation=any_turn(rng), translation=_aside(rng, scale))


def ring(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A ring of square section, turned any way: a full disc less the disc inside it."""
    outer, thick = scale * rng.uniform(0.12, 0.25), scale * rng.uniform(0.01, 0.03)
    inner = outer - thick
    rotation, at = any_turn(rng), _aside(rng, scale)
    full = mass * outer**2 / (outer**2 - inner**2)
    disc = solids.cylinder(outer, thick, mass=full, rotation=rotation, translation=at)
    return disc - solids.cylinder(inner, thick, mass=full - mass, rotation=rotation, translation=at)


ODD: dict[str, Shape] = {"dumbbell": dumbbell, "pole": pole, "pane": pane, "ring": ring}
