"""Whether a gripper holds loosely: what the last logs of an arm say together, where one log tells too little.

Of each part of a log and each direction across the flange there is c ± s [kg·m], the first moment that slides from stop
to stop (`sliding`). With m what was held, d half of the way, and c_0 what the arm's own mismatch feigns on motions that
are its own,

    c = m·d + c_0 + e        e ~ N(0, kappa·s²)        c_0 ~ N(0, FEIGNED²)

kappa by how much the physics overrates itself (`SMOOTH.overrated`). z = d/std(d) is that of the direction, and of the
last logs from any on, that tell most; d < 0 is no sliding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.regression.noise import SMOOTH
from armload.survey.sliding import WAYS

# [logs] that may tell together, the last ones: a gripper that was mended is sound again after so many. A stated choice
MOST = 40
FEWEST = 5  # logs with something held, at least
FEIGNED = 0.01  # [kg·m] a stated prior: as much as 5 mm of the heaviest that a small arm holds
# z beyond which a gripper is loose. Of twelve directions that overlap, about five tell apart: three standard deviations
# one-sided are exceeded by 0.7 % of sound arms if all that is assumed holds. Of 16 arms of 30 logs (seeds 31–34, some
# exchanged or walking) none reaches 2.6 held firmly, and 9 are beyond with 5 mm either way, 14 with 10 mm
LOOSE = 3.0


class Looseness(NamedTuple):
    """How surely, and how far, what an arm holds slides.

    z: as above. gap, std: d and its standard deviation [m]. angle: of the direction, from the flange's x to its y [°].
    since: date of the first of the logs that tell [s since 1970], its name where it has none.
    """

    z: float
    gap: float
    std: float
    angle: float
    since: float | str

    @property
    def found(self) -> bool:
        """Whether it is beyond what sound arms show."""
        return self.z > LOOSE


def looseness(logs: Sequence[Sequence[dict[str, Any]]]) -> Looseness | None:
    """What an arm's logs, the rows of each, the oldest first, say of its gripper; None: too few could tell."""
    last = [of for of in logs if any(row.get("slide_1") is not None for row in of)][-MOST:]
    sums = np.array([_sums(of) for of in last]).reshape(-1, 5, WAYS)
    held = np.cumsum([any(row["held"] for row in of) for of in last][::-1])[::-1]
    if not len(last) or held[0] < FEWEST:
        return None
    ones, moments, squares, c, mc = np.cumsum(sums[::-1], axis=0)[::-1][held >= FEWEST].swapaxes(0, 1)
    ones = ones + FEIGNED**-2.0
    information = squares - moments**2 / ones
    std = np.maximum(information, 1e-12) ** -0.5
    gap = (mc - moments * c / ones) * std**2
    first, way = np.unravel_index(int(np.argmax(gap / std)), gap.shape)
    row = last[first][0]
    since = row["log"] if row["date"] is None else row["date"]
    z = float(max(gap[first, way] / std[first, way], 0.0))
    return Looseness(z, float(gap[first, way]), float(std[first, way]), 180.0 / WAYS * float(way), since)


def _sums(rows: Sequence[dict[str, Any]]) -> NDArray[np.float64]:
    """Σ w, Σ w·m, Σ w·m², Σ w·c, Σ w·m·c of a log's parts (5, WAYS), w = 1/(kappa·s²)."""
    total = np.zeros((5, WAYS))
    for row in rows:
        if row.get("slide_1") is None:
            continue
        c, s = (np.array([row[f"{name}_{k}"] for k in range(1, WAYS + 1)]) for name in ("slide", "slide_std"))
        w, m = 1.0 / (SMOOTH.overrated * s**2), row["mass"] if row["held"] else 0.0
        total += np.array([w, w * m, w * m**2, w * c, w * m * c])
    return total
