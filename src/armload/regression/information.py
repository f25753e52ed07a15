"""What a recording says about the payload and the arm's mismatch together, accumulated in constant memory.

    r = W·phi + Z·eta + G·g + e

r, W, Z, G are the acceleration-free filtered regression (`arms.filtered`); eta is shared by the joints
(`correction.py`), g are each joint's own weights of its features (`features.py`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import vectorize
from numpy.typing import NDArray

from armload.arms import momentum_regressor
from armload.recording import GAP
from armload.regression.block_means import BlockMeans
from armload.regression.features import JointFeatures
from armload.regression.filtered import Lag, filtered_regressor
from armload.regression.mismatch import FRICTION_WIDTH, Correction

REGRESSOR_RATE = 200.0  # [Hz] W, Z and G are computed no more often: they hold nothing above a few hertz
_STILL = (
    1e-3  # [rad] an arm that stays so near for a block shows one value of its stiction: more of it tells nothing new
)
_PRIOR_COUNT = 4.0  # weight of the prior long-run variance, in blocks
# [s] a mismatch that is a function of the configuration does not average away on similar motions
NOVELTY = 10.0


class Stiction:
    """Whether an arm has stood still for so long that its stiction, one value while it lasts, is known.

    Args:
        settling: [s] that one pose counts.
    """

    def __init__(self, settling: float) -> None:
        self.settling = settling
        self._rest: tuple[float, NDArray] | None = None  # when and where the arm was last seen to move

    def known(self, t: float, q: NDArray) -> bool:
        """Whether the pose (n,) at t [s] tells nothing new; times rise."""
        if self._rest is None or np.abs(q - self._rest[1]).max() > _STILL:
            self._rest = (t, q)
        return t - self._rest[0] > self.settling


@vectorize(cache=True)
def presliding(dq, excess):
    """Weight of a joint's row at velocity dq [rad/s]: 1 in motion, 1/(1 + excess) at rest (`Correction.presliding`)."""
    return 1.0 / (1.0 + excess * (1.0 - np.tanh(np.abs(dq) / FRICTION_WIDTH) ** 2))


class RegressionData:
    """What one recording says about x_j = [phi, eta, g_j]: information per joint and block sums.

    Args:
        correction: the unknowns eta of the arm.
        gain: λ of the lag [1/s].
        features: of each joint's nonparametric part; None: there is none.
        block: length of the blocks of the residual's batch means [s].
    """

    def __init__(
        self, correction: Correction, gain: float, features: JointFeatures | None = None, block: float = 1.0
    ) -> None:
        self.correction, self.gain = correction, gain
        arm = correction.arm
        self.features = features or JointFeatures(arm.n, 0, 0)
        size = 10 + correction.size + self.features.size
        self.A = np.zeros((arm.n, size, size))  # ∫ X_jᵀ·X_j dt
        self.b = np.zeros((arm.n, size))  # ∫ X_jᵀ·r_j dt
        self.blocks = BlockMeans((arm.n, size + 1), block)  # of √w·[X, r]
        self._lags = tuple(Lag(gain) for _ in range(5))
        self._torque, self._bare, self._regressor, self._pose, self._velocity = self._lags
        self._last_sample = self._last_row = -np.inf
        self._stiction = Stiction(block)

    def add(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Take the next samples (N,), (N, n); W and Z are computed at `REGRESSOR_RATE`, torque at its full rate."""
        edges = np.flatnonzero(np.diff(t, prepend=self._last_sample) > GAP)
        for start, stop in zip([0, *edges], [*edges, len(t)], strict=True):
            if start in edges:
                for lag in self._lags:
                    lag.reset()
                self._last_row = -np.inf
            if stop > start:
                self._segment(t[start:stop], q[start:stop], dq[start:stop], tau[start:stop])
        self._last_sample = t[-1]

    def _segment(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        lagged = self._torque(t, tau)
        rows, last = [], self._last_row
        for k, now in enumerate(t):
            if now - last >= 0.9 / REGRESSOR_RATE:
                rows.append(k)
                last = now
        if not rows:
            return
        h = np.diff(t[rows], prepend=self._last_row)
        h[~np.isfinite(h)] = 0.0
        h[[self._stiction.known(now, pose) for now, pose in zip(t[rows].tolist(), q[rows], strict=True)]] = 0.0
        self._last_row = last
        self.take_rows(
            h, *self._rows(t[rows], q[rows], dq[rows], lagged[rows]), presliding(dq[rows], self.correction.presliding)
        )

    def take_rows(self, h: NDArray, X: NDArray, r: NDArray, w: NDArray) -> None:
        """Take rows X (N, n, size), r (N, n) that stand for h (N,) seconds each, of weights w (N, n)."""
        rooted = np.sqrt(w)[:, :, None] * np.concatenate([X, r[:, :, None]], axis=2)
        for j in range(self.correction.arm.n):
            Xr = rooted[:, j] * np.sqrt(h)[:, None]
            products = Xr.T @ Xr
            self.A[j] += products[:-1, :-1]
            self.b[j] += products[:-1, -1]
        self.blocks.extend(h, rooted)

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, lagged: NDArray) -> tuple[NDArray, NDArray]:
        """X (N, n, size) and r (N, n)."""
        arm, gain = self.correction.arm, self.gain
        p, drift = arm.momentum(q, dq)
        r = lagged - gain * p - self._bare(t, drift - gain * p, initial=-gain * p[0])
        payload, own = momentum_regressor(arm.frame_motion(q), dq), self.correction.regressor(q, dq)
        momentum = np.concatenate([payload.momentum, own.momentum], axis=2)
        drift = np.concatenate([payload.drift, own.drift], axis=2)
        parts = [filtered_regressor(t, momentum, drift, self._regressor)]
        if self.features.size:
            pose = self._pose(t, self.features.of_pose(q))  # once for all joints
            parts += [np.broadcast_to(pose[:, None], (len(t), arm.n, self.features.pose))]
            parts += [self._velocity(t, self.features.of_velocity(dq))]
        return np.concatenate(parts, axis=2), r

    def selected(self, E: NDArray) -> tuple[NDArray, NDArray]:
        """A and b over the unknowns z, where [phi, eta] = E·z; the features' weights stay out of it."""
        shared = slice(0, 10 + self.correction.size)
        return E.T @ self.A[:, shared, shared] @ E, self.b[:, shared] @ E

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
        means, times = self.blocks.means()
        total = np.zeros(len(self.b))
        for j in range(len(total)):
            X, full = means[:, j, :-1], x if weights is None else np.concatenate([x, weights[j]])
            squared = (means[:, j, -1] - X[:, : len(full)] @ full) ** 2
            if spread is not None:
                squared += spread(j, X)
            total[j] = times @ squared
        free = len(times) if spread is not None else max(len(times) - 2, 0)
        S = (_PRIOR_COUNT * prior + total) / (_PRIOR_COUNT + free)
        return S * max(1.0, self.blocks.duration / novelty)
