"""The hybrid: physics for what is known, learned parts for what is not, error bars that are checked."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import ModelError
from armload.inertia import Z95, near_consistent, nearest_body
from armload.inertia.cholesky import inverse
from armload.posterior.calibration import Calibration
from armload.posterior.evidence import Evidence
from armload.posterior.known import DENIED, Gaussian, Known
from armload.posterior.map import PosteriorLeastSquares
from armload.posterior.model_file import HybridModel
from armload.posterior.payload_prior import MixturePrior
from armload.posterior.profile import Profile
from armload.recording import Recording
from armload.regression import JointFeatures, solution_prior_std
from armload.regression.noise import SMOOTH
from armload.runtime.kernels import kernel

# how likely it is, beforehand, that something was taken off since the tare: one log in ten. A stated prior; a removal
# of some standard deviations says so by itself (test_what_was_taken_off_since_the_tare_is_negative)
_REMOVED = 0.1
# how likely it is, beforehand, that something was taken off and something else put on: as likely. The difference is no
# body. Sound logs leave it at 0.03 (median), and below 0.5 (`benchmarks/wrong_logs.py`)
_EXCHANGED = 0.1


class HybridIdentifier(PosteriorLeastSquares):
    """MAP least squares with the arm's rigid and smooth mismatch, a learned payload prior, learned error bars.

    ±1.96 times an estimate's standard deviation is its 95 % interval, calibrated on simulated episodes: arms that
    differ from their models, payloads of many shapes, motions of many kinds. Estimates are bodies that can exist,
    unless something was taken off since the tare. Where the tare turns out to show the run's own motion, the difference
    of the two logs' torques is the better evidence and takes the posterior's place.

    Args:
        arm: the bare arm.
        tare: an earlier log of the same arm, on any motion, with whatever was mounted then.
        model: the learned parts; None: those shipped for the arm.
        features: of the smooth mismatch; a model's error bars were calibrated with the default.
        profile: as for `PosteriorLeastSquares`; its features are those of the smooth mismatch.

    Raises:
        ModelError: no model is shipped for this arm, or it was trained for another one.
    """

    name = "hybrid"
    denies_family = False  # whether the last answer's log denies the families that the payload is said to be of
    _of_families: tuple[MixturePrior, MixturePrior] | None = None  # the priors of these, and of the others
    _noise = SMOOTH
    _smooth = True
    _iterations = 5

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        model: HybridModel | None = None,
        features: JointFeatures | None = None,
        profile: Profile | None = None,
    ) -> None:
        self.model = shipped_model(arm) if model is None else model
        self._payloads = self.model.prior_for(arm)
        self._traits_frame = self.model.into_frame(arm)
        # what gears lose of a load no empty log tells, and a profile's many features of the pose take it for the arm's
        self.calibrated = self.model.calibrated and not (profile is not None and arm.motor_torque)
        self.payload_prior = (self._payloads.mean, self._payloads.std)
        super().__init__(arm, tare, features=features, same_motion=True, profile=profile)

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        super().reset()
        self._trusted: Evidence | None = None
        self.exchanged = self.denies_family = False
        self._rest_on(self._said)

    def expect(self, known: Known | None) -> None:
        """Take what is known of the payload into account from now on.

        Raises:
            ModelError: a family that the model does not know.
        """
        families = () if known is None else known.families
        self._of_families = self._payloads.split(*families) if families else None
        self.known = known
        self._rest_on(self._said)

    @property
    def _said(self) -> MixturePrior:
        """The prior of what the payload is said to be."""
        return self._payloads if self._of_families is None else self._of_families[0]

    def _rest_on(self, prior: MixturePrior) -> MixturePrior:
        self.payload_prior = (prior.mean, prior.std)
        return prior

    def prepare(self) -> None:
        """Do now what the first sample would have to wait for, the solver's loading among it."""
        super().prepare()
        near_consistent(-self._weak, np.diag(self._weak**-2.0))

    @property
    def weak_std(self) -> NDArray[np.float64]:
        """Standard deviation (10,) of the last estimate under the weak prior of `payload_prior_std` instead."""
        return self._weak if self._trusted is None else std_under_weak_prior(self._trusted.information, self._weak)

    @property
    def kappa(self) -> float | None:
        """By how much the physics overrates the evidence of the last answer; None before the first sample."""
        return None if self._trusted is None else self.model.calibration.kappa(self._trusted.traits)

    @property
    def unprojected(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """What the log says without the learned prior, as far as it can be trusted; None before the first sample."""
        return None if self._trusted is None else without_learned_prior(self._trusted, solution_prior_std(self.arm))

    def _before(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._said.mean, np.diag(self._said.std**2)

    def _answer(self, elapsed: float, concluded: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        self._trusted = self.model.calibration.trusted(self.evidence(elapsed), self.louder)
        tool = self.arm.attached is not None or self.stream.without_tare
        self.denies_family = self._of_families is not None and denies(self._trusted, *self._of_families)
        payloads = self._rest_on(self._payloads if self.denies_family else self._said)
        alone = None if self.known is None or self.known.body is None else self.unprojected
        about = (payloads, tool, not concluded, self.known, self._payloads, alone)
        found = answer(self._trusted, self.model.calibration, *about)
        self.exchanged, self.log_only, self.taken = found.exchanged, found.log_only, found.taken
        return found.phi, found.covariance


class Answer(NamedTuple):
    """phi (10,), a body that can exist or what such a body left behind, and its covariance with calibrated widths.

    exchanged: whether one body was rather exchanged for another: then phi is the difference of two, and need be no
        body.
    log_only: mean and covariance from the log only, where something else is known, too. taken: whether phi rests on
        that, too.
    """

    phi: NDArray[np.float64]
    covariance: NDArray[np.float64]
    exchanged: bool
    log_only: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    taken: bool = False


def answer(
    trusted: Evidence,
    calibration: Calibration,
    payloads: MixturePrior,
    tool: bool,
    quick: bool = False,
    known: Known | None = None,
    whole: MixturePrior | None = None,
    alone: Gaussian | None = None,
) -> Answer:
    """What evidence and prior say together.

    `trusted`: evidence as far as it can be trusted (`Calibration.trusted`). `tool`: whether the arm counts with one,
    which may not be there, as something may have been taken off since a tare. `quick`: the body is found in bounded
    time, to a hundredth of a standard deviation, and nobody asks about an exchange. `known`: what is known of the
    payload beside the log. `whole`: the prior of all families, where `payloads` is that of some: what was on before may
    be of any. `alone`: what the log says without a learned prior (`without_learned_prior`), where a body is known: that
    is the prior then, and a tray's drawing is not held against what payloads are usually like.
    """
    any_body = whole or payloads
    vectors = np.array([trusted.vector, -trusted.vector] if trusted.kind > 0 or tool else [trusted.vector])
    found, *removed = payloads.posteriors(trusted.information, vectors)
    sign = 1.0
    if removed and removed[0].log_evidence + np.log(_REMOVED) > found.log_evidence:
        found, sign = removed[0], -1.0
    found = calibration.posterior(replace(trusted, vector=sign * trusted.vector), payloads, found)
    differences, exchanged = None if quick or trusted.kind == 0 else any_body.differences, 0.0
    other = None
    if differences is not None:
        other = differences.posterior(trusted.information, sign * trusted.vector)
        fits_better = other.log_evidence > found.log_evidence  # whatever was likely beforehand
        found, exchanged = found.or_else(other, _EXCHANGED)
        other = (other.mean, calibration.widened(other, trusted, any_body)) if fits_better else None
    mean, covariance = found.mean, calibration.widened(found, trusted, any_body)
    if not quick:
        covariance = holding(covariance, 0, found.mass_if_any - found.mean[0])
    log_only = given = None
    if known is not None:
        log_only = alone or (sign * mean, covariance)
        given = known.given(*log_only)
        if given is not None:
            mean, covariance = sign * given[0], given[1]
            both = other and known.given(sign * other[0], other[1])
            other = both and (sign * both[0], both[1])
    extra = log_only, given is not None
    if quick:
        return Answer(sign * near_consistent(mean, inverse(covariance)), covariance, False, *extra)
    if exchanged > 0.5:
        return Answer(sign * mean, covariance, True, *extra)
    body = nearest_body(mean, covariance)
    if exchanged > _EXCHANGED:  # likelier than before the log: it may be no body, and its interval holds what was found
        covariance = covariance + np.outer(mean - body, mean - body)
    if other is not None:
        covariance = holding_both(covariance, other[0] - body, other[1])
    return Answer(sign * body, covariance, False, *extra)


def denies(trusted: Evidence, said: MixturePrior, others: MixturePrior) -> bool:
    """Whether evidence speaks so much more for other families than for those that were said that it denies these."""
    ahead, behind = (prior.posterior(trusted.information, trusted.vector).log_evidence for prior in (said, others))
    return ahead - behind < DENIED


def holding(covariance: NDArray[np.float64], i: int, aside: float) -> NDArray[np.float64]:
    """A covariance (10, 10) with the 95 % interval of parameter i wider by |aside| on either side.

    A prior that expects nothing in one log of ten decides of something light: where its mass would be `aside` if there
    were something, the interval holds both (`benchmarks/payload_intervals.py`).
    """
    half = Z95 * float(np.sqrt(covariance[i, i]))
    by = np.ones(len(covariance))
    by[i] = 1.0 + abs(aside) / half
    return covariance * np.outer(by, by)


def holding_both(
    covariance: NDArray[np.float64], aside: NDArray[np.float64], other: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A covariance (10, 10) whose 95 % intervals hold those of another answer, too, `aside` (10,) of this one.

    other: the covariance (10, 10) of that answer. Each interval reaches |aside| + 1.96 of its standard deviations at
    least; the correlations stay.
    """
    own, reach = np.sqrt(np.diag(covariance)), np.abs(aside) / Z95 + np.sqrt(np.diag(other))
    by = np.maximum(reach / own, 1.0)
    return covariance * np.outer(by, by)


def without_learned_prior(
    trusted: Evidence, wide: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (10,) and covariance (10, 10) under a prior N(0, diag(wide²)), what `map-gp` makes of the same evidence.

    P = (Λ + diag(wide)⁻²)⁻¹, m = P·h, covariance P + gain²·m·mᵀ and that of the joints' own scales. A learned prior
    draws the mean to the bodies it knows, so that its mean cannot tell that no body explains the log.
    """
    P = wide[:, None] * np.linalg.inv(np.eye(10) + wide[:, None] * trusted.information * wide) * wide
    mean = P @ trusted.vector
    gains = trusted.gain_std**2 * np.outer(mean, mean) + trusted.of_joints(mean, P)
    return mean, 0.5 * (P + P.T) + gains


@kernel
def std_under_weak_prior(information, weak):  # pragma: no cover - compiled
    """Standard deviation (10,) under a weak prior of standard deviations `weak`, evidence trusted as far as it is."""
    unit, out = np.empty((10, 10)), np.empty(10)
    for i in range(10):
        for j in range(10):
            unit[i, j] = weak[i] * information[i, j] * weak[j]
        unit[i, i] += 1.0
    P = inverse(unit)
    for i in range(10):
        out[i] = weak[i] * np.sqrt(P[i, i])
    return out


@cache
def _loaded(path: Path, _: int) -> HybridModel:
    """A model that is read once, until its file changes."""
    return HybridModel.load(path)


def shipped_model(arm: Arm) -> HybridModel:
    """The learned parts that come with armload for an arm.

    Raises:
        ModelError: there are none, or their file is missing or cannot be read.
    """
    path = HybridModel.shipped(arm)
    if path is None:
        raise ModelError(f"no hybrid is shipped for {arm.name}: train one with `armload train --method hybrid`")
    try:
        return _loaded(path, path.stat().st_mtime_ns)
    except (ModelError, OSError):
        state = "cannot be read" if path.exists() else "is missing"
        raise ModelError(
            f"the hybrid model of {arm.known_as} is part of armload, and its file {path} {state}: install armload "
            "again, or name another method (--method map-gp)"
        ) from None
