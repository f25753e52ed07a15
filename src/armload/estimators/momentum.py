"""Least squares on the integrated momentum form: no acceleration, and no filter either.

Over a window from t_1 to t_2 the momentum form of the load torque (`arms.regressors`) integrates to

    ∫(tau − d_bare) dt − [p_bare] = ([Y_p] + ∫(Y_g − Y_c) dt)·phi,      [x] = x(t_2) − x(t_1)

with the bare arm's momentum p and drift d. Divided by t_2 − t_1 both sides are mean torques. Windows follow one
another; only the noise of dq at their ends is differenced, so a longer window costs less noise and sees less of the
fast motion. Sources: De Luca et al., IROS 2006 (momentum form); Gautier, ICRA 1997 (identification from integrated
models, there of power).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, momentum_regressor
from armload.errors import IdentificationError
from armload.estimators.normal import NormalLeastSquares


class MomentumLeastSquares(NormalLeastSquares):
    """OLS, or WLS, on the change of momentum from one window's end to the next.

    >>> from armload.arms import arm
    >>> MomentumLeastSquares(arm("panda")).name
    'momentum'

    Args:
        arm: the bare arm.
        window: least length of a window [s].
        weighted: as in `NormalLeastSquares`.

    Raises:
        IdentificationError: a window that is not positive.
    """

    name = "momentum"

    def __init__(self, arm: Arm, window: float = 0.1, weighted: bool = False) -> None:
        if not window > 0:
            raise IdentificationError(f"the window is {window} s: expected a positive number of seconds")
        self.window = window
        super().__init__(arm, weighted)

    def _restart(self) -> None:
        self._start: float | None = None  # when the window began; then, of [Y, y] (n, 11):
        self._before = np.zeros((self.arm.n, 11))  # the momentum at its start,
        self._integral = np.zeros((self.arm.n, 11))  # the drift's integral since then, and the drift last seen
        self._drift = np.zeros((self.arm.n, 11))

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        p, d = self.arm.momentum(q, dq)
        Y = momentum_regressor(self.arm.frame_motion(q), dq)
        momentum = np.concatenate([Y.momentum, -p[..., None]], axis=2)  # (N, n, 11)
        drift = np.concatenate([Y.drift, (tau - d)[..., None]], axis=2)
        if self._start is None:
            self._start, self._last, self._before, self._drift = t[0], t[0], momentum[0], drift[0]
        h = np.diff(t, prepend=self._last)
        steps = 0.5 * h[:, None, None] * (drift + np.concatenate([self._drift[None], drift[:-1]]))
        integral = self._integral + np.cumsum(steps, axis=0)  # trapezoidal rule
        self._last, self._drift = t[-1], drift[-1]
        times, rows, closed = [], [], np.zeros((self.arm.n, 11))
        for k, now in enumerate(t):
            if now - self._start >= self.window - 0.5 * h[k]:
                rows.append((momentum[k] - self._before + integral[k] - closed) / (now - self._start))
                times.append(now)
                self._start, self._before, closed = now, momentum[k], integral[k]
        self._integral = integral[-1] - closed
        out = np.array(rows).reshape(-1, self.arm.n, 11)
        return np.array(times), out[..., 10], out[..., :10]
