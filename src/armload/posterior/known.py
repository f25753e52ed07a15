"""What is known of a payload apart from the log: its weight, its centre, all of it from a drawing, or its kind.

Each of the first three is one more measurement of phi ~ N(mean, C), H·phi = z + N(0, R), so that with
S = H·C·Hᵀ + R and K = C·Hᵀ·S⁻¹

    phi given it ~ N(mean + K·(z − H·mean), C − K·S·Kᵀ)

    a mass M ± s [kg]       H = (1, 0 …),          z = M,  R = s²
    a centre r ± s [m]      H = (−r, 1, 0 …),      z = 0,  R = s²·E[m²]·1      m·(com − r) ~ N(0, (s·m)²) on each axis
    a body phi_0            H = 1,                 z = phi_0,  R its covariance

An error of the torque's scale, which mass and moments have in common, goes with the error of the mass, and leaves the
centre alone. Families of payloads are no measurement: they say which components of a learned prior count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import IdentificationError
from armload.inertia import HELD
from armload.inertia.determinacy import LIGHTEST_HELD
from armload.runtime.real_numbers import own_reals

# [standard deviations] of a centre's three coordinates: as unlikely of the truth as `HELD` of a mass, 0.27 %
# (test_three_coordinates_are_as_seldom_denied_as_one_mass)
FAR = 3.7625
# the same of a body's ten parameters (test_ten_parameters_are_as_seldom_denied_as_one_mass)
UNLIKE = 5.1866
# ln of the odds at which a log denies a family: as seldom as a mass, 0.27 %
DENIED = float(np.log(0.0027))
_FARTHEST = 5.0  # [m] from the frame's origin, of anything an arm holds: beyond, the unit is another

Gaussian = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class KnownMass:
    """A weighed mass.

    Args:
        mass: [kg]. std: its standard deviation [kg].

    Raises:
        IdentificationError: not finite, or one of both that is not above zero: no body weighs nothing.
    """

    mass: float
    std: float

    def __post_init__(self) -> None:
        if not (0.0 < self.mass < np.inf and _can_be(self.std)):
            raise IdentificationError(
                f"a known mass of {self.mass:g} ± {self.std:g} kg: expected a number and a standard deviation above "
                "zero, both in kg; leave it out where nothing was weighed"
            )

    def given(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Gaussian:
        """phi ~ N(mean, covariance), (10,), (10, 10), given the mass M ± s."""
        return _given(mean, covariance, np.eye(1, 10), np.array([self.mass]), self.std**2)

    def away(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
        """Standard deviations between it and the mass of phi ~ N(mean, covariance)."""
        return float(abs(self.mass - mean[0]) / np.hypot(self.std, np.sqrt(covariance[0, 0])))


@dataclass(frozen=True)
class KnownCentre:
    """A known centre of mass.

    Args:
        com: (3,) [m] in the payload frame that is asked for. std: its standard deviation along each axis [m].

    Raises:
        IdentificationError: not three finite numbers in metres, or a standard deviation that is not above zero.
    """

    com: tuple[float, float, float]
    std: float

    def __post_init__(self) -> None:
        com = own_reals(self.com, "a known centre of mass", IdentificationError)
        if com.shape != (3,) or not (np.all(np.isfinite(com)) and _can_be(self.std)):
            raise IdentificationError(
                f"a known centre of mass of {self.com} ± {self.std:g} m: expected three numbers and a standard "
                "deviation above zero"
            )
        if np.linalg.norm(com) > _FARTHEST:
            raise IdentificationError(
                f"a known centre of mass {np.linalg.norm(com):.3g} m from the payload frame: expected metres; is it in "
                "millimetres?"
            )
        object.__setattr__(self, "com", tuple(com.tolist()))

    @property
    def _rows(self) -> NDArray[np.float64]:
        """H (3, 10): H·phi = m·(com − r)."""
        return np.hstack([-np.array(self.com)[:, None], np.eye(3), np.zeros((3, 6))])

    def _variance(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
        return self.std**2 * float(mean[0] ** 2 + covariance[0, 0])

    def given(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Gaussian:
        """phi ~ N(mean, covariance), (10,), (10, 10), given the centre r ± s."""
        return _given(mean, covariance, self._rows, np.zeros(3), self._variance(mean, covariance))

    def away(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
        """Standard deviations between it and the centre of phi ~ N(mean, covariance), of three degrees of freedom."""
        H = self._rows
        between, S = H @ mean, H @ covariance @ H.T + self._variance(mean, covariance) * np.eye(3)
        return float(np.sqrt(between @ np.linalg.solve(S, between)))


@dataclass(frozen=True, eq=False)
class KnownBody:
    """All ten parameters, of a drawing say, and how well they are known.

    Args:
        phi: (10,) about the payload frame that is asked for. covariance: (10, 10) of its error.

    Raises:
        IdentificationError: other shapes, no number, or a covariance that is not positive definite: what is known
            exactly cannot be tested against a log.
    """

    phi: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def __post_init__(self) -> None:
        phi = own_reals(self.phi, "phi of a known body", IdentificationError)
        covariance = own_reals(self.covariance, "the covariance of a known body", IdentificationError)
        unit = np.sqrt(np.abs(np.diag(covariance))) if covariance.shape == (10, 10) else np.zeros(10)
        if phi.shape != (10,) or not (
            np.all(np.isfinite(phi)) and np.all(np.isfinite(covariance)) and np.all(unit > 0)
        ):
            raise IdentificationError(
                "a known body: expected ten finite parameters and a covariance (10, 10) of their error, each above zero"
            )
        if np.linalg.eigvalsh(covariance / np.outer(unit, unit))[0] <= 0.0:
            raise IdentificationError("a known body: the covariance of its error is not positive definite")
        object.__setattr__(self, "phi", phi)
        object.__setattr__(self, "covariance", covariance)

    def given(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Gaussian:
        """phi ~ N(mean, covariance), (10,), (10, 10), given the body."""
        return _given(mean, covariance, np.eye(10), self.phi, self.covariance)

    def away(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
        """Standard deviations between it and phi ~ N(mean, covariance), of ten degrees of freedom."""
        between, S = self.phi - mean, self.covariance + covariance
        unit = np.sqrt(np.diag(S))  # kg and kg·m² are of unlike size
        return float(np.sqrt((between / unit) @ np.linalg.solve(S / np.outer(unit, unit), between / unit)))


@dataclass(frozen=True, eq=False)
class Known:
    """All that is known of a payload apart from the log.

    Args:
        mass, com, body: None: not known.
        families: those it is of, by the names of the learned prior (`MixturePrior.only`); none: any.
        tool: phi (10,) of a tool that is held with it, in an estimate of both.
        if_held: whether it is taken only where an estimate holds something, and does not deny that this is it: a stream
            goes on when the payload was put down, or another one taken up.
    """

    mass: KnownMass | None = None
    com: KnownCentre | None = None
    tool: NDArray[np.float64] | None = None
    if_held: bool = False
    body: KnownBody | None = None
    families: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        mass: KnownMass | tuple[float, float] | None,
        com: KnownCentre | tuple[ArrayLike, float] | None,
        if_held: bool = False,
        body: KnownBody | None = None,
        families: Sequence[str] = (),
    ) -> Self | None:
        """What a caller knows; None: nothing.

        mass, com: (mass [kg], its standard deviation), (centre (3,) [m], its standard deviation), too.

        Raises:
            IdentificationError: see `KnownMass` and `KnownCentre`.
        """
        weighed = mass if mass is None or isinstance(mass, KnownMass) else KnownMass(*_pair("mass", mass))
        centre = com if com is None or isinstance(com, KnownCentre) else KnownCentre(*_pair("centre of mass", com))
        known = cls(weighed, centre, None, if_held, body, tuple(families))
        return known if known._measured or known.families else None

    def with_tool(self, tool: NDArray[np.float64]) -> Self:
        """The same of an estimate that holds a tool (10,), too."""
        return replace(self, tool=tool)

    @property
    def _measured(self) -> list[KnownMass | KnownCentre | KnownBody]:
        return [one for one in (self.mass, self.com, self.body) if one is not None]

    @property
    def which(self) -> NDArray[np.bool_]:
        """Which parameters (10,) it is about; moments are known where centre and mass are."""
        body = self.body is not None
        return np.r_[self.mass is not None, [self.com is not None] * 3, [False] * 6] | body

    def denied(
        self, mean: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[KnownMass | KnownCentre | KnownBody, ...]:
        """Those of them that phi ~ N(mean, covariance) denies, beyond `HELD`, `FAR` and `UNLIKE`."""
        own = self._own(mean)
        most = {KnownMass: HELD, KnownCentre: FAR, KnownBody: UNLIKE}
        return tuple(one for one in self._measured if one.away(own, covariance) > most[type(one)])

    def believed(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Self | None:
        """What of it phi ~ N(mean, covariance) does not deny; None: nothing."""
        denied = self.denied(mean, covariance)
        mass, com, body = (None if _among(one, denied) else one for one in (self.mass, self.com, self.body))
        left = replace(self, mass=mass, com=com, body=body)
        return left if left._measured else None

    def given(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Gaussian | None:
        """phi ~ N(mean, covariance), (10,), (10, 10), given what of it that does not deny; None: nothing is taken.

        Between two values that cannot both be true lies none that is: what is denied is left out. With `if_held` all
        is, then, and where nothing is held.
        """
        own, denied = self._own(mean), self.denied(mean, covariance)
        if self.if_held:
            least = max(HELD * float(np.sqrt(covariance[0, 0])), LIGHTEST_HELD)
            if own[0] <= least or denied:
                return None
        taken = [one for one in self._measured if not _among(one, denied)]
        if not taken:
            return None
        for one in taken:
            own, covariance = one.given(own, covariance)
        return mean - self._own(mean) + own, covariance

    def _own(self, mean: NDArray[np.float64]) -> NDArray[np.float64]:
        """Less the tool."""
        return mean if self.tool is None else mean - self.tool


def _among(one: Any, others: Sequence[Any]) -> bool:
    return any(one is other for other in others)  # equal ones would need equal arrays


def _pair(what: str, given: Any) -> tuple[Any, float]:
    """A value and its standard deviation, one number."""
    try:
        value, std = given
        return (float(value) if what == "mass" else value), float(std)
    except (TypeError, ValueError):
        raise IdentificationError(
            f"a known {what} of {given!r}: expected two things, the {what} and one standard deviation"
        ) from None


def _given(
    mean: NDArray[np.float64],
    covariance: NDArray[np.float64],
    rows: NDArray[np.float64],
    z: NDArray[np.float64],
    variance: float | NDArray[np.float64],
) -> Gaussian:
    """phi ~ N(mean, covariance) given rows·phi = z + N(0, R), R = variance·1 or the matrix.

    C − K·S·Kᵀ is (1 − K·H)·C·(1 − K·H)ᵀ + K·R·Kᵀ: a sum, which rounding takes below zero nowhere, however small R is.
    """
    cross = rows @ covariance
    R = variance * np.eye(len(z)) if np.ndim(variance) == 0 else variance
    S = cross @ rows.T + R
    unit = np.sqrt(np.diag(S))  # kg and kg·m² are of unlike size
    K = np.linalg.solve(S / np.outer(unit, unit), cross / unit[:, None]).T / unit
    left = np.eye(len(mean)) - K @ rows
    rest = left @ covariance @ left.T + K @ R @ K.T
    return mean + K @ (z - rows @ mean), 0.5 * (rest + rest.T)


def _can_be(std: float) -> bool:
    """Whether it is a standard deviation above zero whose square is a number above zero, too."""
    return bool(std > 0.0 and 0.0 < std * std < np.inf)
