"""What a solution of the MAP problem finds: the scales, and the posterior of the payload and of the arm."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_SURE = 3.0  # ln(20): the odds at which a stream is said to be of another arm, too


@dataclass(frozen=True, eq=False)
class Scales:
    """What expectation–maximisation finds.

    noise: S of each run (K, n) [N²·m²·s]. eta: prior variance (p,). features: prior variance of the weights (n, R).
    payloads: prior variance (10,) of the payload, or (20,) of the tares' and of what was added.
    drifts: prior variance (K', d) of each session that drifts.
    """

    noise: NDArray[np.float64]
    eta: NDArray[np.float64]
    features: NDArray[np.float64]
    payloads: NDArray[np.float64]
    drifts: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def shared(self) -> NDArray[np.float64]:
        """Prior variance of z: of payloads, eta and drifts."""
        return np.concatenate([self.payloads, self.eta, self.drifts.ravel()])


@dataclass(frozen=True, eq=False)
class AnotherArm:
    """Whether a run is of another arm than its tare (`posterior.another_arm`).

    log_odds: B, what the run's log evidence gains if the tare is taken for another arm's. surprise: by how many of its
    standard deviations B exceeds its mean, were the arm the same. found: whether it is another. left_out: whether the
    answer it is of then does without what its tare or profile says of the arm.
    """

    log_odds: float
    surprise: float
    found: bool
    left_out: bool = True

    @property
    def sure(self) -> bool:
        """Whether another arm explains the run 20 times as well as the tare's; else it is found by its surprise."""
        return self.log_odds > _SURE


@dataclass(frozen=True, eq=False)
class Drift:
    """By how much an arm differs from what it was at its tare (`posterior.drift`).

    offset, coulomb: (n,) change of the torque offsets and of the Coulomb friction [N·m]. statistic: T.
    joint: the joint whose own T is largest, from 0. changed: whether T is beyond what sound logs show.
    allowed: whether the answer it is of allows for it.
    """

    offset: NDArray[np.float64]
    coulomb: NDArray[np.float64]
    statistic: float
    joint: int
    changed: bool
    allowed: bool = True


@dataclass(frozen=True, eq=False)
class Tilt:
    """By how much gravity is turned from what was given (`posterior.tilt`).

    angles: (2,) about `Arm.horizontal` [rad]. statistic: T. found: whether gravity is turned beyond doubt.
    """

    angles: NDArray[np.float64]
    statistic: float
    found: bool


@dataclass(frozen=True, eq=False)
class Posterior:
    """Mean and covariance of phi, and of what else was found along the way.

    phi, covariance: (10,), (10, 10) of the payload (relative to the tare, if there was one).
    information, vector: Λ (10, 10) and Λ·phi_ML (10,): what the logs alone say, all else integrated out.
    eta, eta_std: (p,) the arm's mismatch, in session 0, and its standard deviation.
    drift, drift_covariance: (d,), (d, d) by which the run's session differs from session 0; (0,) where it does not.
    tilt, tilt_covariance: (2,), (2, 2) angles of gravity about `Arm.horizontal` [rad]; zero where gravity is believed.
    residual: √S (n,) of the run [N·m·√s].
    power: (K, n) mean square of each run's residual [N²·m²].
    torque: "link" or "motor", the side the torque seems to be measured on.
    gears: whether friction of gears is surely in the torque, so that it differs from run to run on a sound arm.
    borne: rms torque (n,) that what was added costs the joints in the run [N·m].
    gain_std: relative standard deviation of the torque's calibration, one for all joints.
    moved: (n, 10, 10) by what a standard deviation of each joint's own scale moves phi (`posterior.joint_gains`); None:
        joints have none.
    scales: what expectation–maximisation found; another solution may start there.
    ratios: the scales (n,) of "noise", "pose", "velocity" and "friction", and the squared offsets ("offset"), over what
        was expected of them, as variances.
    """

    phi: NDArray[np.float64]
    covariance: NDArray[np.float64]
    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    eta: NDArray[np.float64]
    eta_std: NDArray[np.float64]
    drift: NDArray[np.float64]
    drift_covariance: NDArray[np.float64]
    tilt: NDArray[np.float64]
    tilt_covariance: NDArray[np.float64]
    residual: NDArray[np.float64]
    power: NDArray[np.float64]
    torque: str
    gears: bool
    borne: NDArray[np.float64]
    gain_std: float
    moved: NDArray[np.float64] | None
    scales: Scales
    ratios: dict[str, NDArray[np.float64]]
