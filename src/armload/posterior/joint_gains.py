"""What a scale of its own of each joint's torque does to the answer, where torque is motor current.

A motor's constant, and what a gear loses of a payload, scale the torque that the payload asks of that joint,

    r_j = (1 + gamma_j)·W_j·phi + Z_j·eta + G_j·g_j + e_j,      gamma_j ~ N(0, s²),      s² = gain² + loss²

independent of each other, beside the one scale of all joints: where joints differ, a moment that two of them tell is
off by more than its own share. To first order phi is off by gamma_j·M_j·phi, where M_j is how far phi follows the
payload's torque in the rows of joint j. With P the posterior covariance, U_j = ∫ W_jᵀ·X_j dt / S_j by its columns of
[payload, eta] and of g_j, and E, slope_j of the solution,

    M_j = P_phi,z·(Eᵀ·U_jᵀ − slope_jᵀ·U_jᵀ),      Σ_j M_j = 1 where the log determines phi

and its covariance grows by Σ_j s²·(M_j·phi)·(M_j·phi)ᵀ. A known weight (`torque_gain`) tells the gain; what gears lose
changes with the direction of motion, and stays.

Source: Bittencourt & Gunnarsson, ASME J. Dyn. Sys. Meas. Control 134, 2012 (friction grows with the load).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.regression.information import RegressionData

# [1] of the torque that a payload asks of a joint, 1 sigma, what its gear loses beyond the model of that (`load` of
# `regression.mismatch`): as half-widths of UR10e payloads grew with their mass (`excitation.promise`). Without scales
# of their own 84 % of a UR10e's first moments with a tare along the same motion lay inside, with them 94 %
# (`benchmarks/wrong_logs.py --robot ur10e`)
LOAD_LOSS = 0.017


def scale_of_joints(gain: float) -> float:
    """s: the standard deviation of each joint's own scale, of that of its motor's constant."""
    return float(np.hypot(gain, LOAD_LOSS))


def moved_by_joint(
    run: RegressionData,
    E: NDArray[np.float64],
    noise: NDArray[np.float64],
    covariance: NDArray[np.float64],
    slope: NDArray[np.float64],
    std: float,
) -> NDArray[np.float64]:
    """s·M_j (n, 10, 10): by what a standard deviation of joint j's scale moves phi, as a matrix on phi.

    Args:
        run: the rows of the payload. E: (c, z), [payload, eta] = E·z. noise: (n,) of the run.
        covariance: (10, z) of phi with z. slope: (n, R, z) of g_j on z. std: s.
    """
    c, out = len(E), np.empty((run.correction.arm.n, 10, 10))
    for j, s in enumerate(noise):
        U = run.A[j, :10] / s
        out[j] = std * covariance @ (E.T @ U[:, :c].T - slope[j].T @ U[:, c:].T)
    return out


def spread(moved: NDArray[np.float64] | None, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ_j s²·(M_j·phi)·(M_j·phi)ᵀ (10, 10), of s·M_j (n, 10, 10); zeros where joints have no scale of their own."""
    if moved is None:
        return np.zeros((len(phi), len(phi)))
    by = moved @ phi
    return by.T @ by
