"""Torque difference with a tare along the same motion: what the arm does wrong it does wrong in both runs.

With the same motion the arm's own mismatch (friction, offsets, links, whatever no model holds) is nearly the same
torque at the same place of both runs, and goes with their difference:

    r_run(t) − r_tare(t + shift) = W_run(t)·phi + e,      r = F[tau − tau_bare]

each r from the acceleration-free filtered regression of its own log (`regression.rows`). The nominal arm is taken off
both, because under a payload that the controller does not know the two motions differ by milliradians.
`recording.alignment` finds the shift from the joint positions. Joints are weighed by the long-run variance of their
residual (`regression.block_means`).

Sources: Atkeson, An & Hollerbach, IJRR 1986 (difference of torques with and without load); filtered momentum form: see
`regression.rows`.
"""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.errors import IdentificationError
from armload.estimators.normal import NormalLeastSquares
from armload.recording import GAP, Recording
from armload.recording.alignment import LEAST, TOLERANCE, Aligned, MotionTracker, align
from armload.regression import FilteredRegression
from armload.regression.lag import GAIN
from armload.regression.rows import REGRESSOR_RATE, Rows

# [time constants] after which a lag has forgotten where it started: 3e-4 of it is left; 0.4 s at the default gain
_SETTLED = 7.99
# [effort limits] two logs differ by so much at least: a log that is compared with a copy of itself
# (test_two_copies_of_one_log_say_no_more_than_the_torque_is_known)
_RESOLUTION = 1e-5
# [blocks] weight of the rows' own variance, which says how the joints compare while there are few blocks
# (test_the_intervals_of_the_difference_cover_the_truth_under_correlated_noise)
_PRIOR_BLOCKS = 8.0


