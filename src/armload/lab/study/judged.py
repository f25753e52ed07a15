"""A statement's number with its interval, and whether its criterion holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.lab.study.multiverse import LEVEL

_DRAWS = 400  # of the bootstrap


class Measured(NamedTuple):
    """A claim under one split: the number, its interval (None: a single unit), how many units, whether it holds.

    holds: None where the interval holds values on both sides of the criterion. cap on epochs and seeds behind it.
    """

    value: float
    bounds: tuple[float, float] | None
    units: int
    holds: bool | None
    cap: int | None = None
    seeds: tuple[int, ...] = ()


def judged(
    statistic: Callable[..., float],
    arrays: Sequence[NDArray],
    criterion: Callable[[float], bool],
    most: int | None = None,
    seeds: tuple[int, ...] = (),
) -> Measured:
    """A statistic of errors (U, ...) with its bootstrap interval over the units, which are drawn for all arrays alike.

    It holds if the criterion does at the value and at both bounds; it is open if at some of them.
    """
    value, units = statistic(*arrays), len(arrays[0])
    if units < 2 or any(len(a) != units for a in arrays):
        return Measured(value, None, units, criterion(value), most, seeds)
    drawn = np.random.default_rng(units).integers(units, size=(_DRAWS, units))
    found = [statistic(*(a[rows] for a in arrays)) for rows in drawn]
    low, high = np.quantile(found, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    at = {criterion(value), criterion(float(low)), criterion(float(high))}
    holds = None if len(at) > 1 else at.pop()
    return Measured(value, (float(low), float(high)), units, holds, most, seeds)
