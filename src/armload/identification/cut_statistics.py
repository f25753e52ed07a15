"""What the two sides of a cut of a log say of each other: the likeliest of some cuts, and T there.

With the part before a cut as the tare of the part after it (`posterior.solve`), phi is what was added at the cut, and

    T = phi_MLᵀ·(kappa·Λ⁻¹ + C)⁻¹·phi_ML

is chi-squared of ten where nothing was: Λ, phi_ML what the two parts say of it, all that is unknown about the arm
integrated out, kappa by how much the physics overrates such a log (`posterior.Calibration`), C how much less gears may
lose of what is held in one part than in the other (`LOSS_DIFFERS`), where that is in the torque. A tare or a profile
says what the arm does by itself, so that a lighter change shows; what was mounted then is taken off, and a day's drift
allowed for.

Of something light the mass shows first: with a prior on its moments that lets it lie near the flange, the mass alone is
chi-squared of one, where there is a tare or a profile.

Which cuts come into question is asked of a model with fewer smooth functions, all cuts of one solution (`cut_scan.py`);
T, which decides, is of the whole model at the likeliest of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identification.added_mass import MASS_MAY_CHANGE, of_mass
from armload.identification.cut_scan import Unchanged, log_evidence, of_the_log
from armload.identification.thresholds import DRIFT_SAID, LOSS_DIFFERS, PAYLOAD_MAY_CHANGE, TORQUE_DRIFT
from armload.posterior import SmoothPosteriorLeastSquares
from armload.posterior.problem import Problem
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.regression import JointFeatures, payload_prior_std, solution_prior_std
from armload.regression.information import RegressionData
from armload.regression.noise import SMOOTH, NoiseModel
from armload.regression.prior import BODY_SIZES, body_root, payload_size
from armload.regression.rows_of_log import RowsOfLog

# of joint torque sensors: what is left of vibration looks like a change where it is taken to be less. What motor
# currents leave is friction mostly: with this, two of 24 small changes more were missed, and three of 96 sound logs
# fewer doubted
_NOISE = replace(SMOOTH, white=True)
_ITERATIONS = 3  # of expectation–maximisation: the scales change little after
_FEW = 32  # smooth functions of the pose with which cuts are compared: T at the likeliest is of all of them
_STEPS = 16  # of a ramp, which a drift is
_LIKELIEST = 2  # cuts of which T is found with the whole model


class Statistics(NamedTuple):
    """T of a cut, and chi-squared of the mass alone; 0 where that is not tested.

    added, std: mass that the part after the cut holds beyond the one before, and its standard deviation [kg].
    """

    T: float
    of_mass: float
    added: float = 0.0
    std: float = np.inf

    @property
    def doubt(self) -> float:
        """The larger of the two, over what raises a doubt."""
        return max(self.T / PAYLOAD_MAY_CHANGE, self.of_mass / MASS_MAY_CHANGE)


class Likeliest(NamedTuple):
    """The likeliest of some cuts.

    row: the first one after it. T: its own. of_mass: the largest of any cut. left: the largest doubt, of noise that is
    no more than its blocks show.
    """

    row: int
    T: float
    of_mass: float
    left: float


class TorqueDrift(NamedTuple):
    """Whether the torques drift within a log.

    odds: log odds of a drift against an arm that stays as it is, both as likely beforehand. change: the same of another
    payload from the cut on; both: of a drift and another payload. joint: the one that drifts most, of its effort limit,
    from 1. torque: by how much [N·m].
    """

    odds: float
    change: float
    both: float
    joint: int
    torque: float

    @property
    def explains(self) -> bool:
        """Whether a drift explains the log rather than another payload, and leaves none to be explained.

        A payload that is taken up in several steps is more like a drift than like one step.
        """
        return self.odds > self.change and self.both <= self.odds + DRIFT_SAID

    @property
    def said(self) -> bool:
        """Whether the torques surely drift."""
        return self.explains and self.odds > DRIFT_SAID


class _Model(NamedTuple):
    """What is known of the arm before the log: by a tare or a profile, and the scales that a solution begins with."""

    known: list[RegressionData]
    start: Scales | None

    def of_features(self, features: JointFeatures) -> _Model:
        """The same with the first waves of the pose only."""
        keep, _ = self.known[0].features.first(features) if self.known else (slice(0), None)
        start = self.start and replace(self.start, features=self.start.features[:, keep])
        return _Model([data.of_features(features) for data in self.known], start)


class Cuts:
    """The rows of a log, and what cuts between them say.

    Args:
        physics: of the arm, with its tare or profile. rows: of the log. kappa: as of `changes_of_payload`.
        held: mass of what seems to be held [kg].
    """

    def __init__(self, physics: SmoothPosteriorLeastSquares, rows: RowsOfLog, kappa: float, held: float = 0.0) -> None:
        self.physics, self.rows, self.kappa = physics, rows, kappa
        arm = physics.arm
        self.weak, self.body = solution_prior_std(arm), payload_prior_std(arm)[0] * body_root(payload_size(arm))
        loss = LOSS_DIFFERS * max(held, 0.0) if arm.motor_torque else 0.0  # [kg]
        self.lost = np.diag((loss * self.weak / self.weak[0]) ** 2)
        known = _without_payload(physics.stream.tares, physics.arm, physics.start)
        self.few = replace(physics.features, pose=min(_FEW, physics.features.pose))
        self.whole = _Model(known, physics.start)
        self.rough = self.whole.of_features(self.few)
        self.noise = SMOOTH if physics.arm.motor_torque else _NOISE

    @cached_property
    def coulomb(self) -> NDArray[np.float64]:
        """Coulomb friction of the joints (n,) [N·m], as the log and what else is known show it."""
        data = self._data(slice(0, len(self.rows.t)))
        found = solve([*self.whole.known, data], self.weak, None, self.noise, _ITERATIONS, self.whole.start)
        return np.abs(self.physics.stream.correction.coulomb(found.eta))

    def likeliest(self, start: int, stop: int, cuts: NDArray[np.int64]) -> Likeliest:
        """Of cuts between two rows."""
        stretches = self._stretches(start, stop, cuts)
        roughly = self._roughly(stretches)
        likely = np.unique([*np.argsort(roughly[:, 0])[-_LIKELIEST:], np.argmax(roughly[:, 1])])
        parts = [(stretches[: k + 1], stretches[k + 1 :]) for k in likely]
        found = [self._statistics(*part) for part in parts]
        left = found if self.noise is SMOOTH else [self._statistics(*part, SMOOTH) for part in parts]
        best = int(np.argmax([each.T for each in found]))
        of_mass = max(each.of_mass for each in found)
        return Likeliest(int(cuts[likely[best]]), found[best].T, of_mass, max(each.doubt for each in left))

    def roughly(self, start: int, stop: int, cuts: NDArray[np.int64]) -> NDArray[np.float64]:
        """T (K,) of cuts between two rows, by few smooth functions."""
        return self._roughly(self._stretches(start, stop, cuts))[:, 0]

    def at(self, start: int, stop: int, cut: int, noise: NoiseModel | None = None) -> Statistics:
        """Of one cut between two rows; with `noise` in the place of what is believed."""
        before, after = self._stretches(start, stop, np.array([cut]))
        return self._statistics([before], [after], noise)

    def _roughly(self, stretches: list[RegressionData]) -> NDArray[np.float64]:
        """Both statistics of every cut (K, 2), with fewer smooth functions, and scales of the likeliest cut."""
        cuts = self._unchanged(stretches, self.rough.start).at_cuts()
        best = int(np.argmax([self._tests(*cut).T for cut in cuts])) + 1
        cuts = self._unchanged(stretches, self._scales(stretches, best)).at_cuts()
        return np.array([self._tests(*cut) for cut in cuts])

    def _unchanged(self, stretches: list[RegressionData], scales: Scales | None) -> Unchanged:
        return Unchanged(self.rough.known, stretches, self.few, self.weak, scales)

    def _scales(self, stretches: list[RegressionData], cut: int) -> Scales:
        """Scales of stretches between the cut-th and the one before of which something may be added."""
        parts = [RegressionData.joined(part).of_features(self.few) for part in (stretches[:cut], stretches[cut:])]
        solution = solve([*self.rough.known, *parts], self.weak, None, self.noise, _ITERATIONS, self.rough.start)
        return of_the_log(solution.scales, (parts[0].blocks.duration, parts[1].blocks.duration))

    def drift(self, start: int, stop: int, cut: int) -> TorqueDrift:
        """Of torques that drift between two rows, where the payload would change at a cut."""
        cuts = np.unique([*np.linspace(start, stop, _STEPS + 1)[1:-1].astype(int), cut])
        stretches, at = self._stretches(start, stop, cuts), int(np.searchsorted(cuts, cut)) + 1
        log = self._unchanged(stretches, self._scales(stretches, at))
        t = self.rows.t[[start, *cuts, stop - 1]]
        middle = 0.5 * (t[1:] + t[:-1])
        Λ, h = (x / self.kappa for x in log.cut_and_drift(at, (middle - t[0]) / (t[-1] - t[0]) - 0.5))
        effort = self.physics.stream.correction.effort
        body, drift = np.zeros((len(h), 10)), np.zeros((len(h), len(effort)))
        body[:10], drift[10:] = self.body, np.diag(TORQUE_DRIFT * effort)

        def of_a_body(beside: NDArray[np.float64]) -> float:
            sizes = [log_evidence((Λ, h), np.hstack([size * body, beside])) for size in BODY_SIZES]
            return float(np.logaddexp.reduce(sizes) - np.log(len(sizes)))

        mean = np.linalg.solve(Λ[10:, 10:] + np.diag((TORQUE_DRIFT * effort) ** -2.0), h[10:])
        joint = int(np.argmax(np.abs(mean) / effort))
        odds, change, both = log_evidence((Λ, h), drift), of_a_body(drift[:, :0]), of_a_body(drift)
        return TorqueDrift(odds, change, both, joint + 1, float(mean[joint]))

    def _stretches(self, start: int, stop: int, cuts: np.ndarray) -> list[RegressionData]:
        return [self._data(slice(a, b)) for a, b in pairwise([start, *cuts.tolist(), stop])]

    def _data(self, part: slice) -> RegressionData:
        data = self.physics.empty_data()
        for rows in self.rows.between(part.start, part.stop):
            data.take(rows)
        return data

    def _statistics(
        self, before: list[RegressionData], after: list[RegressionData], noise: NoiseModel | None = None
    ) -> Statistics:
        parts = [RegressionData.joined(before), RegressionData.joined(after)]
        solution = solve(
            [*self.whole.known, *parts], self.weak, None, noise or self.noise, _ITERATIONS, self.whole.start
        )
        return self._tests(solution.information, solution.vector)

    def _tests(self, information: NDArray[np.float64], vector: NDArray[np.float64]) -> Statistics:
        """T, and the statistic of the mass alone, of what a cut's two sides say."""
        P = np.linalg.inv(information + np.diag(self.weak**-2.0))  # there are directions that neither part tells
        added = P @ vector
        covariance = self.kappa * P + self.lost
        T, mass = float(added @ np.linalg.solve(covariance, added)), (float(added[0]), float(np.sqrt(covariance[0, 0])))
        if self.physics.arm.motor_torque or not self.whole.known:
            return Statistics(T, 0.0, *mass)  # friction that grows with the load differs as a weight does
        return Statistics(T, of_mass(information / self.kappa, vector / self.kappa), *mass)


def _without_payload(runs: Sequence[RegressionData], arm: Arm, start: Scales | None) -> list[RegressionData]:
    """What a tare, a profile or both say of the arm, less what they seem to carry, which is then known to be nothing.

    All have the same mounted: what each by itself seems to carry would differ by its own errors.
    """
    if not runs:
        return []
    problem = Problem(list(runs), payload_prior_std(arm), None, SMOOTH, same=True)
    phi = problem.posterior(problem.scales(start)).mean[:10]
    out = []
    for data in runs:
        own = copy(data)
        own.A, own.b, own.c, own.blocks = data.A.copy(), data.b.copy(), data.c.copy(), data.blocks.mapped(np.copy)
        own.less(phi)
        own.A[:, :10], own.A[:, :, :10], own.b[:, :10] = 0.0, 0.0, 0.0
        own.blocks.sums[:, :, :10] = 0.0
        out.append(own)
    return out
