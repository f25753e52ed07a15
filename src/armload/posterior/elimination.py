"""Each joint's own unknowns eliminated from the normal equations: what is left is about the unknowns all joints share.

z is shared by the joints, g_j occurs in the rows of joint j only. With g_j ~ N(0, P_j) and the information of the runs,

    [ A    A_zg ]         [ b   ]
    [ A_gz A_gg ]_j   ,   [ b_g ]_j ,        V_j = (A_gg + P_j⁻¹)⁻¹

it follows that

    g_j | z ~ N(V_j·b_g − V_j·A_gz·z, V_j),      A ← A − Σ_j A_zg·V_j·A_gz,      b ← b − Σ_j A_zg·V_j·b_g

Source: Bishop 2006, section 2.3 (marginal and conditional Gaussians in information form).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.regression.information import RegressionData, columns_of

_DIRECT = 20  # half the rows of a matrix that is inverted whole; changes no answer


class RunInformation(NamedTuple):
    """What a run says of z and of each joint's g_j, not yet divided by its noise: ∫ XᵀX dt and ∫ Xᵀr dt by parts.

    A: (n, z, z). A_gz: (n, R, z). A_gg: (n, R, R). b: (n, z), b_g: (n, R), or with one more axis (…, K) for K
    right-hand sides at once.
    """

    A: NDArray[np.float64]
    A_gz: NDArray[np.float64]
    A_gg: NDArray[np.float64]
    b: NDArray[np.float64]
    b_g: NDArray[np.float64]

    @classmethod
    def of(cls, run: RegressionData, E: NDArray[np.float64]) -> RunInformation:
        """Of a run's rows, whose payload and eta are E·z, E (10 + p, z)."""
        c = len(E)
        A, b = run.selected(E)
        return cls(A, columns_of(run.A[:, c:, :c], E), run.A[:, c:, c:], b, run.b[:, c:])


class Eliminated(NamedTuple):
    """Information about z alone: A (z, z), b (z,). g_j | z ~ N(own_j − slope_j·z, rest_j).

    own: (n, R). slope: (n, R, z). rest: (n, R, R). b and own have one more axis where the right-hand sides have.
    """

    A: NDArray[np.float64]
    b: NDArray[np.float64]
    own: NDArray[np.float64]
    slope: NDArray[np.float64]
    rest: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointGaussian:
    """What the runs say of all unknowns: z ~ N(mean, covariance), g_j | z ~ N(own_j − slope_j·z, rest_j)."""

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    own: NDArray[np.float64]  # (n, R)
    slope: NDArray[np.float64]  # (n, R, z)
    rest: NDArray[np.float64]  # (n, R, R)

    @property
    def weights(self) -> NDArray[np.float64]:
        """Mean of g (n, R)."""
        return self.own - self.slope @ self.mean

    def covariance_of(self, E: NDArray, j: int, X: NDArray) -> NDArray[np.float64]:
        """Covariance (B, B) of the rows of X·[E·z, g_j], X (B, ·)."""
        shared, own = X[:, : len(E)] @ E - X[:, len(E) :] @ self.slope[j], X[:, len(E) :]
        return shared @ self.covariance @ shared.T + own @ self.rest[j] @ own.T

    def squares(self, runs: Sequence[RunInformation]) -> NDArray[np.float64]:
        """∫ (X_j·[E·z, g_j] − its mean)² dt (K, n) expected of each run: what a fit leaves is smaller by this much."""
        out = np.zeros((len(runs), len(self.rest)))
        for j, slope in enumerate(self.slope):
            cross = slope @ self.covariance
            own = cross @ slope.T + self.rest[j]
            for k, run in enumerate(runs):
                shared = np.sum(run.A[j] * self.covariance) - 2.0 * np.sum(run.A_gz[j] * cross)
                out[k, j] = shared + np.sum(run.A_gg[j] * own)
        return out

    def spread(self, E: NDArray, j: int, X: NDArray) -> NDArray[np.float64]:
        """Variance (B,) of X·[E·z, g_j], X (B, ·)."""
        shared, own = X[:, : len(E)] @ E - X[:, len(E) :] @ self.slope[j], X[:, len(E) :]
        return ((shared @ self.covariance) * shared).sum(axis=1) + ((own @ self.rest[j]) * own).sum(axis=1)


def eliminated(runs: Sequence[RunInformation], noise: NDArray[np.float64], variance: NDArray[np.float64]) -> Eliminated:
    """The runs' information about z, each g_j integrated out.

    Args:
        noise: long-run variance (K, n) of each run's residual. variance: (n, R), the diagonal of each P_j.
    """
    A, b = np.zeros(runs[0].A.shape[1:]), np.zeros(runs[0].b.shape[1:])
    for run, s in zip(runs, noise, strict=True):
        A += np.tensordot(1.0 / s, run.A, 1)
        b += np.tensordot(1.0 / s, run.b, 1)
    n, R = variance.shape
    own, slope, rest = np.zeros((n, R, *b.shape[1:])), np.zeros((n, R, len(A))), np.zeros((n, R, R))
    for j in range(n if R else 0):
        A_gg = sum(run.A_gg[j] / s[j] for run, s in zip(runs, noise, strict=True))
        A_gz = sum(run.A_gz[j] / s[j] for run, s in zip(runs, noise, strict=True))
        b_g = sum(run.b_g[j] / s[j] for run, s in zip(runs, noise, strict=True))
        root = np.sqrt(variance[j])
        rest[j] = root[:, None] * inverse(root[:, None] * A_gg * root + np.eye(R)) * root
        own[j], slope[j] = rest[j] @ b_g, rest[j] @ A_gz
        A, b = A - A_gz.T @ slope[j], b - A_gz.T @ own[j]
    return Eliminated(0.5 * (A + A.T), b, own, slope, rest)


def inverse(A: NDArray[np.float64]) -> NDArray[np.float64]:
    """A⁻¹ of a positive definite A = [[P, Q], [Qᵀ, S]], by the Schur complement C = S − Qᵀ·P⁻¹·Q.

        A⁻¹ = [[P⁻¹ + X·C⁻¹·Xᵀ, −X·C⁻¹], [−C⁻¹·Xᵀ, C⁻¹]],    X = P⁻¹·Q

    It is symmetric, and most of the work are products: two thirds of what `numpy.linalg.inv` needs of A.

    Raises:
        LinAlgError: A is not positive definite.
    """
    half = len(A) // 2
    if half < _DIRECT:
        out = np.linalg.inv(A)
        if not (np.diag(out) > 0.0).all():
            raise np.linalg.LinAlgError("not positive definite")
        return 0.5 * (out + out.T)
    P = inverse(A[:half, :half])
    X = P @ A[:half, half:]
    out = np.empty_like(A)
    out[half:, half:] = C = inverse(A[half:, half:] - A[half:, :half] @ X)
    out[:half, half:] = -X @ C
    out[half:, :half] = out[:half, half:].T
    whole = P - out[:half, half:] @ X.T
    out[:half, :half] = 0.5 * (whole + whole.T)
    return out
