"""Whether an arm holds things loosely: what its logs' first moments gain when an axis turns over, against the mass.

Of each part of a log `armload.identification.play` says by how much, d, the first moment along an axis is larger where
that axis points down, and how well that is known, std. What is held and slides between two stops, s either way, gives
2·m·s; what the arm does wrong by itself does not grow with the mass m. Of an arm's last parts, along each axis,

    d = a + 2·s·m + e,      e ~ N(0, σ²·std²)

by weighted least squares, σ from what is left over; T = 2·s over its standard error is Student's t of N − 2 degrees of
freedom where nothing is loose, and large and positive where something is. It need not be many times its standard error
in any one log: the logs of some days are asked together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from armload.survey.rows import PLAY

# [parts] of the last logs that are asked together: some days of a cell that works, so that an arm that was put right
# is sound again. A stated choice
LAST_PARTS = 100
# [parts] fewer say nothing: a line through a few points fits by chance
FEWEST_PARTS = 12
# share of sound arms that are called loose, over all axes: a stated choice (`benchmarks/fleet.py` counts them)
FALSE_ALARMS = 1e-3


@dataclass(frozen=True)
class Looseness:
    """How loosely an arm holds things, along the axis that shows it most.

    play: s [m]. std: of it [m]. statistic: T. threshold: what T is beyond in `FALSE_ALARMS` of sound arms.
    axis: as the columns count it. parts: how many were asked.
    """

    play: float
    std: float
    statistic: float
    threshold: float
    axis: int
    parts: int

    @property
    def found(self) -> bool:
        """Whether something is loose."""
        return self.statistic > self.threshold


def looseness(rows: Sequence[Mapping[str, Any]]) -> Looseness | None:
    """How loosely an arm holds things; None: too few of its logs can tell.

    Args:
        rows: of one arm, the oldest first.
    """
    found: list[Looseness] = []
    for axis in PLAY:
        asked = [row for row in rows if (row.get(f"play_{axis}_std") or 0.0) > 0.0][-LAST_PARTS:]
        if len(asked) < FEWEST_PARTS:
            continue
        d, std, mass = (np.array([row[name] for row in asked]) for name in (f"play_{axis}", f"play_{axis}_std", "mass"))
        line = _line(np.maximum(mass, 0.0), d, std)
        if line is not None:
            slope, error = line
            most = float(student.ppf(1.0 - FALSE_ALARMS / len(PLAY), len(asked) - 2))
            found.append(Looseness(slope / 2.0, error / 2.0, slope / error, most, axis, len(asked)))
    return max(found, key=lambda one: one.statistic / one.threshold, default=None)


def _line(x: np.ndarray, y: np.ndarray, std: np.ndarray) -> tuple[float, float] | None:
    """Slope and its standard error of y against x; None where x hardly varies."""
    weights = std**-2.0
    x, y = x - np.average(x, weights=weights), y - np.average(y, weights=weights)
    spread = float(weights @ x**2)
    if not np.sqrt(spread / weights.sum()) > 1e-3:  # [kg] all logs hold the same
        return None
    slope = float(weights @ (x * y)) / spread
    left = float(weights @ (y - slope * x) ** 2) / (len(x) - 2)
    return slope, float(np.sqrt(max(left, 1e-12) / spread))
