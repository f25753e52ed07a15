"""The torque's calibration, joint by joint, from a weight that is known.

A profile knows the empty arm as its sensors show it, whatever their gains. What is added shows them: with a weight of
mass M ± S on the arm, and gains 1 + gamma_j of the joints,

    r_j = (1 + gamma_j)·W_j·phi + Z_j·eta + G_j·g_j + e_j,      phi_1 ~ N(M, S²),  gamma_j ~ N(0, s²)

is linear about the last phi: gamma_j has the column W_j·phi, which the accumulated information holds already. Three
steps settle it. From then on the payload's rows of the arm are (1 + gamma_j)·W_j.

Source: Gautier & Briot, ASME J. Dyn. Sys. Meas. Control 136, 2014 (drive gains from a known payload).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.errors import IdentificationError
from armload.inertia import HELD, Z95
from armload.posterior.elimination import RunInformation, eliminated
from armload.posterior.problem import GAIN_STD, Problem, assumed_gain
from armload.posterior.profile import Profile
from armload.posterior.profile_session import log_data
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import Correction, payload_prior_std, solution_prior_std
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.runtime.one_thread import one_thread

# times what is expected of a sensor of its side (`assumed_gain`) that a joint's gain may be off, 1 sigma: a joint whose
# sensor is far off is what a known weight is hung on for. A stated prior
_WIDE = 6.0
_STEPS = 3
# [assumed scales] of all joints together, beyond which rather the weight is not what was said: 6 % of motor constants.
# A stated prior (test_a_weight_by_which_all_joints_are_off_alike_is_to_be_weighed_again)
_UNLIKELY = 3.0
# of the torque, below which no gain is believed to be known: the weight itself moves a little on its hook. Stated
_LEAST = 1e-3


def with_known_weight(profile: Profile, arm: Arm, log: Recording, mass: float, std: float) -> Profile:
    """The profile with the torque's gains, from a log of a known weight; its own gains, if it has some, are replaced.

    Args:
        profile: of the arm. arm: the bare arm. log: of the weight on any motion.
        mass, std: of the weight, and its standard deviation [kg].

    Raises:
        IdentificationError: a mass that is none, or one that the log does not bear.
        ModelError: the profile is of another arm.
    """
    if not (np.isfinite(mass) and mass > 0.0 and np.isfinite(std) and std >= 0.0):
        raise IdentificationError(
            f"a known weight of {mass:g} ± {std:g} kg: expected a mass above 0, and its deviation"
        )
    profile.check(arm)
    correction = Correction(arm, rated_effort(arm))
    data = log_data(correction, log, profile.features, profile.session(correction))
    runs, wide = [profile.data(correction, GAIN, SMOOTH.block), data], solution_prior_std(arm)
    with one_thread():
        found = solve(runs, wide, None, SMOOTH, 3, profile.scales)
        phi, mass_std = found.phi, float(np.sqrt(found.covariance[0, 0]))
        side = assumed_gain(arm, found.torque)
        seen = data.A[:, :10, :10] / found.scales.noise[-1][:, None, None]
        # independent gains of the joints that bear it: all of them are seldom off by the same
        scale = _WIDE * side * float(np.linalg.norm(_shares(arm, seen, phi)))
        if abs(phi[0] - mass) > HELD * np.hypot(mass_std, scale * abs(phi[0])):
            raise IdentificationError(
                f"{log.source} carries {phi[0]:.4g} ± {Z95 * mass_std:.2g} kg by the profile: expected the weight of "
                f"{mass:.4g} kg that is known; check what was hung on, and what was mounted in the profile's logs"
            )
        problem = Problem(runs, wide, None, SMOOTH)
        gamma, C = np.zeros(arm.n), np.zeros((arm.n, arm.n))  # found in the first step
        for _ in range(_STEPS):
            phi, gamma, C = _solved(problem, found.scales, phi, mass, max(std, 1e-6), _WIDE * side)
    weight = _shares(arm, seen, phi)
    share = float(np.sqrt(SMOOTH.overrated * weight @ C @ weight + (std / mass) ** 2))
    each = np.sqrt(SMOOTH.overrated * np.diag(C) + (std / mass) ** 2)
    each = np.minimum(each, _WIDE * side)  # no more than before the weight was hung on
    return replace(profile, gain=gamma, gain_std=max(share, _LEAST), gain_joint_std=np.maximum(each, _LEAST))


def common_gain(profile: Profile) -> float | None:
    """By how much the torque of all joints is off by a known weight, where that is seldom so of an arm; else None.

    The mean of the joints' gains, each weighed by how well it is known. Rather, the weight was not what was said.
    """
    if profile.gain is None or profile.gain_joint_std is None:
        return None
    weights = profile.gain_joint_std**-2.0
    mean = float(weights @ profile.gain / weights.sum())
    return mean if abs(mean) > _UNLIKELY * GAIN_STD["motor"] else None


def _shares(arm: Arm, seen: NDArray, phi: NDArray) -> NDArray[np.float64]:
    """d ln m / d gamma_j (n,), what each joint's gain does to the mass, 1 in all; seen: (n, 10, 10) over the noise."""
    total = np.linalg.inv(seen.sum(axis=0) + np.diag(payload_prior_std(arm) ** -2.0))
    return (total @ (seen @ phi).T)[0] / phi[0]


def _solved(
    problem: Problem, scales: Scales, phi: NDArray, mass: float, std: float, wide: float
) -> tuple[NDArray, NDArray, NDArray]:
    """phi (10,), gamma (n,) and its covariance (n, n), linear about phi."""
    n, size = problem.correction.arm.n, problem.size
    c, whole = 10 + problem.correction.size, size + n
    runs = []
    for run, E in zip(problem.runs, problem.selections, strict=True):
        T = np.zeros((n, c, whole))  # [payload, eta] of joint j = T_j·[z, gamma]
        T[:, :, :size] = E
        if run is problem.runs[-1]:
            T[range(n), :10, range(size, whole)] = phi
        A, b = np.swapaxes(T, 1, 2) @ run.A[:, :c, :c] @ T, np.einsum("jc,jcz->jz", run.b[:, :c], T)
        runs.append(RunInformation(A, run.A[:, c:, :c] @ T, run.A[:, c:, c:], b, run.b[:, c:]))
    found = eliminated(runs, scales.noise, scales.features)
    A, b = found.A, found.b
    prior = np.concatenate([scales.payloads, scales.eta, scales.drifts.ravel(), np.full(n, wide**2)])
    mean = np.zeros(whole)
    weighed = problem.last.start
    prior[weighed], mean[weighed] = std**2, mass
    root = np.sqrt(prior)
    P = root[:, None] * np.linalg.inv(root[:, None] * A * root + np.eye(whole)) * root
    z = mean + P @ (b - A @ mean)
    # the column of gamma is W·phi: a payload of (1 + gamma)·phi, so that what is found is relative to phi itself
    return z[problem.last], z[size:], P[size:, size:]
