"""What is added at each of many cuts of a log, of one solution for all of them.

The log is solved as if nothing changed in it, with the scales of the model given. With x = [z, g_1 … g_n] all that is
unknown then, x̂ and C its mean and covariance, the rows after a cut with the residual r − X·x̂ say of what was added

    h = Σ_j ∫ W_jᵀ·(r_j − X_j·x̂)/S_j dt,      Λ = Σ_j ∫ W_jᵀ·W_j/S_j dt − U·C·Uᵀ,      U = Σ_j ∫ W_jᵀ·X_j/S_j dt

the same information as a solution of its own for each cut, whose scales are these (a Gaussian's score and its
information, Bishop 2006, section 2.3): the unknowns are eliminated once for all cuts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior.problem import Problem
from armload.posterior.scales import Scales
from armload.posterior.solve import threads
from armload.regression import JointFeatures
from armload.regression.information import RegressionData
from armload.regression.noise import SMOOTH


def added_at_cuts(
    known: list[RegressionData],
    stretches: Sequence[RegressionData],
    features: JointFeatures,
    prior_std: NDArray[np.float64],
    scales: Scales | None,
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Λ (10, 10) and h (10,) of what is added between one stretch of a log and the next, for each such cut.

    Args:
        known: what is known of the arm, of `features`.
        stretches: of the log, one after another, of these features or more.
        features: of the model.
        prior_std: (10,) of what is held throughout.
        scales: of the known runs, and of the log as one; None: as stated.
    """
    whole = RegressionData.joined(stretches).of_features(features)
    with threads().limit(limits=1):
        problem = Problem([*known, whole], prior_std, None, SMOOTH, same=True)
        scales = problem.scales(scales)
        found = problem.posterior(scales)
        E, S, c = problem.selections[-1], scales.noise[-1], len(problem.selections[-1])
        at = np.concatenate([np.broadcast_to(E @ found.mean, (len(S), c)), found.weights], axis=1)  # (n, size)
        U, b = np.zeros((len(S), 10, at.shape[1])), np.zeros((len(S), 10))
        out = []
        for stretch in reversed(stretches[1:]):
            rows, right = stretch.of_payload(features)
            U, b = U + rows / S[:, None, None], b + right / S[:, None]
            h = b.sum(axis=0) - np.einsum("jpk,jk->p", U, at)
            shared = U[:, :, :c].sum(axis=0) @ E - np.einsum("jpr,jrz->pz", U[:, :, c:], found.slope)
            own = np.einsum("jpr,jrs,jqs->pq", U[:, :, c:], found.rest, U[:, :, c:], optimize=True)
            information = U[:, :, :10].sum(axis=0) - shared @ found.covariance @ shared.T - own
            out.append((0.5 * (information + information.T), h))
    return out[::-1]


def of_the_log(scales: Scales, durations: tuple[float, float]) -> Scales:
    """Scales of two parts of a log, the last two runs, as scales of the log as one."""
    before, after = scales.noise[-2:]
    joined = (durations[0] * before + durations[1] * after) / sum(durations)
    return replace(scales, noise=np.vstack([scales.noise[:-2], joined]))
