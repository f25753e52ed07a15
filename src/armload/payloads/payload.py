"""A `Payload`: a name, ten inertial parameters, and optionally the boxes it is made of, for pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import PayloadError
from armload.inertia import InertialParameters, is_consistent
from armload.payloads import solids
from armload.payloads.uncertainty import Measured, Uncertainty
from armload.runtime.real_numbers import reals

_WATER = 1000.0  # [kg/m³]
INERTIA_ASSUMED = "the inertia is not given: that of a ball as dense as water about the centre of mass is taken"


@dataclass(frozen=True)
class Box:
    """A homogeneous box aligned with the payload frame.

    >>> round(Box.of_density((0.1, 0.1, 0.1), (0, 0, 0.05), 1250).mass, 6)
    1.25

    Args:
        size: sides (x, y, z) [m].
        centre: where its centre is in the payload frame [m].
        mass: [kg].

    Raises:
        PayloadError: a side or the mass is not positive, or the centre is not three finite numbers.
    """

    size: tuple[float, float, float]
    centre: tuple[float, float, float]
    mass: float

    def __post_init__(self) -> None:
        size = solids.positive_vector(self.size, "size of the box")
        try:
            centre = reals(self.centre)
        except ValueError:
            centre = np.empty(0)
        if centre.shape != (3,) or not np.all(np.isfinite(centre)):
            raise PayloadError(f"centre of the box is {self.centre!r}: expected 3 finite numbers in metres")
        object.__setattr__(self, "size", tuple(size.tolist()))
        object.__setattr__(self, "centre", tuple(centre.tolist()))
        object.__setattr__(self, "mass", solids.positive(self.mass, "mass of the box"))

    @classmethod
    def of_density(cls, size: tuple[float, float, float], centre: tuple[float, float, float], density: float) -> Box:
        """A box of a material: density in kg/m³, the rest as the class."""
        volume = float(np.prod(solids.positive_vector(size, "size of the box")))
        return cls(size, centre, solids.mass_of("the box", volume, None, density))

    @property
    def parameters(self) -> InertialParameters:
        """phi of this box about the origin of the payload frame."""
        return solids.box(self.size, mass=self.mass, translation=self.centre)


@dataclass(frozen=True)
class Payload:
    """Something a robot holds.

    Args:
        name: what to call it in tables.
        parameters: phi about the origin and in the axes of the arm's payload frame.
        boxes: what it looks like, if known; pictures only, the parameters are what counts.
        inertia_known: False where only mass and centre of mass are known, and the inertia is `without_inertia`'s.
        uncertainty: how well the rest is known.
        measured: the same of one that was identified, in place of what is stated.

    Raises:
        PayloadError: no body can have these parameters.
    """

    name: str
    parameters: InertialParameters
    boxes: tuple[Box, ...] = ()
    inertia_known: bool = True
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    measured: Measured | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", tuple(self.boxes))
        require_consistent(self.parameters, f"payload {self.name!r}")

    @classmethod
    def from_boxes(cls, name: str, boxes: Sequence[Box], frame: str | None = None) -> Payload:
        """The payload that these boxes make together: phi = Σ phi_k."""
        if not boxes:
            raise PayloadError(f"payload {name!r} is made of no boxes: expected at least one")
        return cls(name, solids.compose((b.parameters for b in boxes), frame), tuple(boxes))

    @classmethod
    def without_inertia(cls, name: str, mass: float, com: ArrayLike, frame: str | None = None) -> Payload:
        """Mass [kg] and centre of mass (3,) [m] alone: the inertia about it is taken to be a ball's, as dense as water.

        I = ⅖·m·R², R = (3·m / (4π·ρ))^⅓: about the least that something solid of the mass can have.

        >>> tool = Payload.without_inertia("tool", 0.73, (0.0, 0.0, 0.03))
        >>> round(1e3 * float(tool.parameters.inertia_com[0, 0]), 3), tool.inertia_known
        (0.911, False)
        """
        mass = solids.positive(mass, "mass of the payload")
        radius = (3.0 * mass / (4.0 * np.pi * _WATER)) ** (1.0 / 3.0)
        ball = 0.4 * mass * radius**2 * np.eye(3)
        return cls(name, InertialParameters.from_com(mass, com, ball, frame), inertia_known=False)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """How well it is known: of phi (10, 10), about its frame."""
        return self.uncertainty.covariance(self.parameters) if self.measured is None else self.measured.covariance

    def __str__(self) -> str:
        return f"{self.name}: {self.parameters}"


def require_consistent(parameters: InertialParameters, what: str) -> None:
    """Raise `PayloadError` unless a body with these parameters can exist, or nothing at all (phi = 0)."""
    if not np.any(parameters.phi):
        return
    if parameters.mass <= 0:
        raise PayloadError(f"{what} has a mass of {parameters.mass:g} kg: expected a mass above 0")
    if not is_consistent(parameters.phi):
        moments = ", ".join(f"{x:.3g}" for x in np.linalg.eigvalsh(parameters.inertia_com))
        raise PayloadError(
            f"{what} cannot exist: its principal moments about the centre of mass are {moments} kg·m², expected three "
            "that are not negative and none larger than the sum of the others; check the frame and the point the "
            "inertia is about, or project with armload.inertia.nearest_consistent"
        )
