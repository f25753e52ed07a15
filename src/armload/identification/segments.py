"""Where the payload changes within a log.

The log is cut in two at several places, and both sides are asked whether they hold the same (`cut_statistics.py`).
The cut with the largest T is sought more finely, and both parts are cut again, unless torques that drift would explain
the log rather, and leave no change beside. What the mass of something light says by itself raises a doubt, but makes no
cut: what an arm does wrong in half a second looks like a weight, too (a real Panda's).

While the arm stands, what it takes up is found by the torque of that pose (`standing_changes.py`); cuts are sought
between those changes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identification.cut_statistics import Cuts, Statistics, TorqueDrift
from armload.identification.standing_changes import changes_at_rest
from armload.identification.thresholds import (
    CUT_FARTHER,
    CUT_SHARE,
    DRIFT_SAID,
    PART_LEAST,
    PAYLOAD_CHANGED,
    PAYLOAD_MAY_CHANGE,
    SETTLED,
)
from armload.posterior import Profile, SmoothPosteriorLeastSquares
from armload.posterior.calibration import KAPPA_UNKNOWN
from armload.posterior.drift import TESTED
from armload.recording import Recording
from armload.regression import JointFeatures
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.regression.rows_of_log import RowsOfLog

_FINER = 4  # cuts on either side of the best one, twice
_NOWHERE_NEAR = 0.5 * PAYLOAD_MAY_CHANGE  # T of the best of few cuts: finer ones seldom double it. A stated bound


class Changes(NamedTuple):
    """times: [s, on the log's clock] at which the payload changes. statistic: the largest T of the whole log.

    of_mass: the largest chi-squared of the mass alone; 0 where not tested. left: as `doubt`, but with noise that is no
    more than its blocks show: below 1 nothing is left to be explained. drift: of the torques, the surest of any part;
    None where there is none. added: of each change the mass that it adds and the standard deviation of that [kg]; None
    for one while the arm stands.
    """

    times: list[float]
    statistic: float
    of_mass: float = 0.0
    left: float = 0.0
    drift: TorqueDrift | None = None
    added: Sequence[tuple[float, float] | None] = ()

    @property
    def doubt(self) -> float:
        """The larger of the two, over what raises a doubt."""
        return Statistics(self.statistic, self.of_mass).doubt

    @property
    def doubted(self) -> bool:
        """Whether the payload may change, by one of the two, or the torques drift."""
        return self.doubt > 1.0 or self.drift is not None


def changes_of_payload(
    recording: Recording,
    arm: Arm,
    tare: Recording | None = None,
    profile: Profile | None = None,
    kappa: float | None = None,
    held: float = 0.0,
    features: JointFeatures | None = None,
) -> Changes:
    """Where the payload changes within a log; no time: it is the same throughout.

    Args:
        tare, profile: what else is known of the arm, where there is one.
        kappa: by how much the physics overrates the evidence of this log, where it does; None: not known. Not believed
            of motor currents: what a change leaves unexplained is read as the arm's own error, and hides the change.
        held: mass of what seems to be held [kg].
        features: of the arm's smooth mismatch, without a profile; None: the usual ones.
    """
    kappa = KAPPA_UNKNOWN if kappa is None or arm.motor_torque else max(kappa, 1.0)
    found = _Search.of(recording, arm, tare, profile, kappa, held, features).all()
    if found.times and not arm.motor_torque and _rubs(recording, found.times, arm):
        motor_side = replace(arm, motor_torque=True)
        found = _Search.of(recording, motor_side, tare, profile, KAPPA_UNKNOWN, held, features).all()
    return found


def _rubs(recording: Recording, times: list[float], arm: Arm) -> bool:
    """Whether the torque holds gear friction nobody told of, which looks like a change, as a change looks like it.

    The longest part in which nothing changes tells.
    """
    edges = [recording.t[0], *times, recording.t[-1]]
    start, end = max(pairwise(edges), key=lambda part: part[1] - part[0])
    physics = SmoothPosteriorLeastSquares(arm)
    physics.run(recording.between(start + SETTLED, end - SETTLED))
    return physics.posterior.gears


def _surest(parts: Iterable[Changes]) -> TorqueDrift | None:
    """The surest drift of some parts of a log."""
    return max((part.drift for part in parts if part.drift), key=lambda drift: drift.odds, default=None)


class _Search:
    """Changes in the rows of a log."""

    def __init__(self, cuts: Cuts) -> None:
        self.cuts, self.rows = cuts, cuts.rows

    @classmethod
    def of(
        cls,
        recording: Recording,
        arm: Arm,
        tare: Recording | None,
        profile: Profile | None,
        kappa: float,
        held: float,
        features: JointFeatures | None,
    ) -> _Search:
        physics = SmoothPosteriorLeastSquares(arm, tare, profile=profile, features=features)
        if profile is None:
            physics.allow_for(TESTED)  # with more, as of an old tare, the same is found
        return cls(Cuts(physics, RowsOfLog(physics.stream.regression(), recording), kappa, held))

    def all(self) -> Changes:
        """Changes of the whole log: while the arm stands, and between those.

        Of what is too near to an end, or to the next change, to be a part of its own, there is but a doubt.
        """
        t, seen = self.rows.t, self.at_rest()
        times = [a for a, b in pairwise([*seen, t[-1]]) if a - t[0] >= PART_LEAST and b - a >= PART_LEAST]
        starts = [0, *np.searchsorted(t, np.array(times) + SETTLED).tolist()]
        stops = [*np.searchsorted(t, np.array(times) - SETTLED).tolist(), len(t)]
        parts = [self.within(start, stop) for start, stop in zip(starts, stops, strict=True)]
        statistic = max(PAYLOAD_CHANGED if seen else 0.0, *(part.statistic for part in parts))
        found = [*zip(times, [None] * len(times), strict=True)]
        found += [both for part in parts for both in zip(part.times, part.added, strict=True)]
        times, added = [*zip(*sorted(found, key=itemgetter(0)), strict=True)] or ((), ())
        of_mass, left = max(part.of_mass for part in parts), max(part.left for part in parts)
        left = max(left, Statistics(statistic, of_mass).doubt)
        return Changes(list(times), statistic, of_mass, left, _surest(parts), added)

    def at_rest(self) -> list[float]:
        """When the payload changes while the arm stands."""
        if self.cuts.physics.arm.motor_torque:
            return []
        rows, correction = self.rows, self.cuts.physics.stream.correction
        return changes_at_rest(rows.t, rows.q, rows.r, correction, lambda: self.cuts.coulomb)

    def within(self, start: int, stop: int) -> Changes:
        """Changes between two rows."""
        t = self.rows.t
        if stop - start < 3 or t[stop - 1] - t[start] < 2.0 * PART_LEAST:
            return Changes([], 0.0)
        candidates = self._candidates(start, stop)
        if not candidates.size:
            return Changes([], 0.0)
        best, most, of_mass, left = self.cuts.likeliest(start, stop, candidates)
        near = most > _NOWHERE_NEAR
        here = None
        if near:
            best = self._finer(start, stop, candidates, best)
            here = self.cuts.at(start, stop, best)
            most = max(most, here.T)
        drift = self.cuts.drift(start, stop, best)
        if most <= PAYLOAD_CHANGED or drift.explains:
            left = max(left, self.cuts.at(start, stop, best, SMOOTH).doubt) if near else left
            said = max(left, drift.odds / DRIFT_SAID) if drift.said else left
            return Changes([], most, of_mass, said, drift if drift.said else None)
        # the rows' lag still holds what was there before, and the cut is off by some rows
        until, after = (int(np.searchsorted(t, t[best] + aside)) for aside in (-SETTLED, SETTLED))
        parts = earlier, later = self.within(start, until), self.within(after, stop)
        times = [*earlier.times, float(t[best]) - 1.0 / GAIN, *later.times]
        assert here is not None  # what is above `PAYLOAD_CHANGED` was looked at more finely
        added = [*earlier.added, (here.added, here.std), *later.added]
        return Changes(times, most, of_mass, left, _surest(parts), added)

    def _finer(self, start: int, stop: int, cuts: NDArray[np.int64], best: int) -> int:
        """The likeliest cut near the best of some."""
        around = np.searchsorted(cuts, best)
        near = cuts[max(around - 1, 0)], cuts[min(around + 1, len(cuts) - 1)]
        for _ in range(2):
            cuts = np.unique(np.linspace(*near, 2 * _FINER + 1).astype(int))
            best = int(cuts[np.argmax(self.cuts.roughly(start, stop, cuts))])
            spacing = max((near[1] - near[0]) // (2 * _FINER), 1)
            near = max(best - spacing, near[0]), min(best + spacing, near[1])
        return best

    def _candidates(self, start: int, stop: int) -> NDArray[np.int64]:
        """Cuts between two rows: the denser the nearer to either end.

        Rows on both sides stand for `SETTLED` at least: one pose of rest counts for a while only.
        """
        t, stood = self.rows.t, np.cumsum(self.rows.h[start:stop])
        length, away = t[stop - 1] - t[start], [PART_LEAST]
        while away[-1] < 0.5 * length:
            away.append(away[-1] + min(CUT_FARTHER * away[-1], CUT_SHARE * length))
        away = np.array(away[:-1] or away)
        cuts = np.unique(np.searchsorted(t, np.r_[t[start] + away, t[stop - 1] - away]))
        cuts = cuts[(cuts > start) & (cuts < stop)]
        before = stood[cuts - start - 1]
        return cuts[(before >= SETTLED) & (stood[-1] - before >= SETTLED)]