class DifferenceLeastSquares(NormalLeastSquares):
    """Weighted least squares on the torque difference with a tare along the same motion.

    What was mounted at the tare counts as part of the arm; the answer is what was added since. In a stream, samples
    that the tare does not show are passed over; `trace`, `at` and `run` refuse a log of another motion first. The
    covariance knows nothing of the torque's own calibration, which scales the answer: about 2 % where torque is motor
    current.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> from armload.simulation import simulate
    >>> panda = arm("panda")
    >>> DifferenceLeastSquares(panda, simulate(panda, taie2024(), rate=100.0)).name
    'difference'

    Args:
        arm: the bare arm.
        tare: an earlier log of the same arm along the same motion.
        gain: λ of the lag [1/s].

    Raises:
        IdentificationError: the tare is of another arm.
    """

    name = "difference"

    def __init__(self, arm: Arm, tare: Recording, gain: float = GAIN) -> None:
        self.arm, self.gain, self.tare = arm, gain, tare
        super()._check(tare)
        self._tracker = MotionTracker(tare)
        self._regression = FilteredRegression(arm, gain, rate=REGRESSOR_RATE)
        self._tare_t, self._tare_r = _filtered_torque(arm, tare, gain)
        super().__init__(arm, weighted=True)

    def _check(self, recording: Recording) -> None:
        """Whole recordings are checked first: the tare has to show their motion."""
        super()._check(recording)
        found = align(recording, self.tare)
        if found.coverage < LEAST or found.deviation > TOLERANCE:
            raise IdentificationError(
                f"the tare {self.tare.source} does not show the motion of {recording.source}: {found.coverage:.0%} of "
                f"its path is found there within {TOLERANCE:.0%} of the motion's amplitude, expected at least "
                f"{LEAST:.0%}; run the same motion without the payload, or use the method map, which takes any tare"
            )

    def fresh(self) -> Self:
        """Another one with the same tare that has seen nothing yet."""
        other = copy(self)
        other._tracker = copy(self._tracker)
        other._regression = FilteredRegression(self.arm, self.gain, rate=REGRESSOR_RATE)
        other.reset()
        return other

    @property
    def seconds(self) -> float:
        """How much of the run so far the tare has shown [s]."""
        return self._blocks.duration

    def _restart(self) -> None:
        self._regression.reset()
        self._began: float | None = None
        self._tracker.restart()

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        return self._aligned(self._regression.rows(t, q, dq, tau))

    def take_rows(self, rows: Rows) -> None:
        """Take rows made elsewhere with the same gain, the payload's columns first."""
        for part in self._between_gaps(rows.t):
            self._add(*self._aligned(Rows(*(column[part] for column in rows))))

    def _aligned(self, rows: Rows) -> tuple[NDArray, NDArray, NDArray]:
        """Rows that the tare shows, less its own torque; rows are new, the tracker may release older ones."""
        if self._began is None and len(rows.t):
            self._began = float(rows.t[0])
        found: list[Aligned] = []
        for now, pose, *row in zip(rows.t.tolist(), rows.q, rows.r, rows.X[:, :, :10], strict=True):
            if self._began is not None and now < self._began + _SETTLED / self.gain:
                row[0] = np.full_like(row[0], np.nan)
            found += self._tracker.feed(now, pose, row)
        times = np.array([aligned.t for aligned in found])
        y = np.array([aligned.row[0] for aligned in found]).reshape(-1, self.arm.n)
        Y = np.array([aligned.row[1] for aligned in found]).reshape(-1, self.arm.n, 10)
        if found:
            y = y - self._tare_at(np.array([aligned.t + aligned.shift for aligned in found]))
        keep = np.isfinite(y).all(axis=1)
        return times[keep], y[keep], Y[keep]

    def _tare_at(self, t: NDArray) -> NDArray[np.float64]:
        """r of the tare (M, n) at times (M,) of its clock; NaN where it has not settled."""
        return np.stack([np.interp(t, self._tare_t, column) for column in self._tare_r.T], axis=1)

    def _add(self, t: NDArray, y: NDArray, Y: NDArray) -> None:
        """Rows one stretch at a time: a row after a pause does not stand for the time of the pause."""
        edges = np.flatnonzero(np.diff(t, prepend=self._last_row) > GAP)
        for start, stop in zip([0, *edges], [*edges, len(t)], strict=True):
            if start in edges:
                self._last_row = t[start] - 1.0 / REGRESSOR_RATE
            if stop > start:
                super()._add(t[start:stop], y[start:stop], Y[start:stop])

    def _residual_variance(self, phi: NDArray) -> NDArray[np.float64]:
        """Long-run variance per row (n,): of few blocks, drawn towards the variance of the rows, scaled alike."""
        rows = super()._residual_variance(phi) + (_RESOLUTION * rated_effort(self.arm)) ** 2
        if not self._blocks.ready:
            return rows
        means, times, _ = self._blocks.means()
        square = (means[..., 10] - means[..., :10] @ phi) ** 2 * times[:, None] * self._blocks.rate
        scale = np.exp(np.mean(np.log(np.maximum(square.mean(axis=0), 1e-12) / rows)))
        return (_PRIOR_BLOCKS * scale * rows + square.sum(axis=0)) / (_PRIOR_BLOCKS + len(times))


def _filtered_torque(arm: Arm, log: Recording, gain: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (M,) and r (M, n) of a whole log; NaN after every gap until the lags have settled."""
    regression = FilteredRegression(arm, gain, rate=REGRESSOR_RATE)
    edges = np.flatnonzero(np.diff(log.t) > GAP) + 1
    times, torques = [], []
    for start, stop in zip([0, *edges], [*edges, len(log)], strict=True):
        part = slice(start, stop)
        rows = regression.rows(log.t[part], log.q[part], log.dq[part], log.tau[part])
        times.append(rows.t)
        torques.append(np.where((rows.t < log.t[start] + _SETTLED / gain)[:, None], np.nan, rows.r))
    return np.concatenate(times), np.concatenate(torques)
