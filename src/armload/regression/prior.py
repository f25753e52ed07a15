"""What is known about a payload before the first sample: a Gaussian over the ten parameters, phi ~ N(mean, covariance).

Whoever trains on a family of payloads puts such knowledge into the model. Least squares may be given the same, and only
then does a comparison of the two say something about the methods.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm, rated_mass
from armload.errors import IdentificationError
from armload.inertia import InertialParameters

_SHRINK = 0.05  # share of the diagonal in the covariance: few payloads say little about correlations. A stated prior
_FLOOR = np.array([5e-3] + [5e-4] * 3 + [5e-5] * 6)  # [kg, kg·m, kg·m²] no family is known better than this
# standard deviations of the weak prior, of what the arm is rated for and [m] from the flange: a rated payload at the
# length of a gripper and a box. Stated priors
LOAD, REACH = 0.5, 0.15
# [kg] that an arm is rated for, above which what it holds is larger than that: bodies of one form and density grow by
# the cube root of their mass. The most of the built-in arms, for which `REACH` stands; of 250 kg it makes 35 cm. With
# 15 cm, Iyy and Izz of 40 payloads of 150 to 500 kg, half a metre away, were inside in 60 %, now in all
# (test_what_a_heavy_arm_does_not_determine_lies_within_what_was_known_before)
_LARGER_FROM = 20.0
# times that, with which solutions are computed: a parameter that counts as determined (`inertia.SHRINK`) is then
# drawn by 1 / (3 · 4)² of its value at most, 0.7 %
_WIDE = 4.0
# [payloads] sizes of another body, in half of what the arm is rated for: 75 g to 2 kg of a Panda. With 0.3 kg as the
# smallest, intervals after 30 to 200 g left the mass out (seeds 95000 to 95005), and with 1.25 kg those of a UR10e half
# a kilogram (test_half_a_kilogram_more_on_a_real_arm_is_never_denied)
BODY_SIZES = np.array([0.05, 0.2, 0.53, 1.33])
# [m] standard deviation of a body's centre of mass along each axis: √3 times that is the weak prior's reach, twice that
# of the simulated families (0.075 m rms)
BODY_COM = 0.085
# [m] a body's radius of gyration: the simulated families' median is 0.057 m
BODY_GYRATION = 0.06


def payload_size(arm: Arm) -> float:
    """Times that what an arm holds is larger than what the built-in arms do [1]: 1 up to 20 kg that it is rated for."""
    return max(1.0, float(np.cbrt(rated_mass(arm) / _LARGER_FROM)))


def payload_prior_std(arm: Arm) -> NDArray[np.float64]:
    """Standard deviation (10,) of the weak payload prior: half of `rated_mass`, 15 cm times `payload_size` away."""
    return within_reach(LOAD * rated_mass(arm), payload_size(arm))


def within_reach(mass: float, size: float = 1.0) -> NDArray[np.float64]:
    """phi (10,) [kg, kg·m, kg·m²] of a mass [kg] as a scale: its moments are those of a point at `REACH` times size."""
    reach = size * REACH
    return mass * np.array([1.0] + [reach] * 3 + [reach**2] * 6)


def solution_prior_std(arm: Arm) -> NDArray[np.float64]:
    """Standard deviation (10,) of the prior that solutions are computed with: it must not pull a determined payload.

    Four times that of `payload_prior_std`, which is the one that what a log cannot tell is reported with.
    """
    return _WIDE * payload_prior_std(arm)


def body_root(size: float = 1.0) -> NDArray[np.float64]:
    """R (10, 10) with R·Rᵀ = E[phi·phiᵀ] of a body of 1 kg somewhere about the flange, turned any way.

    size: times that it is larger than what the built-in arms hold (`payload_size`).
    """
    c, k = (size * BODY_COM) ** 2, size**2 * (2.0 * BODY_COM**2 + BODY_GYRATION**2)
    mean = np.array([1.0, 0.0, 0.0, 0.0, k, 0.0, 0.0, k, 0.0, k])
    P = np.outer(mean, mean) + np.diag([0.0, c, c, c, *(c * c * np.array([4.0, 1.0, 1.0, 4.0, 1.0, 4.0]))])
    moments = [4, 7, 9]
    P[np.ix_(moments, moments)] += 2.0 * c * c * (1.0 - np.eye(3))
    return np.linalg.cholesky(P)


@dataclass(frozen=True, eq=False)
class GaussianPrior:
    """phi ~ N(mean, covariance), about the payload frame.

    >>> prior = GaussianPrior.of([InertialParameters([m] + [0.0] * 9) for m in (1.0, 2.0, 3.0)])
    >>> float(prior.mean[0]), round(float(prior.std[0]), 3)
    (2.0, 1.0)

    Args:
        mean: (10,).
        covariance: (10, 10), positive definite.
        source: where the knowledge comes from, for tables.

    Raises:
        IdentificationError: wrong shapes, or a covariance that is not symmetric and positive definite.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    source: str = "given"

    def __post_init__(self) -> None:
        for name, shape in (("mean", (10,)), ("covariance", (10, 10))):
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise IdentificationError(f"the prior's {name} has shape {value.shape}: expected finite {shape}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        scale = np.sqrt(np.maximum(np.diag(self.covariance), np.finfo(float).tiny))
        unit = self.covariance / np.outer(scale, scale)
        if not np.allclose(unit, unit.T, rtol=0.0, atol=1e-6):
            raise IdentificationError("the prior's covariance is not symmetric: expected the same number either way")
        if np.linalg.eigvalsh(unit)[0] <= 1e-12:
            raise IdentificationError("the prior's covariance is singular: expected one that is positive definite")

    @classmethod
    def of(cls, payloads: Iterable[InertialParameters] | ArrayLike, source: str | None = None) -> GaussianPrior:
        """Mean and covariance of a family of payloads, one each (phi rows (K, 10) or `InertialParameters`).

        The sample covariance S is shrunk to 0.95·S + 0.05·diag(S) and widened by a few grams, so that a direction in
        which the family does not vary is known well, but not perfectly. Source of the shrinkage: Ledoit & Wolf 2004.
        """
        rows = [p.phi if isinstance(p, InertialParameters) else p for p in payloads]  # type: ignore[union-attr]
        phi = np.asarray(rows, dtype=float)
        if phi.ndim != 2 or phi.shape[1] != 10 or len(phi) < 2:
            raise IdentificationError(f"a prior needs at least 2 payloads of 10 numbers: found shape {phi.shape}")
        S = np.cov(phi.T)
        S = (1.0 - _SHRINK) * S + _SHRINK * np.diag(np.diag(S)) + np.diag(_FLOOR**2)
        return cls(phi.mean(axis=0), S, source or f"{len(phi)} training payloads")

    @classmethod
    def weak(cls, arm: Arm) -> GaussianPrior:
        """What is known where nothing was trained: no payload, within half the rated one (`payload_prior_std`)."""
        return cls(np.zeros(10), np.diag(payload_prior_std(arm) ** 2), "no training payloads, only the rated payload")

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviation of each parameter (10,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def root(self) -> NDArray[np.float64]:
        """L (10, 10) with L·Lᵀ = covariance."""
        scale = self.std  # the units differ by orders of magnitude
        return scale[:, None] * np.linalg.cholesky(self.covariance / np.outer(scale, scale))
