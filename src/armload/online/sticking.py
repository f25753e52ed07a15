"""How friction behaves where joints hardly move: smooth in velocity, as the rows have it, or stuck at anything.

A joint that sticks, or has just turned round, is held by anything up to a share s of its Coulomb friction f, about the
same for a block of rows. Each s of a few is weighed by the innovations of the blocks of a steady arm,

    ē_j ~ N(0, level·v_j + s²·f_j²·mean (1 − |tanh|)²/3)      joints j, independent,

ē_j being the mean innovation of joint j over a block and v_j its variance by the run.

Source: Dahl, "A solid friction model", Aerospace Corp. TOR-158, 1968; Canudas de Wit et al., IEEE T-AC 40(3), 1995.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.online.modes import Modes
from armload.online.runs import Gaussian
from armload.online.thresholds import LEVEL_BLOCK, LEVEL_OUTLIER, STICKING_SHARES, STICKS, STICKS_BEHIND
from armload.runtime.kernels import kernel

_SHARES = np.append(0.0, STICKING_SHARES)  # none sticks, or so far


class Sticking:
    """What a stream shows of it.

    Args:
        n: number of joints.

    Attributes:
        share: E[s²], of the variance f²/3 of a joint that stands; 0 while it is likelier that none sticks: an allowance
            for what is not so makes each answer after a change at rest up to three times as wide.
    """

    def __init__(self, n: int) -> None:
        before = np.append(1.0 - STICKS, np.full(len(STICKING_SHARES), STICKS / len(STICKING_SHARES)))
        self._log, self._sums, self._h = np.log(before), np.zeros((3, n)), 0.0
        self.share = 0.0

    def take(
        self, h: float, scale: NDArray, seen: NDArray, before: Gaussian, sticks: NDArray[np.float64], modes: Modes
    ) -> None:
        """A row that a run has taken, for h [s]; of a steady arm only it counts.

        Args:
            scale: (n,) what it was multiplied by [1/(N·m)]. seen: (n, 12) as in `SequentialPosterior`. before: phi and
                its covariance. sticks: (n,) f²·(1 − |tanh|)²/3 [N²·m²]. modes: what the rows before were.
        """
        if modes.steady < 0.5:
            self._sums, self._h = np.zeros_like(self._sums), 0.0
            return
        w, (mean, P) = seen[:, :10], before
        _add(h, scale, seen, w @ mean, w @ P, sticks, self._sums)
        self._h += h
        if self._h < LEVEL_BLOCK:
            return
        N, B, more = self._sums
        variance = modes.level / N + _SHARES[:, None] ** 2 * more / self._h  # (K, n)
        log = self._log - 0.5 * (np.log(variance) + np.minimum((B / N) ** 2 / variance, LEVEL_OUTLIER)).sum(axis=1)
        self._log = np.maximum(log - log.max(), -STICKS_BEHIND)
        p = np.exp(self._log)
        self.share = float(p @ _SHARES**2 / p.sum()) if p[0] < 0.5 * p.sum() else 0.0
        self._sums, self._h = np.zeros_like(self._sums), 0.0


@kernel
def stuck(weights, presliding, coulomb):  # pragma: no cover - compiled
    """f²·(1 − |tanh|)²/3 (n,) [N²·m²] of a row: f·tanh(dq/w) is off by anything within ±f·(1 − |tanh|)."""
    out = np.empty_like(coulomb)
    for j in range(len(out)):
        slow = (1.0 / weights[j] - 1.0) / presliding[j]  # 1 − tanh²
        out[j] = (coulomb[j] * (1.0 - np.sqrt(max(1.0 - slow, 0.0)))) ** 2 / 3.0
    return out


@kernel
def _add(h, scale, seen, expected, known, sticks, sums):  # pragma: no cover - compiled
    """A row more in a block: sums (3, n) of 1/v, d/v and h·sticks; `expected`: w·m (n,). known: w·P (n, 10)."""
    y = np.empty(10)
    for j in range(len(scale)):
        for i in range(10):
            y[i] = known[j, i] * seen[j, i]
        pairs = ((y[0] + y[1]) + (y[2] + y[3])) + ((y[4] + y[5]) + (y[6] + y[7]))  # in numpy's order: to the last digit
        d, v = seen[j, 10] - expected[j], seen[j, 11] + (pairs + y[8] + y[9])
        sums[0, j] += scale[j] ** 2 / v
        sums[1, j] += scale[j] * d / v
        sums[2, j] += h * sticks[j]
