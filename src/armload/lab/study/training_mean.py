"""Where the training mean, which looks at no measurement, is right by chance, and what errors come to elsewhere.

A geometric mean of ratios to the training mean counts such a parameter against every method that measures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES
from armload.lab.study.numbers import Cells, at_first, benchmark, both_stages, mean_ratio
from armload.lab.study.spec import REAL
from armload.payloads import test_payload

HIT = 0.02  # of the truth, within which the training mean is right by chance


def by_chance(blind: NDArray[np.float64]) -> NDArray[np.bool_]:
    """On which parameters (10,) the training mean, whose errors are `blind` (R, 10), is right by chance."""
    return blind.mean(axis=0) < HIT * np.abs(test_payload().parameters.phi)


def names_by_chance(blind: NDArray[np.float64]) -> list[str]:
    """The same by name."""
    return [name for name, hit in zip(NAMES, by_chance(blind), strict=True) if hit]


def ratio_elsewhere(errors: NDArray[np.float64], blind: NDArray[np.float64]) -> float:
    """Errors (R, 10) over those of the training mean: geometric mean over the parameters it does not hit by chance."""
    rest = ~by_chance(blind)
    return mean_ratio(errors.mean(axis=0)[rest], blind.mean(axis=0)[rest])


def first_elsewhere(cells: Cells, kind: str) -> tuple[list[str], float, float] | None:
    """Of an ensemble's first estimate on real-like arms: the parameters that the training mean hits by chance, the
    ratio of the errors on the others, and the ratio on Izz. None: a cell is missing, or there is no such parameter."""
    own = both_stages(cells, kind, "row", REAL, read=at_first)
    blind = at_first(benchmark(cells, "training-mean", "row"), REAL)
    if own is None or blind is None or not by_chance(blind).any():
        return None
    at = NAMES.index("Izz")
    izz = own.errors[:, at].mean() / blind[:, at].mean()
    return names_by_chance(blind), ratio_elsewhere(own.errors, blind), float(izz)
