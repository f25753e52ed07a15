"""How well a tool is known: a covariance of phi from what is said of its mass, its centre and its inertia.

Of one that was identified, its own answer says it (`Measured`).

To first order, with m, r, I_c independent and δ their errors,

    δ(m·r) = r·δm + m·δr,    δI = δI_c + ([r]²_×)·δm + m·δ([r]²_×),    [r]²_× = rᵀ·r·1 − r·rᵀ
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.errors import PayloadError
from armload.inertia import InertialParameters, com_to_phi, inertia_matrix, vech
from armload.runtime.real_numbers import reals

_STEP = 1e-6  # of a difference quotient: phi is of second degree in r, so that a central one is exact but for rounding
_ROUNDING = 1e-6  # of a correlation: what printed digits leave


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of what is known of a body; 0: exactly.

    Args:
        mass: [kg]. com: of each coordinate of the centre of mass [m].
        inertia: of each moment and product about the centre of mass, as a share of the mean principal moment.

    Raises:
        PayloadError: a number below zero, or none.
    """

    mass: float = 0.0
    com: float = 0.0
    inertia: float = 0.0

    def __post_init__(self) -> None:
        if not all(_can_be(x) for x in (self.mass, self.com, self.inertia)):
            raise PayloadError(
                f"an uncertainty of {self.mass} kg, {self.com} m and {self.inertia} of the inertia: expected numbers "
                "of 0 or more"
            )

    def covariance(self, body: InertialParameters) -> NDArray[np.float64]:
        """Of phi (10, 10), about the frame of the body."""
        if self == Uncertainty():
            return np.zeros((10, 10))
        x = np.r_[body.mass, body.com, vech(body.inertia_com)]
        std = np.r_[self.mass, [self.com] * 3, [self.inertia * np.trace(body.inertia_com) / 3.0] * 6]
        columns = []
        for k, size in enumerate(std):
            step = np.where(np.arange(10) == k, _STEP, 0.0)
            columns.append(size * (_phi(x + step) - _phi(x - step)) / (2.0 * _STEP))
        J = np.column_stack(columns)
        return J @ J.T


@dataclass(frozen=True, eq=False)
class Measured:
    """How well a body is known that was identified.

    Args:
        covariance: of phi (10, 10), about the frame of the body.
        calibrated: whether the intervals of the answer are.

    Raises:
        PayloadError: the covariance is not one.
    """

    covariance: NDArray[np.float64]
    calibrated: bool = True

    def __post_init__(self) -> None:
        expected = "expected a symmetric matrix (10, 10) without eigenvalues below zero"
        try:
            covariance = reals(self.covariance).copy()
        except ValueError as error:
            raise PayloadError(f"the covariance of phi is {error}: {expected}") from None
        if covariance.shape != (10, 10) or not np.isfinite(covariance).all():
            raise PayloadError(f"the covariance of phi has shape {covariance.shape} or is not finite: {expected}")
        scale = np.sqrt(np.abs(np.diag(covariance)))
        unit = covariance / np.outer(scale, scale).clip(np.finfo(float).tiny)
        if not np.allclose(unit, unit.T, atol=_ROUNDING) or np.linalg.eigvalsh(unit)[0] < -_ROUNDING:
            raise PayloadError(f"the covariance of phi is none: {expected}")
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)


def _phi(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """phi (10,) of mass, centre and inertia about it, (10,)."""
    return com_to_phi(x[0], x[1:4], inertia_matrix(x[4:]))


def _can_be(std: float) -> bool:
    """Whether it is a standard deviation of 0 or more whose square is finite, too."""
    try:
        return float(std) >= 0.0 and float(std) * float(std) < np.inf
    except (TypeError, ValueError, OverflowError):
        return False
