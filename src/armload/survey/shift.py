"""Whether an arm became another one: a lasting shift of its offsets or friction, against how they differ by the day.

Each channel (a joint's offset or friction) has one value a day, the median of the day's rows in which the arm moved
enough to tell (`shows_the_arm`). With s its spread from one day to the next, pooled over all arms (sound arms are most
of a fleet), and n, m days before and after a split,

    z = |mean after − mean before| / (s·√(1/n + 1/m))

is large for an arm that was exchanged, repaired, or walks away from its tare. The split and the channel with the
largest z tell when and where. A tare's own test (`posterior.drift`) must allow for all that its age explains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.identification.tare_age import DAY
from armload.survey.rows import of_joints, shows_the_arm

# days on either side of a split, at least: fewer may be one odd day
FEWEST = 2
# z beyond which an arm is another one. Set on the smallest fleet of `benchmarks/fleet.py`: sound arms reach 6, the
# exchanged one and the one whose offset walks 17. On a fleet that did not set it: twelve sound arms 2.7 to 5.0, a loose
# gripper 7.2, the exchanged arm 16, the walking one 102
SHIFTED = 9.0
_SPREAD = 1.4826 / np.sqrt(2.0)  # standard deviation over the median of |x − y|, of normal x and y


@dataclass(frozen=True)
class Shift:
    """The most likely split of an arm's days.

    z: as above. since: the first day after the split [s since 1970]. joint: from 1. what: "offset" or "friction".
    size: mean after less mean before [N·m].
    """

    z: float
    since: float
    joint: int
    what: str
    size: float

    @property
    def found(self) -> bool:
        """Whether it is beyond what sound arms show."""
        return self.z > SHIFTED


def shifts(rows: Sequence[Mapping[str, Any]], n: int) -> dict[str, Shift]:
    """The most likely shift of each arm that was seen on enough days.

    Rows without a date, or of an arm that hardly moved, say nothing.

    Args:
        rows: answered, of arms with n joints.
    """
    days: dict[str, tuple[NDArray, NDArray]] = {}
    for arm in sorted({row["arm"] for row in rows}):
        days[arm] = _by_day([row for row in rows if row["arm"] == arm], n)
    steps = [np.abs(np.diff(values, axis=0)) for _, values in days.values() if len(values) > 1]
    if not steps:
        return {}
    spread = _SPREAD * np.median(np.concatenate(steps), axis=0)
    found = {arm: _shift(when, values, spread, n) for arm, (when, values) in days.items() if len(when) >= 2 * FEWEST}
    return {arm: shift for arm, shift in found.items() if shift is not None}


def _by_day(rows: Sequence[Mapping[str, Any]], n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """First time of each day (D,) and the medians of its rows (D, 2n)."""
    names = of_joints(n)
    of: dict[int, list[tuple[float, list[float]]]] = {}
    for row in rows:
        if row["date"] is not None and row[names[0]] is not None and shows_the_arm(row):
            of.setdefault(int(row["date"] // DAY), []).append((row["date"], [row[name] for name in names]))
    days = [of[day] for day in sorted(of)]
    when = np.array([min(date for date, _ in day) for day in days])
    return when, np.array([np.median([values for _, values in day], axis=0) for day in days]).reshape(-1, 2 * n)


def _shift(when: NDArray, values: NDArray, spread: NDArray, n: int) -> Shift | None:
    best = None
    for k in range(FEWEST, len(when) - FEWEST + 1):
        size = values[k:].mean(axis=0) - values[:k].mean(axis=0)
        width = np.maximum(spread, 1e-9) * np.sqrt(1.0 / k + 1.0 / (len(when) - k))
        channel = int(np.argmax(np.abs(size) / width))
        z = float(abs(size[channel]) / width[channel])
        if best is None or z > best.z:
            what = "offset" if channel < n else "friction"
            best = Shift(z, float(when[k]), channel % n + 1, what, float(size[channel]))
    return best
