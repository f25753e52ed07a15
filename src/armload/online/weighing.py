"""Is it a change? Each row weighed by what it may be (`modes.py`), whether a run has taken it or not.

A change is detected once it has been sure for `HOLDS`; after a contact, once the new payload also stays. What would
have less than no mass for as long is a contact; or something that was on the arm from the start has been taken off, if
all that is mounted keeps a mass then and it lasts for `CONTACT_LONGEST`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms.momentum_row import MomentumRow, wrench_row
from armload.online.modes import Modes
from armload.online.runs import Gaussian, can_be, tool_std
from armload.online.sticking import Sticking, stuck
from armload.online.thresholds import (
    AFTER_CONTACT,
    CONTACT_LONGEST,
    EARLY,
    FIRST_MOTOR,
    FIRST_TARED,
    FIRST_UNTARED,
    HOLDS,
    LAG,
    LIKELY,
    PATIENCE,
    SURE,
)
from armload.posterior import PosteriorLeastSquares
from armload.posterior.sequential import SequentialPosterior
from armload.recording import GAP, Sample
from armload.regression import payload_prior_std
from armload.regression.prior import payload_size
from armload.regression.row_kernels import STILL
from armload.regression.rows import Row


class Weighing:
    """What the last rows of a stream are, whichever run they are of.

    Args:
        run: the first run of the stream.

    Attributes:
        modes: the probabilities. row_t: time of the last row [s]. steady_t: of the last one of a steady arm with the
            same payload [s].
    """

    def __init__(self, run: PosteriorLeastSquares) -> None:
        self._unit, self._chain = float(payload_prior_std(run.arm)[0]), MomentumRow(run.arm).chain[:4]
        self.reset(run)

    def reset(self, run: PosteriorLeastSquares) -> None:
        """Forget the stream; the next row is the first of a run."""
        self.modes = Modes(self._unit, run.stream.correction.effort, payload_size(run.arm))
        self._motor = False  # whether its torque is measured at the motors
        self._sticking = Sticking(len(run.stream.correction.effort))  # of joints behind whose gears it is measured
        # Coulomb friction (n,) [N·m], as of the last row taken: a run that ends is solved anew beside
        self._coulomb = np.zeros(len(run.stream.correction.effort))
        self._touched = False  # whether something has touched the arm since it was steady
        self._sure_since = np.inf  # when the payload was first surely another one
        self._impossible_since = np.inf  # when what would be held first was no payload
        self._taken_off = False  # whether it is that something was taken off that was on the arm from the start
        self._lifted_since = np.inf  # when that may first have been so, since the arm was steady
        self._gaussian: tuple[PosteriorLeastSquares, Gaussian] | None = None  # before the row, and of which run
        self._at_rest: tuple[SequentialPosterior, NDArray[np.float64]] | None = None  # foreseen by, and where
        self._moved = np.inf  # for how long a joint has moved, by its row's weight, since the arm last stood [s]
        self._seen_steady = False  # whether the arm was steady there: what the pose is wrong by is known
        self.row_t = self.steady_t = -np.inf
        self._began = self._first_t = np.inf  # of the stream's first row, of the run's

    def begin_run(self) -> None:
        """The rows that come are of another run."""
        self.modes.reset()
        self._sure_since = self._impossible_since = self._lifted_since = self._first_t = np.inf

    @property
    def steady(self) -> float:
        """Probability that the last rows are of the arm as it was and the same payload.

        A drift may be the arm's own, but not one that a contact has turned into: a constant push looks like one as soon
        as its size is known, while an arm does not jump.
        """
        return self.modes.steady - self.modes.drift if self._touched else self.modes.steady

    @property
    def sticks(self) -> float:
        """By which share of the variance of Coulomb friction joints at rest are held beyond what any run expects."""
        return 0.0 if self._motor else self._sticking.share

    @property
    def blind(self) -> bool:
        """Whether a change would not show yet, as the arm has stood, and its torque is measured at the motors.

        There friction hides a payload until a joint moves: slow rows weigh little.
        """
        return self._moved < LAG and self._motor

    def changed(self) -> bool:
        """Whether the last row shows that the payload is surely another one than the run's."""
        modes = self.modes
        if self.steady > LIKELY:
            self.steady_t, self._touched, self._lifted_since = self.row_t, False, np.inf
        self._touched = self._touched or modes.contact > 0.5
        lasting = not self._touched or (modes.other > LIKELY and modes.stays >= AFTER_CONTACT)
        possible = self._impossible_since == np.inf or self._taken_off
        sure = modes.other + modes.handing > SURE and lasting and possible
        self._sure_since = min(self._sure_since, self.row_t) if sure else np.inf
        return self.row_t - self._sure_since >= HOLDS

    def _possible(self, run: PosteriorLeastSquares) -> tuple[bool, bool, bool]:
        """Whether masses can be: of what would have been added by now, of what was before, of all that is mounted then.

        Nothing lifts the arm but what touches it; what was on it from the start may be taken off.
        """
        if self.modes.handing + self.modes.other <= 0.5:
            return True, True, True
        (phi, known), (shift, spread), tool = self._before_row(run), self.modes.shift(), run.arm.attached
        state = run.stream.state
        before, variance = float(phi[0]), float(known[0, 0])
        in_all, doubt = (before, variance) if state is None else state.mass_in_all(phi, known)
        in_all += 0.0 if tool is None else tool.mass
        step, more, lighter = float(shift[0]), float(spread[0, 0]), tool_std(run)
        return (
            can_be(before + step, np.sqrt(variance + more), self._unit, lighter),
            can_be(before, np.sqrt(variance), self._unit, lighter),
            can_be(in_all + step, np.sqrt(doubt + more), self._unit),
        )

    def believed(self, lasted: float) -> bool:
        """Whether what has not fitted for so long [s] is believed: then a drift is the arm's."""
        patience = CONTACT_LONGEST if self._touched else PATIENCE
        if self._taken_off or self.modes.taken_off > 0.0:  # rather a change, which may not be sure at once
            patience = CONTACT_LONGEST + PATIENCE
        if lasted <= patience:
            return False
        self._touched = False
        return True

    def taken(self, run: PosteriorLeastSquares) -> bool:
        """Weigh the innovations of the run's last row, which it has taken; whether the run knows enough to tell."""
        stream = run.stream
        if (state := stream.state) is None or (row := stream.row) is None:
            return False
        self._motor = stream.posterior.torque == "motor"
        self._coulomb = stream.correction.coulomb(stream.posterior.eta)
        self._has_moved(row)
        h, self.row_t = row.t - self.row_t, row.t
        first = FIRST_MOTOR if self._motor else FIRST_TARED if stream.tares else FIRST_UNTARED
        known = stream.seconds > first
        self._began, self._first_t = min(self._began, row.t), min(self._first_t, row.t)
        # behind the gears friction hides no load. Its rows stand for a quarter of a second, however long it has stood
        if not self._motor and (known or row.t - self._first_t > first) and self._rests(row, state):
            known = True
            if 0.0 < h <= GAP:
                self._weigh(row, h, state, run)
        elif row.h > 0.0 and (known or self._motor):
            self._take(row.h, row, state.seen, state.scale, run, True)
            if not known:  # how large the noise is shows all the same
                self.modes.reset()
        if row.h > 0.0:
            self._gaussian = (run, stream.answer())
        return known

    def passed_over(self, sample: Sample, run: PosteriorLeastSquares, state: SequentialPosterior | None) -> bool:
        """Weigh a sample that the run does not take, by its `state`; whether a row came of it that says something."""
        assert state is not None
        if (row := run.stream.look(*sample)) is None:
            return False
        self._has_moved(row)
        h, self.row_t = row.t - self.row_t, row.t
        if says := 0.0 < h <= GAP:
            self._weigh(row, h, state, run)
        return says

    def _has_moved(self, row: Row) -> None:
        """Count for how long a joint has moved, whether the run takes the row or not."""
        self._moved = 0.0 if row.h <= 0.0 else self._moved + row.h * max(row.weights.tolist())

    def _weigh(self, row: Row, h: float, state: SequentialPosterior, run: PosteriorLeastSquares) -> None:
        """Weigh a row that the run did not take, or of an arm at rest, for as long as it stands."""
        error = None
        # friction at rest is not known, and stays: it is the standstill's, no row's own, once a steady arm has shown it
        if self._rests(row, state) and (self._seen_steady or self.modes.steady > LIKELY):
            self._seen_steady = True
            error = state.noise / (row.weights * run.stream.noise.block)
            if not (self._motor or run.stream.allows_for_sticking):
                error = error + self._sticking.share * self._coulomb**2 / 3.0
            row = row._replace(weights=np.ones_like(row.weights))
        seen, scale = state.predict(row._replace(h=h))
        self._take(h, row, seen, scale, run, False, error)

    def _take(
        self,
        h: float,
        row: Row,
        seen: NDArray,
        scale: NDArray,
        run: PosteriorLeastSquares,
        taken: bool,
        error: NDArray | None = None,
    ) -> None:
        """Hand a row to the modes; `error`: of a standstill."""
        modes = self.modes
        before = self._before_row(run)
        if self._motor or (error is None and not run.stream.allows_for_sticking):
            sticks, share = stuck(row.weights, run.stream.presliding, self._coulomb), 1.0
            if not self._motor:
                share = self._sticking.share
                if taken:
                    self._sticking.take(h, scale, seen, before, sticks, modes)
            if share > 0.0:  # of a block of rows, not of each
                seen = seen.copy()
                seen[:, 11] += share * scale**2 * sticks * run.stream.noise.block / h
        modes.expect(early=not self._motor and row.t - self._began < EARLY)
        modes.take(h, seen, row.X, wrench_row(*self._chain, row.q), scale, *before, taken, error)
        added, was, mounted = self._possible(run)
        lifted = not added and mounted
        self._impossible_since = np.inf if added else min(self._impossible_since, row.t)
        self._lifted_since = min(self._lifted_since, row.t) if lifted else self._lifted_since
        self._taken_off = lifted and (row.t - self._lifted_since > CONTACT_LONGEST or not was)
        if row.t - self._impossible_since >= HOLDS and not self._taken_off:
            modes.no_payload(perhaps_taken_off=lifted)

    def _rests(self, row: Row, state: SequentialPosterior) -> bool:
        """Whether the arm stands, or has hardly moved since it stood; it is foreseen anew elsewhere."""
        last = self._at_rest
        near = last is not None and last[0] is state and float(np.abs(row.q - last[1]).max()) <= STILL
        if not near:
            self.modes.foresee_anew()
            self._at_rest, self._seen_steady = (state, row.q) if row.h <= 0.0 else None, False
        return near or row.h <= 0.0

    def _before_row(self, run: PosteriorLeastSquares) -> Gaussian:
        """phi and covariance before the row, under the weak prior."""
        if self._gaussian is not None and self._gaussian[0] is run:
            return self._gaussian[1]
        return np.zeros(10), np.diag(payload_prior_std(run.arm) ** 2)
