"""How far the ten parameters of a body may be off that an answer is given without."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Inexact:
    """The error of phi of something that counts as known, such as a tool.

    Args:
        covariance: of phi (10, 10), about the frame of what it is a part of; zero: exact.
        calibrated: whether intervals that allow for it may be called so.
        notes: what there is to say of it.
    """

    covariance: NDArray[np.float64]
    calibrated: bool = True
    notes: tuple[str, ...] = ()

    @property
    def is_none(self) -> bool:
        """Whether the body is exactly known, and there is nothing to say."""
        return self.calibrated and not self.notes and not np.any(self.covariance)

    def __add__(self, other: Inexact) -> Inexact:
        """Of two bodies together, whose errors have nothing to do with each other."""
        covariance = self.covariance + other.covariance
        return Inexact(covariance, self.calibrated and other.calibrated, (*self.notes, *other.notes))
