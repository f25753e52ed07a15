"""Where the payload changes within a log.

The log is cut in two at several places. With the part before a cut as the tare of the part after it
(`posterior.solve`), phi is what was added at the cut, and

    T = phi_MLᵀ·(kappa·Λ⁻¹ + C)⁻¹·phi_ML

is chi-squared of ten where nothing was: Λ, phi_ML what the two parts say of it, all that is unknown about the arm
integrated out, kappa by how much the physics overrates such a log (`posterior.Calibration`), C how much less gears may
lose of what is held in one part than in the other (`LOSS_DIFFERS`), where that is in the torque. The cut with the
largest T is sought more finely, and both parts are cut again. A tare or a profile says what the arm does by itself, so
that a lighter change shows; what was mounted then is taken off, and a day's drift allowed for.

Of something light the mass shows first: with a prior on its moments that lets it lie near the flange, the mass alone is
chi-squared of one. Where there is a tare or a profile it raises a doubt, but makes no cut: what an arm does wrong in
half a second looks like a weight, too (a real Panda's).

While the arm stands, what it takes up is found by the torque of that pose (`standing_changes.py`); cuts are sought
between those changes. Which cuts come into question is asked of a model with fewer smooth functions, all cuts of one
solution (`cut_scan.py`); T, which decides, is of the whole model at the likeliest of them.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identification.added_mass import MASS_MAY_CHANGE, of_mass
from armload.identification.cut_scan import added_at_cuts, of_the_log
from armload.identification.standing_changes import changes_at_rest
from armload.identification.thresholds import (
    CUT_FARTHER,
    CUT_SHARE,
    KAPPA_UNKNOWN,
    LOSS_DIFFERS,
    PART_LEAST,
    PAYLOAD_CHANGED,
    PAYLOAD_MAY_CHANGE,
    SETTLED,
)
from armload.posterior import Profile, SmoothPosteriorLeastSquares
from armload.posterior.drift import TESTED
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import JointFeatures, payload_prior_std, solution_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, NoiseModel
from armload.regression.rows_of_log import RowsOfLog

_NOISE = replace(SMOOTH, white=True)  # what is left, and looks like a change where it is taken to be less
_ITERATIONS = 3  # of expectation–maximisation: the scales change little after
_FINER = 4  # cuts on either side of the best one, twice
_FEW = 32  # smooth functions of the pose with which cuts are compared: T at the likeliest is of all of them
_NOWHERE_NEAR = 0.5 * PAYLOAD_MAY_CHANGE  # T of the best of few cuts: finer ones seldom double it. A stated bound
_LIKELIEST = 2  # cuts of which T is found with the whole model


class Changes(NamedTuple):
    """times: [s, on the log's clock] at which the payload changes. statistic: the largest T of the whole log.

    of_mass: the largest chi-squared of the mass alone; 0 where not tested. left: as `doubt`, but with noise that is no
    more than its blocks show: below 1 nothing is left to be explained.
    """

    times: list[float]
    statistic: float
    of_mass: float = 0.0
    left: float = 0.0

    @property
    def doubt(self) -> float:
        """The larger of the two, over what raises a doubt."""
        return _doubt(self.statistic, self.of_mass)

    @property
    def doubted(self) -> bool:
        """Whether the payload may change, by one of the two."""
        return self.doubt > 1.0


def _doubt(statistic: float, of_mass: float) -> float:
    return max(statistic / PAYLOAD_MAY_CHANGE, of_mass / MASS_MAY_CHANGE)


def changes_of_payload(
    recording: Recording,
    arm: Arm,
    tare: Recording | None = None,
    profile: Profile | None = None,
    kappa: float | None = None,
    held: float = 0.0,
) -> Changes:
    """Where the payload changes within a log; no time: it is the same throughout.

    Args:
        tare, profile: what else is known of the arm, where there is one.
        kappa: by how much the physics overrates the evidence of this log, where it does; None: not known. Not believed
            of motor currents: what a change leaves unexplained is read as the arm's own error, and hides the change.
        held: mass of what seems to be held [kg].
    """
    kappa = KAPPA_UNKNOWN if kappa is None or arm.motor_torque else max(kappa, 1.0)
    found = _Search.of(recording, arm, tare, profile, kappa, held).all()
    if found.times and not arm.motor_torque and _rubs(recording, found.times, arm):
        found = _Search.of(recording, replace(arm, motor_torque=True), tare, profile, KAPPA_UNKNOWN, held).all()
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


class _Model(NamedTuple):
    """What is known of the arm before the log: by a tare or a profile, and the scales that a solution begins with."""

    known: list[RegressionData]
    start: Scales | None

    def of_features(self, features: JointFeatures) -> _Model:
        """The same with the first waves of the pose only."""
        keep, _ = self.known[0].features.first(features) if self.known else (slice(0), None)
        start = self.start and replace(self.start, features=self.start.features[:, keep])
        return _Model([data.of_features(features) for data in self.known], start)


class _Search:
    """The rows of a log, and the cuts in them."""

    def __init__(self, physics: SmoothPosteriorLeastSquares, rows: RowsOfLog, kappa: float, held: float = 0.0) -> None:
        self.physics, self.rows, self.kappa = physics, rows, kappa
        self.weak = solution_prior_std(physics.arm)
        loss = LOSS_DIFFERS * max(held, 0.0) if physics.arm.motor_torque else 0.0  # [kg]
        self.lost = np.diag((loss * self.weak / self.weak[0]) ** 2)
        known = [_without_payload(tare, physics.arm, physics.start) for tare in physics.stream.tares]
        self.session = Session(1, TESTED) if physics.profile is None and known else physics.session
        self.few = replace(physics.features, pose=min(_FEW, physics.features.pose))
        self.whole = _Model(known, physics.start)
        self.rough = self.whole.of_features(self.few)

    @classmethod
    def of(
        cls,
        recording: Recording,
        arm: Arm,
        tare: Recording | None,
        profile: Profile | None,
        kappa: float,
        held: float,
    ) -> _Search:
        physics = SmoothPosteriorLeastSquares(arm, tare, profile=profile)
        return cls(physics, RowsOfLog(physics.stream.regression(), recording), kappa, held)

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
        times = sorted([*times, *(time for part in parts for time in part.times)])
        of_mass, left = max(part.of_mass for part in parts), max(part.left for part in parts)
        return Changes(times, statistic, of_mass, max(left, _doubt(statistic, of_mass)))

    def at_rest(self) -> list[float]:
        """When the payload changes while the arm stands."""
        if self.physics.arm.motor_torque:
            return []
        rows, correction = self.rows, self.physics.stream.correction
        return changes_at_rest(rows.t, rows.q, rows.r, correction, lambda: self.coulomb)

    @cached_property
    def coulomb(self) -> NDArray[np.float64]:
        """Coulomb friction of the joints (n,) [N·m], as the log and what else is known show it."""
        data = self._data(slice(0, len(self.rows.t)))
        data.session = self.session
        found = solve([*self.whole.known, data], self.weak, None, _NOISE, _ITERATIONS, self.whole.start)
        return np.abs(self.physics.stream.correction.coulomb(found.eta))

    def within(self, start: int, stop: int) -> Changes:
        """Changes between two rows."""
        t = self.rows.t
        if stop - start < 3 or t[stop - 1] - t[start] < 2.0 * PART_LEAST:
            return Changes([], 0.0)
        cuts = self._candidates(start, stop)
        if not cuts.size:
            return Changes([], 0.0)
        best, most, light, left = self._best(start, stop, cuts)
        if most <= _NOWHERE_NEAR:
            return Changes([], most, light, left)
        around = np.searchsorted(cuts, best)
        near = cuts[max(around - 1, 0)], cuts[min(around + 1, len(cuts) - 1)]
        for _ in range(2):
            cuts = np.unique(np.linspace(*near, 2 * _FINER + 1).astype(int))
            best = int(cuts[np.argmax(self._roughly(self._stretches(start, stop, cuts))[:, 0])])
            spacing = max((near[1] - near[0]) // (2 * _FINER), 1)
            near = max(best - spacing, near[0]), min(best + spacing, near[1])
        parts = self._stretches(start, stop, np.array([best]))
        most = max(most, self._statistic(parts[:1], parts[1:])[0])
        if most <= PAYLOAD_CHANGED:
            return Changes([], most, light, max(left, _doubt(*self._statistic(parts[:1], parts[1:], SMOOTH))))
        # the rows' lag still holds what was there before, and the cut is off by some rows
        until, after = (int(np.searchsorted(t, t[best] + aside)) for aside in (-SETTLED, SETTLED))
        earlier, later = self.within(start, until).times, self.within(after, stop).times
        return Changes([*earlier, float(t[best]) - 1.0 / GAIN, *later], most, light, left)

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

    def _best(self, start: int, stop: int, cuts: np.ndarray) -> tuple[int, float, float, float]:
        """The cut with the largest T, T, the largest of any cut's mass alone, and what is `Changes.left`."""
        stretches = self._stretches(start, stop, cuts)
        roughly = self._roughly(stretches)
        likely = np.unique([*np.argsort(roughly[:, 0])[-_LIKELIEST:], np.argmax(roughly[:, 1])])
        parts = [(stretches[: k + 1], stretches[k + 1 :]) for k in likely]
        found, left = [self._statistic(*part) for part in parts], [self._statistic(*part, SMOOTH) for part in parts]
        best = int(np.argmax([T for T, _ in found]))
        light = max(light for _, light in found)
        return int(cuts[likely[best]]), found[best][0], light, max(_doubt(*both) for both in left)

    def _roughly(self, stretches: list[RegressionData]) -> NDArray[np.float64]:
        """Both statistics of every cut (K, 2), with fewer smooth functions, and scales of the likeliest cut."""
        for stretch in stretches:
            stretch.session = self.session
        cuts = added_at_cuts(self.rough.known, stretches, self.few, self.weak, self.rough.start)
        best = int(np.argmax([self._tests(*cut)[0] for cut in cuts])) + 1
        parts = [RegressionData.joined(part).of_features(self.few) for part in (stretches[:best], stretches[best:])]
        solution = solve([*self.rough.known, *parts], self.weak, None, _NOISE, _ITERATIONS, self.rough.start)
        scales = of_the_log(solution.scales, (parts[0].blocks.duration, parts[1].blocks.duration))
        cuts = added_at_cuts(self.rough.known, stretches, self.few, self.weak, scales)
        return np.array([self._tests(*cut) for cut in cuts])

    def _stretches(self, start: int, stop: int, cuts: np.ndarray) -> list[RegressionData]:
        return [self._data(slice(a, b)) for a, b in pairwise([start, *cuts.tolist(), stop])]

    def _data(self, part: slice) -> RegressionData:
        data = self.physics.empty_data()
        for rows in self.rows.between(part.start, part.stop):
            data.take(rows)
        return data

    def _statistic(
        self, before: list[RegressionData], after: list[RegressionData], noise: NoiseModel = _NOISE
    ) -> tuple[float, float]:
        parts = [RegressionData.joined(before), RegressionData.joined(after)]
        for part in parts:
            part.session = self.session
        solution = solve([*self.whole.known, *parts], self.weak, None, noise, _ITERATIONS, self.whole.start)
        return self._tests(solution.information, solution.vector)

    def _tests(self, information: NDArray[np.float64], vector: NDArray[np.float64]) -> tuple[float, float]:
        """T, and the statistic of the mass alone, of what a cut's two sides say."""
        P = np.linalg.inv(information + np.diag(self.weak**-2.0))  # there are directions that neither part tells
        added = P @ vector
        T = float(added @ np.linalg.solve(self.kappa * P + self.lost, added))
        if self.physics.arm.motor_torque or not self.whole.known:
            return T, 0.0  # friction that grows with the load differs from part to part as a weight does
        return T, of_mass(information / self.kappa, vector / self.kappa)


def _without_payload(data: RegressionData, arm: Arm, start: Scales | None) -> RegressionData:
    """What a tare or a profile says of the arm, less what it seems to carry, which is then known to be nothing."""
    found = solve([data], payload_prior_std(arm), None, SMOOTH, 1, start)
    out = copy(data)
    out.A, out.b, out.c, out.blocks = data.A.copy(), data.b.copy(), data.c.copy(), data.blocks.mapped(np.copy)
    out.less(found.phi)
    out.A[:, :10], out.A[:, :, :10], out.b[:, :10] = 0.0, 0.0, 0.0
    out.blocks.sums[:, :, :10] = 0.0
    return out
