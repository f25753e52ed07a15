"""Where the payload changes while an arm stands.

An arm that stands shows one pose, and counts for a while only (`regression.rows`). But what is taken up there shows
plainly: links, offsets and what depends on the pose stay as they were, and what the bare arm does not explain of the
torque changes by

    Δr = W·Δphi + own,      own ~ N(0, D)

with W the payload's regressor at rest. D_jj is what an offset differs by from day to day, the noise of both means, and
twice the Coulomb friction, as far as the joint has turned since: it turns over within `PRESLIDING`. With the stated
prior Δphi ~ N(0, P),

    T = Δrᵀ·(D⁻¹ − (D + W·P·Wᵀ)⁻¹)·Δr

is what a payload explains of Δr: chi-squared of three where there is none, as a pose at rest tells the mass and two
moments. Beyond its 99.9 % quantile there is one, if it explains more than it leaves. Torque of the motor's side is not
asked: stiction, or a brake, holds what is taken up, and lets go of what is not
(test_the_torque_of_a_real_ur10e_changes_while_it_stands_and_holds_the_same).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import payload_regressor
from armload.identification.thresholds import CHANGED_AT_REST, MOVES, PART_LEAST, PRESLIDING
from armload.recording import GAP
from armload.regression import solution_prior_std
from armload.regression.lag import GAIN
from armload.regression.mismatch import Correction
from armload.regression.row_kernels import STILL

_WINDOW = 0.25  # [s] of a mean: five lags
_REST = 0.1  # [s] within which a joint at rest turns by less than `STILL`
_HOP = 0.05  # [s] between two means: a lag


class _Rests(NamedTuple):
    """Rows of a log: t (M,), q (M, n), r (M, n); begin (M,): the first row of the mean that ends at a row.

    settled: (M,) whether the arm has stood for as long as a mean before it begins, and the lags hold nothing else.
    correction, coulomb: as `changes_at_rest` has them.
    """

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    r: NDArray[np.float64]
    begin: NDArray[np.int64]
    settled: NDArray[np.bool_]
    correction: Correction
    coulomb: Callable[[], NDArray[np.float64]]

    @classmethod
    def of(
        cls,
        t: NDArray[np.float64],
        q: NDArray[np.float64],
        r: NDArray[np.float64],
        correction: Correction,
        coulomb: Callable[[], NDArray[np.float64]],
    ) -> _Rests:
        """Of a log's rows."""
        row = np.arange(len(t))
        turned = np.abs(q - q[np.searchsorted(t, t - _REST)]).max(axis=1)
        moved = np.maximum.accumulate(np.where(turned > STILL, row, -1))
        fresh = np.maximum.accumulate(np.where(np.diff(t, prepend=-np.inf) > GAP, row, 0))
        since = t - np.where(moved > fresh, t[moved], t[fresh] + _WINDOW)
        return cls(t, q, r, np.searchsorted(t, t - _WINDOW), since > 2.0 * _WINDOW, correction, coulomb)

    def mean(self, row: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """r (n,) before a row, and the variance of that mean: one lag is one value."""
        some = self.r[self.begin[row] : row + 1]
        return some.mean(axis=0), some.var(axis=0) / (_WINDOW * GAIN)

    def change(self, one: int, other: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Δr (n,) of two rows, and the diagonal of D (n,) without friction."""
        (r, noise), (more, noise_then) = self.mean(one), self.mean(other)
        return more - r, self.correction.daily_std[: self.correction.arm.n] ** 2 + noise + noise_then

    def is_changed(self, before: int, now: int, turned: NDArray[np.float64]) -> bool:
        """Whether another payload explains what the torque is now, the joints having turned so far since (n,) [rad]."""
        difference, own = self.change(before, now)
        if np.sum(difference**2 / own) <= CHANGED_AT_REST:  # whatever explains it
            return False
        own = own + (2.0 * self.coulomb() * np.minimum(turned / PRESLIDING, 1.0)) ** 2
        arm, still = self.correction.arm, np.zeros((1, self.correction.arm.n))
        W = payload_regressor(arm.frame_motion(self.q[now][None]), still, still)[0] * solution_prior_std(arm)
        left = float(difference @ np.linalg.solve(np.diag(own) + W @ W.T, difference))
        return float(np.sum(difference**2 / own)) - left > max(CHANGED_AT_REST, left)

    def goes_on(self, row: int) -> bool:
        """Whether the torque is not what it was a mean before."""
        difference, own = self.change(int(self.begin[row]), row)
        return bool(np.any(difference**2 > own))


def changes_at_rest(
    t: NDArray[np.float64],
    q: NDArray[np.float64],
    r: NDArray[np.float64],
    correction: Correction,
    coulomb: Callable[[], NDArray[np.float64]],
) -> list[float]:
    """When the payload changes while the arm stands [s]; a hand-over that takes long changes it twice.

    Args:
        t, q, r: rows: times (M,), joint angles (M, n) [rad], what the bare arm does not explain (M, n) [N·m].
        correction: of the arm. coulomb: finds its Coulomb friction (n,) [N·m], and is asked where it matters.
    """
    if len(t) < 2:  # a log of some milliseconds: one mean, beside which there is none
        return []
    rests, hop, out = _Rests.of(t, q, r, correction, coulomb), max(int(_HOP / max(np.median(np.diff(t)), 1e-9)), 1), []
    rows = np.flatnonzero(rests.settled)[::hop]
    reference, seen, turned = -1, -1, np.zeros(correction.arm.n)
    k = 0
    while k < len(rows):
        row = int(rows[k])
        if reference >= 0:
            turned = np.maximum(turned, np.abs(q[seen : row + 1] - q[reference]).max(axis=0))
        seen = row
        if reference < 0 or turned.max() > MOVES:
            reference, turned = row, np.zeros(correction.arm.n)
        elif rests.is_changed(reference, row, turned):
            while k + 1 < len(rows) and rests.goes_on(int(rows[k])):
                k += 1
            out += _between(rests, reference, int(rows[k]))
            reference, seen, turned = int(rows[k]), int(rows[k]), np.zeros(correction.arm.n)
        k += 1
    return out


def _between(rests: _Rests, before: int, after: int) -> list[float]:
    """When r goes over from what it was to what it is: once, or where that takes as long as a part, twice."""
    old, new = rests.mean(before)[0], rests.mean(after)[0]
    step = new - old
    share = (rests.r[before : after + 1] - old) @ step / (step @ step)
    share[0], share[-1] = 0.0, 1.0  # but for noise
    first, middle = (before + int(np.flatnonzero(share < x)[-1]) + 1 for x in (0.1, 0.5))
    last = first + int(np.argmax(share[first - before :] > 0.9))
    edges = [first, last] if rests.t[last] - rests.t[first] > PART_LEAST else [middle]
    return [float(rests.t[row]) - 1.0 / GAIN for row in edges]
