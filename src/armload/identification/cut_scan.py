"""What a log says of more unknowns, of one solution for all of them: what is added at many cuts, a drift of the arm.

The log is solved as if nothing changed in it, with the scales of the model given. With x = [z, g_1 … g_n] all that is
unknown then, x̂ and C its mean and covariance, further unknowns y with rows Y_j are told by the residual r − X·x̂ as

    h = Σ_j ∫ Y_jᵀ·(r_j − X_j·x̂)/S_j dt,      Λ = Σ_j ∫ Y_jᵀ·Y_j/S_j dt − U·C·Uᵀ,      U = Σ_j ∫ Y_jᵀ·X_j/S_j dt

the same information as a solution of its own, whose scales are these (a Gaussian's score and its information, Bishop
2006, section 2.3): the unknowns are eliminated once for all. Of what is added at a cut Y is W after the cut, and 0
before it; of torques that drift it is ramp(t), from −½ at the log's start to ½ at its end, in the place of an offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior.problem import Problem
from armload.posterior.scales import Scales
from armload.regression import JointFeatures
from armload.regression.information import RegressionData
from armload.regression.noise import SMOOTH

Told = tuple[NDArray[np.float64], NDArray[np.float64]]  # Λ and h


class Unchanged:
    """A log solved as if nothing changed in it.

    Args:
        known: what is known of the arm, of `features`.
        stretches: of the log, one after another, of these features or more.
        features: of the model.
        prior_std: (10,) of what is held throughout.
        scales: of the known runs, and of the log as one; None: as stated.
    """

    def __init__(
        self,
        known: list[RegressionData],
        stretches: Sequence[RegressionData],
        features: JointFeatures,
        prior_std: NDArray[np.float64],
        scales: Scales | None,
    ) -> None:
        whole = RegressionData.joined(stretches).of_features(features)
        self._correction = whole.correction
        self._stretches = [stretch.products_of(features) for stretch in stretches]
        problem = Problem([*known, whole], prior_std, None, SMOOTH, same=True)
        scales = problem.scales(scales)
        self._found = problem.posterior(scales)
        self._E, self._S = problem.selections[-1], scales.noise[-1]
        shared = np.broadcast_to(self._E @ self._found.mean, (len(self._S), len(self._E)))
        self._at = np.concatenate([shared, self._found.weights], axis=1)  # x̂ (n, size)

    def at_cuts(self) -> list[Told]:
        """Λ (10, 10) and h (10,) of what is added between one stretch and the next, for each such cut."""
        U, b, out = np.zeros((10, *self._at.shape)), np.zeros((10, len(self._S))), []
        for A, Xr in reversed(self._stretches[1:]):
            U += A[:, :10].swapaxes(0, 1) / self._S[:, None]
            b += Xr[:, :10].T / self._S
            out.append(self._told(U, b, U[:, :, :10].sum(axis=1)))
        return out[::-1]

    def cut_and_drift(self, cut: int, height: NDArray[np.float64]) -> Told:
        """Λ (10 + n, 10 + n) and h (10 + n,): what is added before the cut-th stretch, and each joint's drift [N·m].

        height: of the ramp in each stretch.
        """
        n, correction = len(self._S), self._correction
        joints, offsets = np.arange(n), 10 + correction.offset(np.arange(correction.size)).astype(int)
        drifts, m = 10 + joints, 10 + n
        U, b, squares = np.zeros((m, *self._at.shape)), np.zeros((m, n)), np.zeros((m, m))
        for k, (s, (A, Xr)) in enumerate(zip(height, self._stretches, strict=True)):
            rows = A[joints, offsets] / self._S[:, None]  # ∫ X_j dt of each joint
            U[drifts, joints] += s * rows
            b[drifts, joints] += s * Xr[joints, offsets] / self._S
            squares[drifts, drifts] += s**2 * rows[joints, offsets]
            if k >= cut:
                U[:10] += A[:, :10].swapaxes(0, 1) / self._S[:, None]
                b[:10] += Xr[:, :10].T / self._S
                squares[10:, :10] += s * rows[:, :10]
        squares[:10, :10], squares[:10, 10:] = U[:10, :, :10].sum(axis=1), squares[10:, :10].T
        return self._told(U, b, squares)

    def _told(self, U: NDArray[np.float64], b: NDArray[np.float64], squares: NDArray[np.float64]) -> Told:
        """Of further unknowns (m): ∫ Yᵀ·X/S dt (m, n, size), ∫ Yᵀ·r/S dt (m, n) and ∫ Yᵀ·Y/S dt (m, m)."""
        c, found = len(self._E), self._found
        own = U[:, :, c:]
        shared = U[:, :, :c].sum(axis=1) @ self._E - np.einsum("mjr,jrz->mz", own, found.slope)
        rest = np.einsum("mjr,jrs,kjs->mk", own, found.rest, own, optimize=True)
        information = squares - shared @ found.covariance @ shared.T - rest
        return 0.5 * (information + information.T), b.sum(axis=1) - np.einsum("mjk,jk->m", U, self._at)


def log_evidence(told: Told, root: NDArray[np.float64]) -> float:
    """ln of how much likelier unknowns of covariance R·Rᵀ make a log than none, R being `root`.

    ½·(Rᵀh)ᵀ·(1 + RᵀΛR)⁻¹·Rᵀh − ½·ln|1 + RᵀΛR| (Bishop 2006, section 3.5).
    """
    h, M = root.T @ told[1], np.eye(root.shape[1]) + root.T @ told[0] @ root
    return float(0.5 * h @ np.linalg.solve(M, h) - 0.5 * np.linalg.slogdet(M)[1])


def of_the_log(scales: Scales, durations: tuple[float, float]) -> Scales:
    """Scales of two parts of a log, the last two runs, as scales of the log as one."""
    before, after = scales.noise[-2:]
    joined = (durations[0] * before + durations[1] * after) / sum(durations)
    return replace(scales, noise=np.vstack([scales.noise[:-2], joined]))
