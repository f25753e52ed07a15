"""How well a payload is to be known: what a motion is designed for, and when a measurement may end."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.errors import UsageError
from armload.estimators import Estimate
from armload.inertia import Z95
from armload.posterior import Known

# what each word of `Accuracy.read` may be given in, in SI units
_UNITS = {
    "mass": {"kg": 1.0, "g": 1e-3},
    "moment": {"kg.m": 1.0, "g.m": 1e-3},
    "inertia": {"kg.m2": 1.0, "g.m2": 1e-3},
}


@dataclass(frozen=True)
class Accuracy:
    """The largest 95 % half-widths wanted; infinite: any will do.

    >>> Accuracy.read("mass=10g,moment=1.5g.m,inertia=1e-3")
    Accuracy(mass=0.01, moment=0.0015, inertia=0.001)

    Args:
        mass: [kg]. moment: of each first moment m·c [kg·m]. inertia: of each second moment about the frame's origin
            [kg·m²].

    Raises:
        UsageError: nothing is wanted, or a width that is not above 0.
    """

    mass: float = np.inf
    moment: float = np.inf
    inertia: float = np.inf

    def __post_init__(self) -> None:
        each = np.array([self.mass, self.moment, self.inertia])
        if not (each > 0).all() or np.isinf(each).all():
            raise UsageError(f"the accuracy {each.tolist()} is not possible: expected half-widths above 0")

    @classmethod
    def read(cls, text: str) -> Self:
        """From words such as mass=10g,moment=1.5g.m,inertia=1e-3; without a unit kg, kg·m and kg·m² are meant.

        Raises:
            UsageError: it cannot be understood.
        """
        given: dict[str, float] = {}
        for part in text.split(","):
            name, _, value = (each.strip() for each in part.partition("="))
            found = re.fullmatch(r"([0-9.]+(?:e[-+]?\d+)?)\s*([a-z][a-z.2²·]*)?", value)
            unit = "" if found is None else (found[2] or "").replace("·", ".").replace("²", "2")
            scale = 1.0 if not unit else _UNITS.get(name, {}).get(unit)
            try:
                number = float(found[1]) if found is not None else 0.0
            except ValueError:
                number = 0.0
            if name not in _UNITS or name in given or scale is None or not number > 0:
                raise UsageError(
                    f"{part!r} is no accuracy: expected mass=…g, moment=…g.m or inertia=…kg.m2, each at most once, "
                    "such as mass=10g,moment=1.5g.m,inertia=1e-3"
                )
            given[name] = number * scale
        return cls(**given)

    def reached(self, estimate: Estimate, known: Known | None = None) -> bool:
        """Whether an estimate is so good, together with what is known beside the log."""
        given = None if known is None else known.given(estimate.phi, estimate.covariance)
        covariance = estimate.covariance if given is None else given[1]
        return self.holds(Z95 * np.sqrt(np.maximum(np.diag(covariance), 0.0)))

    def holds(self, half_width: NDArray[np.float64]) -> bool:
        """Whether half-widths (10,) are at most those wanted."""
        return self.over(half_width) <= 1.0

    def over(self, half_width: NDArray[np.float64]) -> float:
        """The largest of the half-widths (10,) over the one wanted."""
        return float((half_width / np.repeat([self.mass, self.moment, self.inertia], [1, 3, 6])).max())
