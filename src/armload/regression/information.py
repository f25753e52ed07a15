"""What a recording says about the payload and the arm's mismatch together, accumulated in constant memory.

    r = W·phi + Z·eta + G·g + e

The rows are those of `rows.FilteredRegression`; eta is shared by the joints, g are each joint's own weights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.regression.block_means import BLOCK, BlockMeans
from armload.regression.features import JointFeatures
from armload.regression.mismatch import Correction
from armload.regression.rows import REGRESSOR_RATE, FilteredRegression, Rows
from armload.runtime.one_thread import one_thread

# [blocks] weight of the prior long-run variance: of so few values a variance is known to 70 % only
_PRIOR_COUNT = 4.0
# [s] beyond which more time counts no more: a mismatch that is a function of the configuration does not average away on
# similar motions (real logs; test_a_mismatch_that_repeats_does_not_average_out_in_the_rigid_model)
NOVELTY = 10.0


@dataclass(frozen=True)
class Session:
    """Between two switchings-on of an arm: its offsets and friction are the same throughout.

    number: sessions of the same number are one. drift: by how many daily deviations (`Correction.daily_std`) it differs
    from session 0, 1 sigma; 0: not at all. relative: factors on those deviations, one for each unknown that drifts,
    where an arm's own are known; empty: they are 1.
    """

    number: int = 0
    drift: float = 0.0
    relative: tuple[float, ...] = ()

    def variance(self, correction: Correction) -> NDArray[np.float64]:
        """Variance (d,) of what offsets and friction differ by from session 0."""
        return (self.drift * correction.daily_std * (self.relative or 1.0)) ** 2


SAME = Session()


def columns_of(A: NDArray[np.float64], E: NDArray[np.float64]) -> NDArray[np.float64]:
    """A·E (n, ·, z), where each column of E has a single 1, or none: no product is needed, and the sums are exact."""
    return np.ascontiguousarray(A[..., E.argmax(axis=0)] * E.max(axis=0))


class RegressionData:
    """What one recording says about x_j = [phi, eta, g_j]: information per joint and block sums.

    Args:
        correction: the unknowns eta of the arm.
        gain: λ of the lag [1/s].
        features: of each joint's nonparametric part; None: there is none.
        block: length of the blocks of the residual's batch means [s].
        session: that the recording is of.

    Attributes:
        noise: long-run variance (n,) of the residual, where it is known; None: the data tell.
        usual: where the data are in units of that noise, for how long [s] the arm was seen, and what the long-run
            variance (n,) [N²·m²·s] of its runs is.
    """

    noise: NDArray[np.float64] | None = None
    usual: tuple[float, NDArray[np.float64]] | None = None

    def __init__(
        self,
        correction: Correction,
        gain: float,
        features: JointFeatures | None = None,
        block: float = BLOCK,
        session: Session = SAME,
    ) -> None:
        self.correction, self.gain, self.session = correction, gain, session
        arm = correction.arm
        self.features = features or JointFeatures(arm.n, 0, 0)
        size = 10 + correction.size + self.features.size
        self.A = np.zeros((arm.n, size, size))  # ∫ X_jᵀ·X_j dt
        self.b = np.zeros((arm.n, size))  # ∫ X_jᵀ·r_j dt
        self.c = np.zeros(arm.n)  # ∫ r_j² dt
        self.blocks = BlockMeans((arm.n, size + 1), block)  # of √w·[X, r]
        self._regression: FilteredRegression | None = None

    def add(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Take the next samples (N,), (N, n); rows are made at `REGRESSOR_RATE`, torque is lagged at its full rate."""
        if self._regression is None:
            parts = (self.correction, self.features, REGRESSOR_RATE, self.blocks.block)
            self._regression = FilteredRegression(self.correction.arm, self.gain, *parts)
        self.take(self._regression.rows(t, q, dq, tau))

    @one_thread()
    def take(self, rows: Rows) -> None:
        """Take rows of the same unknowns, in the order of their times."""
        root, (M, n, size) = np.sqrt(rows.weights * rows.h[:, None]), rows.X.shape
        Xr = np.empty((M, size + 1))  # of one joint: what a row of all joints takes does not fit into a cache
        for j in range(n):
            np.multiply(root[:, j, None], rows.X[:, j], out=Xr[:, :-1])
            np.multiply(root[:, j], rows.r[:, j], out=Xr[:, -1])
            products = Xr.T @ Xr
            self.A[j] += products[:-1, :-1]
            self.b[j] += products[:-1, -1]
            self.c[j] += products[-1, -1]
        times = np.sqrt(rows.weights) * rows.h[:, None]

        def integral(part: slice) -> NDArray[np.float64]:
            by_joint = times[part].T[:, None]
            X, r = by_joint @ rows.X[part].swapaxes(0, 1), by_joint @ rows.r[part].T[..., None]
            return np.concatenate([X, r], axis=2)[:, 0]

        self.blocks.extend_by(rows.h, integral)

    @classmethod
    def joined(cls, parts: Sequence[RegressionData]) -> RegressionData:
        """What several stretches of one recording say together, to be read and not to be added to."""
        first = parts[0]
        out = cls(first.correction, first.gain, first.features, first.blocks.block, first.session)
        for part in parts:
            out.A += part.A
            out.b += part.b
            out.c += part.c
        out.blocks = BlockMeans.joined([part.blocks for part in parts])
        return out

    def discount(self, share: float) -> None:
        """Let all rows so far count for a share of what they did, as the arm may have changed since."""
        for values in (self.A, self.b, self.c):
            values *= share
        self.blocks.discount(share)

    def less(self, phi: NDArray[np.float64]) -> None:
        """Take the torque of a known body (10,) off all rows so far."""
        self.c -= (2.0 * self.b[:, :10] - self.A[:, :10, :10] @ phi) @ phi
        self.b -= self.A[:, :, :10] @ phi
        self.blocks.sums[:, :, -1] -= self.blocks.sums[:, :, :10] @ phi

    def of_features(self, features: JointFeatures) -> RegressionData:
        """The same with the first waves of the pose only, to be read and not to be added to."""
        out = RegressionData(self.correction, self.gain, features, self.blocks.block, self.session)
        out.noise, out.usual = self.noise, self.usual
        rows, by = self._of(features)
        out.A, out.b = self.products_of(features)
        out.c = self.c
        out.blocks = self.blocks.mapped(lambda sums: sums[..., np.append(rows, -1)] * np.append(by, 1.0))
        return out

    def products_of(self, features: JointFeatures) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A (n, size, size) and b (n, size) with the first waves of the pose only."""
        rows, by = self._of(features)
        return self.A[:, rows[:, None], rows] * np.outer(by, by), self.b[:, rows] * by

    def _of(self, features: JointFeatures) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Which unknowns are those with fewer features, and the factors that make them so."""
        keep, scale = self.features.first(features)
        shared = np.arange(10 + self.correction.size)
        return np.concatenate([shared, len(shared) + keep]), np.concatenate([np.ones(len(shared)), scale])

    def selected(self, E: NDArray) -> tuple[NDArray, NDArray]:
        """A and b over the unknowns z, where [phi, eta] = E·z; the features' weights stay out of it."""
        shared = slice(0, 10 + self.correction.size)
        squares = columns_of(self.A[:, shared, shared], E)
        return columns_of(squares.swapaxes(1, 2), E), columns_of(self.b[:, None, shared], E)[:, 0]

    def rms_of(self, phi: NDArray[np.float64]) -> NDArray[np.float64]:
        """Root mean square (n,) of the torque that a body (10,) costs the joints [N·m], behind the lag."""
        squares = np.einsum("k,jkl,l->j", phi, self.A[:, :10, :10], phi)
        return np.sqrt(np.maximum(squares, 0.0) / max(self.blocks.duration, 1e-9))

    def residual_power(self, x: NDArray, weights: NDArray) -> NDArray[np.float64]:
        """Mean square (n,) [N²·m²] of what x (10 + p,), payload and eta, and the features' weights (n, R) leave.

        It holds all frequencies that the lag lets pass, where the long-run variance knows the lowest alone.
        """
        full = np.concatenate([np.broadcast_to(x, (len(self.c), len(x))), weights], axis=1)
        left = self.c - 2.0 * np.einsum("jk,jk->j", self.b, full) + np.einsum("jk,jkl,jl->j", full, self.A, full)
        return np.maximum(left, 0.0) / max(self.blocks.duration, 1e-9)

    def residual_variance(
        self,
        x: NDArray,
        prior: NDArray,
        novelty: float = NOVELTY,
        weights: NDArray | None = None,
        spread: Callable[[int, NDArray], NDArray] | None = None,
    ) -> NDArray[np.float64]:
        """Long-run variance S (n,) of the residual, pulled towards the prior by `_PRIOR_COUNT` blocks.

        Args:
            x: (10 + p,) payload and eta.
            prior: S as expected before (n,).
            novelty: [s] beyond which more time on similar motions counts no more.
            weights: (n, R) of the features.
            spread: spread(j, X) is the variance (B,) of X·[x, weights_j], X (B, size): what a fit with many unknowns
                leaves is smaller than the noise, by this much.
        """
        means, times, weights_of = self.blocks.means()
        total = np.zeros(len(self.b))
        for j in range(len(total)):
            X, full = means[:, j, :-1], x if weights is None else np.concatenate([x, weights[j]])
            squared = (means[:, j, -1] - X[:, : len(full)] @ full) ** 2
            if spread is not None:
                squared += spread(j, X)
            total[j] = (times * weights_of) @ squared
        blocks = float(weights_of.sum())
        free = blocks if spread is not None else max(blocks - 2.0, 0.0)
        S = (_PRIOR_COUNT * prior + total) / (_PRIOR_COUNT + free)
        return S * max(1.0, self.blocks.duration / novelty)
