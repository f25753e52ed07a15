"""How long a sample was on its way to this machine, beyond the shortest way there was lately.

Nobody knows the robot's clock, but arrival − t has a floor: the shortest way plus what the clocks differ by. What a
sample is above the floor of the last minute it has waited, in a network or in a reader that got no processor. That
holds of clocks that run as fast as this machine's (`Source.paced`): simulated time that runs slower would look later
and later.
"""

from __future__ import annotations

import math

_WINDOW = 30.0  # [s] of each of two windows: clocks that drift by 100 ppm differ by 6 ms after two of them
_SET = 1.0  # [s] a time so far back is a clock that was set (as in `online.gate`)


class Transit:
    """The floor of arrival − t over the last half minute to minute, and what each sample is above it.

    >>> transit = Transit()
    >>> [round(transit.late(t, arrived), 3) for t, arrived in ((0.0, 9.0), (0.1, 9.1), (0.2, 9.7), (0.3, 9.7))]
    [0.0, 0.0, 0.5, 0.4]
    """

    def __init__(self) -> None:
        self._floor = self._before = math.inf
        self._began = self._newest = -math.inf
        self._behind = math.inf  # time of the sample before, if it was older than the newest

    def late(self, t: float, arrived: float) -> float:
        """How late a sample arrived [s]; t: its own time, arrived: on this machine's monotonic clock [s]."""
        if not math.isfinite(t):
            return 0.0
        older = t < self._newest
        if t < self._newest - _SET or (older and t > self._behind):  # two running: a clock that was set, as in a record
            self.__init__()
        self._behind = t if older else math.inf
        self._newest = max(self._newest, t)
        if arrived - self._began > _WINDOW:
            self._before, self._floor, self._began = self._floor, math.inf, arrived
        self._floor = min(self._floor, arrived - t)
        return arrived - t - min(self._floor, self._before)
