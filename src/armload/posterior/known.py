"""A payload's mass as an input: it was weighed, and what a log says of the rest follows from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.errors import IdentificationError


@dataclass(frozen=True)
class KnownMass:
    """A weighed mass.

    Args:
        mass: [kg]. std: its standard deviation [kg].

    Raises:
        IdentificationError: not finite, or a standard deviation that is not above zero.
    """

    mass: float
    std: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and np.isfinite(self.std) and self.std > 0.0):
            raise IdentificationError(
                f"a known mass of {self.mass:g} ± {self.std:g} kg: expected a number and a standard deviation above "
                "zero"
            )

    def given(
        self, mean: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi ~ N(mean, covariance), (10,), (10, 10), given the mass M ± s.

        k = C·e / (C_mm + s²), mean + k·(M − m), C − k·eᵀ·C. An error of the torque's scale, which mass and moments
        have in common, goes with the error of the mass.
        """
        k = covariance[:, 0] / (covariance[0, 0] + self.std**2)
        rest = covariance - np.outer(k, covariance[0])
        return mean + k * (self.mass - mean[0]), 0.5 * (rest + rest.T)
