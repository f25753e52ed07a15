"""A hand-over that goes on in the run after it, slower than the filter notices: by how much that run is behind.

A run begins once the payload seems to stay. After a hand-over of D seconds, by Δ (10,), it may still be on its way:

    phi(t) = phi + a·b·min(t, T),    b = Δ/D,    a ~ N(0, 1),    P(T > t) = ½·D/(D + t_s + t),

t from the run's first row, t_s for how long it has seemed to stay by then, T when the hand-over ends. Nobody says how
long one lasts: what has lasted D goes on as long, as likely as not (Jeffreys' prior of a scale); that it seems to stay
counts as much again. With the run's rows e ~ N(w·phi, v), s = min(t, T) and P₀ of phi beforehand,

    A = Σ w·wᵀ/v + P₀⁻¹,   k = Σ s·w·wᵀ/v·b,   κ = bᵀ·Σ s²·w·wᵀ/v·b,   h = Σ w·e/v,   g = bᵀ·Σ s·w·e/v,

    a ~ N((g − kᵀ·A⁻¹·h)/c, 1/c),   c = 1 + κ − kᵀ·A⁻¹·k,   likelihood over that of a = 0:  ½·c·E[a]² − ½·ln c

for each of some T, and phi is ahead of the run by (s·b − A⁻¹·k)·a. What the arm's unknowns have made of the rows
before is left as it was.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.online.thresholds import HOLDS, PATIENCE, UNLIKELY
from armload.posterior.stream import StreamingPosterior

# [s] T, each for those since the one before: 0.1 to 6.4 s, a third of an octave apart. With whole octaves an
# interval of ±10 g left out three of ten (test_a_run_that_a_hand_over_goes_on_in_has_the_truth_in_its_interval)
_ENDS = HOLDS * 2.0 ** (np.arange(19) / 3.0)


class Lasting:
    """What a run's rows say of a hand-over that may go on.

    Attributes:
        seconds: since the run's first row [s]. pace: (10,) by how much phi changed in a second before.
        goes_on: probability that the hand-over still does; went_on: that it did at the run's first row.
        ahead: by how much phi (10,) is ahead of the run, and the covariance of that.
    """

    def __init__(self) -> None:
        n = len(_ENDS)
        self._information, self._vector = np.zeros((10, 10)), np.zeros(10)
        self._k, self._kappa, self._g = np.zeros((n, 10, 10)), np.zeros((n, 10, 10)), np.zeros((n, 10))
        self._start: float | None = None  # of the first row [s]
        self._begun, self.pace = False, np.zeros(10)
        self._before, self._prior = np.zeros((10, 10)), np.zeros(n + 1)
        self.seconds, self.goes_on, self.went_on, self.ahead = 0.0, 0.0, 0.0, (np.zeros(10), np.zeros((10, 10)))

    def begin(self, shift: NDArray[np.float64], lasted: float, stayed: float, before: NDArray[np.float64]) -> None:
        """The run is taken up.

        Args:
            shift: by how much phi (10,) has changed. lasted: within how long [s]; one lag of the rows at least.
            stayed: for how long it seemed to stay when the run began [s]. before: standard deviations of phi (10,).
        """
        lasted = max(lasted, HOLDS)
        goes_on = 0.5 * lasted / (lasted + stayed + np.array([0.0, *_ENDS[:-1]]))
        self._prior = np.array([*(goes_on[:-1] - goes_on[1:]), goes_on[-1], 1.0 - goes_on[0]])
        self._begun, self.pace, self._before = True, shift / lasted, np.diag(before**-2.0)
        self._weigh()

    def take(self, stream: StreamingPosterior, louder: float) -> None:
        """The last row of the run, as it has seen it.

        louder: how large its noise is, in units of what it is taken for.
        """
        row, state = stream.row, stream.state
        if row is None or state is None or row.h <= 0.0:
            return
        w, e, v = state.seen[:, :10], state.seen[:, 10], louder * stream.noise.overrated * state.seen[:, 11]
        self._start = row.t if self._start is None else self._start
        self.seconds = row.t - self._start
        s = np.minimum(self.seconds, _ENDS)[:, None]
        information, vector = w.T @ (w / v[:, None]), w.T @ (e / v)
        self._information += information
        self._vector += vector
        self._k += s[:, None] * information
        self._kappa += s[:, None] ** 2 * information
        self._g += s * vector
        if self._begun:
            self._weigh()

    def over(self, variance: float) -> bool:
        """Whether the run's answer, its mass of this variance, is as good alone: an interval would be wider by 2 %."""
        mean, spread = self.ahead
        more = float(mean[0] ** 2 + spread[0, 0])
        return self.seconds > PATIENCE or (self.goes_on < UNLIKELY and more < UNLIKELY * variance)

    def _weigh(self) -> None:
        P, b = np.linalg.inv(self._information + self._before), self.pace
        k = self._k @ b
        Pk = k @ P
        c = 1.0 + self._kappa @ b @ b - (k * Pk).sum(axis=1)
        a = (self._g @ b - Pk @ self._vector) / c
        log = np.log(self._prior) + np.append(0.5 * (c * a * a - np.log(c)), 0.0)
        p = np.exp(log - log.max())
        p = p[:-1] / p.sum()
        ahead = np.minimum(self.seconds, _ENDS)[:, None] * b - Pk
        mean = (p * a) @ ahead
        self.went_on = float(p.sum())
        self.goes_on = float(p[:-1][_ENDS[:-1] > self.seconds].sum() + p[-1])
        self.ahead = mean, (ahead.T * (p * (a * a + 1.0 / c))) @ ahead - np.outer(mean, mean)
