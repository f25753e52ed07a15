"""What the physics makes of a log so far, in the form the learned parts take: information, and traits of the log.

Traits are dimensionless and the same for every arm, so that what was learned of one says something of another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identifier import Estimate
from armload.least_squares import (
    DifferenceLeastSquares,
    JointFeatures,
    SmoothPosteriorLeastSquares,
    payload_prior_std,
)
from armload.least_squares.posterior import Posterior
from armload.recording import Recording

TRAITS = (
    "log10 time",
    "tare",
    "log10 tare time",
    "motor side",
    *(f"{what} of log10 {of}" for of in ("noise", "pose", "velocity", "friction") for what in ("mean", "largest")),
    "rms speed",
    *(f"log10 information {name}" for name in ("mass", "moment", "inertia")),
    "log10 volume",
    "same motion",
)
KINDS = ("no tare", "tare", "tare along the same motion")
_SHOWN = 0.5  # share of the run that a tare along the same motion has to show


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the logs alone say of a payload, all that is unknown about the arm integrated out.

    information, vector: Λ (10, 10) and Λ·phi_ML (10,).
    gain_std: relative standard deviation of the torque's calibration.
    traits: (T,), named by `TRAITS`.
    t: seconds since the run began.
    kind: index into `KINDS`, what there was to compare with.
    """

    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    gain_std: float
    traits: NDArray[np.float64]
    t: float
    kind: int

    @property
    def mirrored(self) -> Evidence:
        """The same of −phi."""
        return replace(self, vector=-self.vector)

    @classmethod
    def of(
        cls,
        posterior: Posterior,
        arm: Arm,
        t: float,
        tare_time: float,
        speed: float,
        difference: Estimate | None = None,
    ) -> Evidence:
        """From a solution of the physics.

        Args:
            posterior: of `SmoothPosteriorLeastSquares`.
            arm: the arm, for the units in which information is measured.
            t: seconds since the run began. tare_time: length of the tare [s], 0 without one.
            speed: rms of the run's joint velocities so far [rad/s].
            difference: what the torque difference with a tare along the same motion says; it is taken instead.
        """
        std = payload_prior_std(arm)
        Λ, vector = 0.5 * (posterior.information + posterior.information.T), posterior.vector
        if difference is not None:
            Λ = np.linalg.inv(difference.covariance)
            Λ = 0.5 * (Λ + Λ.T)
            vector = Λ @ difference.phi
        unit = std[:, None] * Λ * std
        eigenvalues = np.maximum(np.linalg.eigvalsh(unit), 0.0)
        gains = np.log10(1.0 + np.maximum(np.diag(unit), 0.0))
        ratios = [posterior.ratios[name] for name in ("noise", "pose", "velocity", "friction")]
        parts = [
            np.log10(max(t, 1e-2)),
            float(tare_time > 0),
            np.log10(1.0 + tare_time),
            float(posterior.torque == "motor"),
            *(f(np.log10(np.maximum(r, 1e-6))) for r in ratios for f in (np.mean, np.max)),
            speed,
            gains[0],
            gains[1:4].mean(),
            gains[4:].mean(),
            0.1 * np.log10(1.0 + eigenvalues).sum(),
            float(difference is not None),
        ]
        kind = 2 if difference is not None else int(tare_time > 0)
        return cls(Λ, vector, posterior.gain_std, np.array(parts, dtype=float), float(t), kind)


class Physics(SmoothPosteriorLeastSquares):
    """The physics of the hybrid: MAP least squares with the arm's rigid and smooth mismatch, and its evidence.

    Where a tare turns out to show the run's own motion, the difference of the two logs' torques is the better evidence
    and takes its place (`DifferenceLeastSquares`): whatever the arm does wrong, it does wrong in both.

    Args:
        arm: the bare arm. tare: an earlier log of it, if there is one.
        refresh: solved anew at most this often [s] while streaming.
        features: of the smooth mismatch; a model's error bars were calibrated with the default.
    """

    name = "hybrid physics"

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        refresh: float = 0.1,
        features: JointFeatures | None = None,
    ) -> None:
        self._tare_time = 0.0 if tare is None else tare.duration
        self._difference = None if tare is None else DifferenceLeastSquares(arm, tare)
        super().__init__(arm, tare, refresh=refresh, features=features)

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        super().reset()
        if self._difference is not None:
            self._difference.reset()
        self._began: float | None = None
        self._squares, self._values = 0.0, 0

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        super()._take(t, q, dq, tau)
        if self._difference is not None:
            self._difference._take(t, q, dq, tau)
        if self._began is None:
            self._began = float(t[0])
        self._squares += float(np.sum(dq**2))
        self._values += dq.size

    def evidence(self, t: float) -> Evidence:
        """What the last solution, made at t, says without a prior on the payload."""
        assert self._began is not None
        speed = float(np.sqrt(self._squares / self._values))
        difference = None
        if self._difference is not None and self._difference.seconds >= _SHOWN * (t - self._began) > 0.0:
            difference = self._difference._estimate(t)
            if np.any(np.diag(difference.covariance) > self.posterior.covariance.diagonal()):
                difference = None  # too few rows yet
        return Evidence.of(self.posterior, self.arm, t - self._began, self._tare_time, speed, difference)
