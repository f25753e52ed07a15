"""Homogeneous solids in closed form, and bodies composed of them.

Each solid is given about its own centre and then placed: R_ab turns its axes into those of the payload frame and p_ab
is its centre there. Composition is addition, because phi is linear in the density: phi(a and b) = phi(a) + phi(b).

| solid    | inertia about its centre                                  | volume      |
|----------|-----------------------------------------------------------|-------------|
| box      | m/12·diag(b² + c², a² + c², a² + b²)                       | a·b·c       |
| cylinder | m/12·diag(3·r² + l², 3·r² + l², 6·r²), axis z              | π·r²·l      |
| sphere   | 2/5·m·r²·1                                                 | 4/3·π·r³    |
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import PayloadError
from armload.inertia import InertialParameters
from armload.runtime.real_numbers import reals


def box(
    size: ArrayLike,
    *,
    mass: float | None = None,
    density: float | None = None,
    rotation: ArrayLike | None = None,
    translation: ArrayLike | None = None,
    frame: str | None = None,
) -> InertialParameters:
    """A homogeneous box.

    >>> box((0.1, 0.1, 0.2), density=1000, translation=(0, 0, 0.1)).first_moment.round(6).tolist()
    [0.0, 0.0, 0.2]

    Args:
        size: sides (3,) along the box's own axes [m].
        mass: [kg]; give either mass or density.
        density: [kg/m³].
        rotation: R_ab (3, 3), the box's axes in the payload frame. Default: aligned.
        translation: p_ab (3,), the box's centre in the payload frame [m]. Default: the origin.
        frame: name of the payload frame.

    Raises:
        PayloadError: a side, mass or density that is not positive, or both or neither of mass and density.
        InertiaError: rotation or translation is not one.
    """
    a, b, c = positive_vector(size, "size of the box")
    m = mass_of("the box", a * b * c, mass, density)
    inertia = m / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    return placed(InertialParameters.from_com(m, np.zeros(3), inertia), rotation, translation, frame)


def cylinder(
    radius: float,
    length: float,
    *,
    mass: float | None = None,
    density: float | None = None,
    rotation: ArrayLike | None = None,
    translation: ArrayLike | None = None,
    frame: str | None = None,
) -> InertialParameters:
    """A homogeneous cylinder whose own z axis is its axis of symmetry; radius and length in metres, the rest as `box`.

    >>> round(float(cylinder(0.1, 0.2, mass=2.0).inertia[2, 2]), 6)
    0.01
    """
    r, length = positive(radius, "radius of the cylinder"), positive(length, "length of the cylinder")
    m = mass_of("the cylinder", np.pi * r * r * length, mass, density)
    across = m / 12 * (3 * r * r + length * length)
    inertia = np.diag([across, across, m / 2 * r * r])
    return placed(InertialParameters.from_com(m, np.zeros(3), inertia), rotation, translation, frame)


def sphere(
    radius: float,
    *,
    mass: float | None = None,
    density: float | None = None,
    translation: ArrayLike | None = None,
    frame: str | None = None,
) -> InertialParameters:
    """A homogeneous ball; radius in metres, the rest as `box`.

    >>> round(float(sphere(0.1, mass=2.5).inertia[0, 0]), 6)
    0.01
    """
    r = positive(radius, "radius of the sphere")
    m = mass_of("the sphere", 4 / 3 * np.pi * r * r * r, mass, density)
    return placed(InertialParameters.from_com(m, np.zeros(3), 0.4 * m * r * r * np.eye(3)), None, translation, frame)


def compose(parts: Iterable[InertialParameters], frame: str | None = None) -> InertialParameters:
    """One body made of parts that are all about the same frame: phi = Σ phi_k.

    Raises:
        InertiaError: two parts name different frames.
    """
    total = InertialParameters.zero(frame)
    for part in parts:
        total = total + part
    return total


def placed(
    parameters: InertialParameters,
    rotation: ArrayLike | None = None,
    translation: ArrayLike | None = None,
    frame: str | None = None,
) -> InertialParameters:
    """`parameters.moved` with the identity for what is not given."""
    return parameters.moved(
        np.eye(3) if rotation is None else rotation, np.zeros(3) if translation is None else translation, frame
    )


def mass_of(what: str, volume: float, mass: float | None, density: float | None) -> float:
    """The mass [kg] of a volume [m³], of which exactly one of mass and density is given."""
    if (mass is None) == (density is None):
        given = "neither mass nor density is" if mass is None else "both mass and density are"
        raise PayloadError(f"{given} given for {what}: expected exactly one of mass [kg] and density [kg/m³]")
    if mass is not None:
        return positive(mass, f"mass of {what}")
    return positive(density, f"density of {what}") * volume


def positive(value: float | None, name: str) -> float:
    """`value` as a float, if it is a finite number above zero."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not (np.isfinite(number) and number > 0):
        raise PayloadError(f"{name} is {value!r}: expected a finite number above 0 in SI units")
    return number


def positive_vector(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """`values` as an array (3,), if they are three finite numbers above zero."""
    try:
        v = reals(values)
    except ValueError:
        v = np.empty(0)
    if v.shape != (3,) or not np.all(np.isfinite(v)) or not np.all(v > 0):
        raise PayloadError(f"{name} is {values!r}: expected 3 finite numbers above 0 in metres")
    return v
