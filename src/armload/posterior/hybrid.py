"""The hybrid as a stream identifier: physics for what is known, learned parts for what is not."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import ModelError
from armload.estimators import Estimate
from armload.inertia import near_consistent, nearest_body
from armload.inertia.cholesky import inverse
from armload.posterior.calibration import Calibration
from armload.posterior.evidence import Evidence, Physics
from armload.posterior.model_file import HybridModel
from armload.posterior.payload_prior import MixturePrior
from armload.recording import Recording
from armload.regression import JointFeatures, payload_prior_std

_REMOVED = 0.1  # how likely it is, beforehand, that something was taken off


class HybridIdentifier(Physics):
    """MAP least squares with the arm's rigid and smooth mismatch, a learned payload prior, learned error bars.

    ±1.96 times an estimate's standard deviation is its 95 % interval, calibrated on simulated episodes: arms that
    differ from their models, payloads of many shapes, motions of many kinds. Estimates are bodies that can exist,
    unless something was taken off since the tare.

    Args:
        arm: the bare arm.
        tare: an earlier log of the same arm, on any motion, with whatever was mounted then.
        model: the learned parts; None: those shipped for the arm.
        refresh: solved anew at most this often [s] while streaming.
        features: as in `Physics`.

    Raises:
        ModelError: no model is shipped for this arm, or it was trained for another one.
    """

    name = "hybrid"

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        model: HybridModel | None = None,
        refresh: float = 0.1,
        features: JointFeatures | None = None,
    ) -> None:
        self.model = shipped_model(arm) if model is None else model
        self._payloads = self.model.prior_for(arm)
        self.calibrated = self.model.calibrated
        self.known = (self._payloads.mean, self._payloads.std)
        super().__init__(arm, tare, refresh, features)

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        super().reset()
        self._phi, self._covariance = self._payloads.mean, np.diag(self._payloads.std**2)
        self._trusted: Evidence | None = None

    def _estimate(self, t: float) -> Estimate:
        super()._estimate(t)
        self._trusted = self.model.calibration.trusted(self.evidence(t))
        tool = self.arm.attached is not None
        self._phi, self._covariance = answer(self._trusted, self.model.calibration, self._payloads, tool)
        return self._last(t)

    @property
    def alone(self) -> NDArray[np.float64]:
        """Standard deviation (10,) of the last estimate under the weak prior of `payload_prior_std` instead."""
        return std_alone(self._trusted, payload_prior_std(self.arm))

    def _last(self, t: float) -> Estimate:
        seen = self._count + len(self._waiting)
        return Estimate(float(t), self._phi.copy(), self._covariance.copy(), seen, str(self.arm.frame))


def answer(
    trusted: Evidence, calibration: Calibration, payloads: MixturePrior, tool: bool, quick: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """phi (10,), a body that can exist or what such a body left behind, and its covariance with calibrated widths.

    `trusted`: evidence as far as it can be trusted (`Calibration.trusted`). `tool`: whether the arm counts with one,
    which may not be there, as something may have been taken off since a tare. `quick`: the body is found in bounded
    time, to a hundredth of a standard deviation.
    """
    vectors = np.array([trusted.vector, -trusted.vector] if trusted.kind > 0 or tool else [trusted.vector])
    found, *removed = payloads.posteriors(trusted.information, vectors)
    sign = 1.0
    if removed and removed[0].log_evidence + np.log(_REMOVED) > found.log_evidence:
        found, sign = removed[0], -1.0
    covariance = calibration.widened(found, trusted)
    if quick:
        return sign * near_consistent(found.mean, inverse(covariance)), covariance
    return sign * nearest_body(found.mean, covariance), covariance


def std_alone(trusted: Evidence | None, weak: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation (10,) under a weak prior of standard deviations `weak`, evidence trusted as far as it is."""
    if trusted is None:
        return weak
    return _std_alone(trusted.information, weak)


@njit(cache=True, nogil=True)
def _std_alone(information, weak):  # pragma: no cover - compiled
    unit, out = np.eye(10), np.empty(10)
    for i in range(10):
        for j in range(10):
            unit[i, j] += weak[i] * information[i, j] * weak[j]
    P = inverse(unit)
    for i in range(10):
        out[i] = weak[i] * np.sqrt(P[i, i])
    return out


def shipped_model(arm: Arm) -> HybridModel:
    """The learned parts that come with armload for an arm.

    Raises:
        ModelError: there are none.
    """
    path = HybridModel.shipped(arm)
    if path is None:
        raise ModelError(f"no hybrid is shipped for {arm.name}: train one with `armload train --method hybrid`")
    return HybridModel.load(path)
