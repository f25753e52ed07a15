"""What the physics makes of a log so far, in the form the learned parts take: information, and traits of the log.

Traits are dimensionless and the same for every arm, so that what was learned of one says something of another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.inertia.cholesky import factor
from armload.posterior.joint_gains import spread
from armload.posterior.scales import Posterior
from armload.runtime.kernels import kernel

_RATIOS = ("noise", "pose", "velocity", "friction")
# What a calibration may know of a log, in this order: `Evidence.traits`.
TRAITS = (
    "log10 time",
    "tare",
    "log10 tare time",
    "motor side",
    *(f"{what} of log10 {of}" for of in _RATIOS for what in ("mean", "largest")),
    "rms speed",
    *(f"log10 information {name}" for name in ("mass", "moment", "inertia")),
    "log10 volume",
    "same motion",
)
KINDS = ("no tare", "tare", "tare along the same motion")


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the logs alone say of a payload, all that is unknown about the arm integrated out.

    information, vector: Λ (10, 10) and Λ·phi_ML (10,).
    gain_std: relative standard deviation of the torque's calibration, one for all joints.
    traits: (T,), named by `TRAITS`.
    t: seconds since the run began.
    kind: index into `KINDS`, what there was to compare with.
    moved: (n, 10, 10) by what a standard deviation of each joint's own scale moves phi (`posterior.joint_gains`); None:
        joints have none.
    """

    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    gain_std: float
    traits: NDArray[np.float64]
    t: float
    kind: int
    moved: NDArray[np.float64] | None = None

    def of_joints(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """By how much the joints' own scales widen the covariance (10, 10) of a mean (10,) under a prior.

        covariance: P of that mean, which follows the torque by P·Λ of what it does without a prior.
        """
        return spread(None if self.moved is None else covariance @ self.information @ self.moved, mean)

    @classmethod
    def of(
        cls,
        information: NDArray[np.float64],
        vector: NDArray[np.float64],
        posterior: Posterior,
        t: float,
        tare_time: float,
        speed: float,
        weak: NDArray[np.float64],
        same_motion: bool = False,
        into_frame: NDArray[np.float64] | None = None,
    ) -> Evidence:
        """Of logs as they stand.

        Args:
            information, vector: Λ (10, 10) and Λ·phi_ML (10,).
            posterior: the solution they rest on, for its scales.
            t: seconds since the run began. tare_time: length of the tare [s], 0 without one.
            speed: rms of the run's joint velocities so far [rad/s].
            weak: (10,) the arm's units of phi, `payload_prior_std`.
            same_motion: whether Λ and h are those of the torque difference with a tare along the same motion.
            into_frame: T (10, 10), phi = T·phi' of the frame that the traits are about; None: they are about phi's own.
        """
        Λ = 0.5 * (information + information.T)
        ratios = np.array([posterior.ratios[name] for name in _RATIOS])
        motor, same = float(posterior.torque == "motor"), float(same_motion)
        information = Λ if into_frame is None else into_frame.T @ Λ @ into_frame
        traits = _traits(information, weak, ratios, float(t), float(tare_time), motor, speed, same)
        kind = 2 if same_motion else int(tare_time > 0)
        return cls(Λ, vector, posterior.gain_std, traits, float(t), kind, posterior.moved)


@kernel
def _traits(information, weak, ratios, time, tare_time, motor, speed, same):  # pragma: no cover - compiled
    """The numbers that `TRAITS` names, in its order."""
    kinds, n = ratios.shape
    traits = np.empty(10 + 2 * kinds)
    traits[0], traits[1] = np.log10(max(time, 1e-2)), 1.0 if tare_time > 0.0 else 0.0
    traits[2], traits[3] = np.log10(1.0 + tare_time), motor
    for k in range(kinds):  # mean and largest of each one's logarithm
        total, largest = 0.0, -np.inf
        for j in range(n):
            one = np.log10(max(ratios[k, j], 1e-6))
            total, largest = total + one, max(largest, one)
        traits[4 + 2 * k], traits[5 + 2 * k] = total / n, largest
    scaled, gains, root = np.empty((10, 10)), np.empty(10), np.empty((10, 10))
    for i in range(10):
        for j in range(i + 1):
            scaled[i, j] = weak[i] * information[i, j] * weak[j]
        gains[i] = np.log10(1.0 + max(scaled[i, i], 0.0))
        scaled[i, i] += 1.0
    factor(scaled, root, 1.0)  # an eigenvalue of the information below nothing is rounding
    volume = 0.0
    for i in range(10):  # a tenth of log10 det(1 + Λ), in units
        volume += 0.2 * np.log10(root[i, i])
    moments, inertia = gains[1] + gains[2] + gains[3], 0.0
    for i in range(4, 10):
        inertia += gains[i]
    last = 4 + 2 * kinds
    traits[last], traits[last + 1], traits[last + 2] = speed, gains[0], moments / 3.0
    traits[last + 3], traits[last + 4], traits[last + 5] = inertia / 6.0, volume, same
    return traits
