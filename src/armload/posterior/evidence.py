"""What the physics makes of a log so far, in the form the learned parts take: information, and traits of the log.

Traits are dimensionless and the same for every arm, so that what was learned of one says something of another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from armload.inertia.cholesky import factor
from armload.posterior.problem import Posterior

_RATIOS = ("noise", "pose", "velocity", "friction")
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
    ) -> Evidence:
        """Of logs as they stand.

        Args:
            information, vector: Λ (10, 10) and Λ·phi_ML (10,).
            posterior: the solution they rest on, for its scales.
            t: seconds since the run began. tare_time: length of the tare [s], 0 without one.
            speed: rms of the run's joint velocities so far [rad/s].
            weak: (10,) the arm's units of phi, `payload_prior_std`.
            same_motion: whether Λ and h are those of the torque difference with a tare along the same motion.
        """
        Λ = 0.5 * (information + information.T)
        ratios = np.array([posterior.ratios[name] for name in _RATIOS])
        known = np.array([t, tare_time, float(posterior.torque == "motor"), speed, float(same_motion)])
        kind = 2 if same_motion else int(tare_time > 0)
        return cls(Λ, vector, posterior.gain_std, _traits(Λ, weak, ratios, known), float(t), kind)


@njit(cache=True, nogil=True)
def _traits(information, weak, ratios, known):  # pragma: no cover - compiled
    """`TRAITS`; known: time, tare's time, motor side, speed, same motion."""
    out, A = np.empty(18), np.empty((10, 10))
    out[0], out[1], out[2], out[3] = np.log10(max(known[0], 1e-2)), 1.0, np.log10(1.0 + known[1]), known[2]
    if known[1] <= 0.0:
        out[1] = 0.0
    for k in range(4):
        total, largest = 0.0, -np.inf
        for x in ratios[k]:
            log = np.log10(max(x, 1e-6))
            total += log
            largest = max(largest, log)
        out[4 + 2 * k], out[5 + 2 * k] = total / ratios.shape[1], largest
    out[12] = known[3]
    out[13:16] = 0.0
    for i in range(10):
        for j in range(i + 1):
            A[i, j] = weak[i] * information[i, j] * weak[j]
        gain = np.log10(1.0 + max(A[i, i], 0.0))
        if i == 0:
            out[13] = gain
        elif i < 4:
            out[14] += gain / 3.0
        else:
            out[15] += gain / 6.0
        A[i, i] += 1.0
    L = np.empty((10, 10))
    factor(A, L, 1.0)  # an eigenvalue of the information below nothing is rounding
    out[16] = 0.0
    for i in range(10):  # a tenth of log10 det(1 + Λ), in units
        out[16] += 0.2 * np.log10(L[i, i])
    out[17] = known[4]
    return out
