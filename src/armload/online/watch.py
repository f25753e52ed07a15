"""One run for each payload: a change begins a new run, its transient kept out, and an old one may be taken up again.

    … run A (empty) ──change──▶ hand-over left out ──▶ run B (tare: A) ──change──▶ … ──▶ run C, or A again if it fits

The watch is in one of three phases, by what the last rows are (`modes.py`):

    FOLLOWING   the run takes the sample;
                it is probably not steady → DOUBTING, the payload has surely changed or is changing → SETTLING
    DOUBTING    the sample is looked at, and the run is not told;
                steady again, or not for too long → FOLLOWING, the payload has surely changed → SETTLING
    SETTLING    the sample is looked at with what the run before knows, the next run is made beside and told of what
                may be the new payload; that stays → FOLLOWING with the next run, it was none → DOUBTING with the old

After a change the new run is *judged* while it is followed: it says what the change was, once its mass is known, and
gives way to the earlier run if it holds what that one held. The run of the empty arm is a tare of the runs after it,
beside the one that was given, if one was. Of a run that ends the last rows are taken back: a change is there before it
is noticed.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from armload.estimators import Estimate
from armload.online.event import Event
from armload.online.modes import Modes
from armload.online.runs import Gaussian, Runs
from armload.online.schedule import Deferred
from armload.online.thresholds import (
    AFTER_CONTACT,
    FIRST_TARED,
    FIRST_UNTARED,
    HOLDS,
    KIND_FROM,
    KIND_LATEST,
    KIND_STD,
    LAG,
    LIGHT,
    LIKELY,
    LONG_ENOUGH,
    PATIENCE,
    RETURN_STD,
    RETURN_UNTIL,
    SURE,
    TAKEN_BACK,
)
from armload.posterior import PosteriorLeastSquares
from armload.posterior.sequential import SequentialPosterior
from armload.posterior.worker import Worker
from armload.recording import GAP, Sample
from armload.regression import payload_prior_std
from armload.regression.rows import Row

Phase = Literal["following", "doubting", "settling"]
FOLLOWING: Phase = "following"
DOUBTING: Phase = "doubting"
SETTLING: Phase = "settling"


@dataclass
class _Change:
    """A change that is settling: noticed and begun when [s], the posterior that looks on, and the run after it,
    told since when [s] if it is.
    """

    t: float
    began: float
    state: SequentialPosterior
    following: Future[PosteriorLeastSquares] | PosteriorLeastSquares
    told: float | None = None


class PayloadWatch:
    """The runs of a stream, and the phase it is in.

    Args:
        first: the identifier of the first run.

    Attributes:
        runs: those that are kept. phase: what becomes of samples at present. answered: the run that the last estimate
            is of. event: the last change noticed.
    """

    def __init__(self, first: PosteriorLeastSquares) -> None:
        self.runs = Runs(first)
        self._unit = float(payload_prior_std(first.arm)[0])
        self._look = Deferred()
        self._worker: Worker | None = None
        self._closing: Future[None] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the stream; the next sample is the first."""
        self._wait_for_closing()
        self.runs.reset()
        self._look.reset()
        self.phase: Phase = FOLLOWING
        self.answered = self.run
        self.event: Event | None = None
        self._modes = Modes(self._unit, self.run.stream.correction.effort)
        self._gaussian: tuple[PosteriorLeastSquares, Gaussian] | None = None  # before the row, and of which run
        self._row_t = self._steady_t = self._doubted_at = -np.inf  # of the last row, the last steady one, the doubt
        self._sure_t = np.inf  # since when the payload has surely changed
        self._touched = False  # whether something has touched the arm since it was steady
        self._gave_up = False  # doubting: what does not fit is believed until it fits again
        self._lately = 0.0, np.zeros(10)  # shift of phi, lagged, and when it was last followed
        self._change: _Change | None = None
        self._judging = self._unnamed = False  # whether the run is new, and may give way; whether its kind is not told
        self._held_before = False  # the change, or the doubt

    @property
    def run(self) -> PosteriorLeastSquares:
        """The identifier of the current run."""
        return self.runs.current

    @property
    def settling(self) -> bool:
        """Whether samples are left out because the payload has just changed."""
        return self.phase == SETTLING

    @property
    def doubting(self) -> bool:
        """Whether samples are left out because they do not fit: a push, or a change not yet sure."""
        return self.phase == DOUBTING

    @property
    def likely(self) -> tuple[float, float, float]:
        """Probabilities that the payload is not what the run holds, or changes; of a contact; of a drift of the arm."""
        return self._modes.handing + self._modes.other, self._modes.contact, self._modes.drift

    @property
    def sure(self) -> bool:
        """Whether nothing but the arm as it was and the same payload explains the last rows."""
        return self.phase == FOLLOWING and sum(self.likely) < 1.0 - LIKELY

    def track(self) -> Gaussian:
        """Follow phi (10,) and its covariance to the last rows, which the run was not told of.

        The mixture of both hypotheses, the same payload and another; it is the wider the faster phi has moved since
        the last call.
        """
        (shift, spread), p, last = self._modes.shift(going_on=True), self.likely[0], self.run.last
        since, lately = self._lately
        lately = lately + min((self._row_t - since) / LAG, 1.0) * (shift - lately)
        self._lately, late = (self._row_t, lately), p * (shift - lately)
        spread = p * spread + p * (1.0 - p) * np.outer(shift, shift) + np.outer(late, late)
        return last.phi + p * shift, last.covariance + spread

    def update(self, sample: Sample, held: bool) -> Estimate | None:
        """Take one sample; None while it does not count. `held`: whether anything was, by the last estimate."""
        if self.phase == SETTLING:
            self._settle(sample)
            return None
        if self.phase == DOUBTING:
            if self._looked(sample, self.run.stream.state):
                self._decide(sample, held)
            return None
        if self._look.due(sample.t):
            self._examine(sample, held)
            if self.phase != FOLLOWING:
                return None
        return self._follow(sample, held)

    def conclude(self) -> Estimate:
        """The estimate of the current run after a last solution."""
        self.hold()
        self.answered = self.run
        return self.run.conclude()

    # ------------------------------------------------------------------ following

    def _follow(self, sample: Sample, held: bool) -> Estimate:
        self.answered = self.run
        before = self.run.stream.rows
        estimate = self.run.update(sample)
        if self.run.stream.rows > before and self._look.row(sample.t):
            self._examine(sample, held)
        self._look.seen(sample.t)
        if self._judging and self.run.fresh:
            self._judge(estimate, held)
        return estimate

    def _examine(self, sample: Sample, held: bool) -> None:
        """Look at the innovations of the last row, which the run has taken."""
        self._look.clear()
        stream = self.run.stream
        state, row = stream.state, stream.row
        if state is None or row is None:
            return
        known = stream.seconds > (FIRST_TARED if stream.tares else FIRST_UNTARED)
        h, self._row_t = row.t - self._row_t, row.t
        if row.h > 0.0:
            if known:
                self._modes.take(row.h, state.seen, row.X, state.scale, *self._before_row, True)
            self._gaussian = (self.run, stream.answer())
        elif known and 0.0 < h <= GAP and stream.posterior.torque == "link":  # at rest, where friction hides no load
            self._weigh(row, h, state)
        if known:
            self._decide(sample, held)

    @property
    def _before_row(self) -> Gaussian:
        """phi and covariance before the row, under the weak prior."""
        if self._gaussian is None or self._gaussian[0] is not self.run:
            return np.zeros(10), np.diag(payload_prior_std(self.run.arm) ** 2)
        return self._gaussian[1]

    # ------------------------------------------------------------------ doubting

    def _looked(self, sample: Sample, state: SequentialPosterior | None) -> bool:
        """Look at a sample that the run is not told; whether it completed a row that says something."""
        assert state is not None
        row = self.run.stream.look(*sample)
        if row is None:
            return False
        h, self._row_t = row.t - self._row_t, row.t
        if not 0.0 < h <= GAP:
            return False
        self._weigh(row, h, state)
        return True

    def _weigh(self, row: Row, h: float, state: SequentialPosterior) -> None:
        """Weigh a row that the run was not told of, for as long as it stands."""
        seen, scale = state.predict(row._replace(h=h))
        self._modes.take(h, seen, row.X, scale, *self._before_row, False)

    def _decide(self, sample: Sample, held: bool) -> None:
        """What becomes of the run, by what the last rows are."""
        modes = self._modes
        if modes.steady > LIKELY:
            self._steady_t, self._touched = self._row_t, False
        self._touched = self._touched or modes.contact > 0.5
        changed = modes.other if self._touched else modes.other + modes.handing
        if not (changed > SURE and (not self._touched or modes.stays >= AFTER_CONTACT) and self._possible()):
            self._sure_t = np.inf
        else:
            self._sure_t = min(self._sure_t, self._row_t)
        if self._row_t - self._sure_t >= HOLDS:
            self._begin_change(sample, held)
        elif modes.steady > 0.5:
            self.phase, self._gave_up = FOLLOWING, False
        elif self.phase == DOUBTING:
            self._gave_up = sample.t - self._doubted_at > PATIENCE
            self.phase = FOLLOWING if self._gave_up else DOUBTING
        elif not self._gave_up:
            self.phase, self._doubted_at, self._held_before = DOUBTING, sample.t, held

    def _possible(self) -> bool:
        """Whether what would be held now has a mass that can be."""
        (mean, covariance), (shift, spread) = self._before_row, self._modes.shift()
        std = float(np.sqrt(covariance[0, 0] + spread[0, 0]))
        return float(mean[0] + shift[0]) > -LIGHT * self._unit - std

    # ------------------------------------------------------------------ a change, and the run after it

    def _begin_change(self, sample: Sample, held: bool) -> None:
        """A change: the next run is made beside the stream while it settles."""
        run = self.run
        state = run.stream.state
        assert state is not None
        if self.phase == FOLLOWING:
            self._held_before = held
        began = max(self._steady_t, sample.t - PATIENCE)
        until = began - max(sample.t - began, TAKEN_BACK)
        self.event, self._judging, self._unnamed = Event("change", sample.t, began, None), False, True
        following = self._beside(self._made, run, self.runs.reference_for_next(self._held_before), until)
        self._change, self.phase = _Change(sample.t, began, state, following), SETTLING

    @staticmethod
    def _made(
        run: PosteriorLeastSquares, reference: PosteriorLeastSquares | None, until: float
    ) -> PosteriorLeastSquares:
        run.stream.finish(until)
        following = run.another(reference)
        following.prepare()
        return following

    def _settle(self, sample: Sample) -> None:
        """A sample while the payload may go on changing; then the next run begins, or the run before goes on."""
        change, modes = self._change, self._modes
        assert change is not None
        looked = self._looked(sample, change.state)
        if looked and modes.steady + modes.contact > SURE:
            self._call_off()
            return
        if looked and (modes.other < 0.5 or modes.stays < LAG):
            change.told = None
        elif looked and (change.told is None or change.told < self._row_t - modes.stays):
            self._ready(change).reset()
            change.told = sample.t
        if change.told is not None:
            self._ready(change).update(sample)
        if sample.t - change.t > PATIENCE or (looked and modes.other > LIKELY and self._stays(change)):
            self._take_up_the_next()

    def _stays(self, change: _Change) -> bool:
        """Whether the payload has been the same for so long that it would show, had it gone on changing.

        At the mean rate since the change began its mass would spread by rate·T/√12 over T: three of its deviations.
        """
        (shift, spread), T = self._modes.shift(), self._modes.stays
        seen = abs(float(shift[0])) * T / (self._row_t - change.began) > 3.0 * np.sqrt(12.0 * float(spread[0, 0]))
        return T >= LAG and (seen or T > LONG_ENOUGH)

    @staticmethod
    def _ready(change: _Change) -> PosteriorLeastSquares:
        """The run after a change, waited for."""
        if isinstance(change.following, Future):
            change.following = change.following.result()
        return change.following

    def _call_off(self) -> None:
        """The payload is what it was: the run before goes on."""
        assert self._change is not None
        assert self.event is not None
        change, self._change = self._change, None
        self._closing = self._beside(self._ready(change).close)
        self.event = replace(self.event, kind="return", mass=0.0)
        self.phase, self._doubted_at, self._gave_up = DOUBTING, change.t, False

    def _take_up_the_next(self) -> None:
        """The payload stays: the next run begins."""
        self.hold()
        assert self._change is not None
        change, self._change = self._change, None
        if change.told is None:
            self._ready(change).reset()
        self._watch_anew(self.runs.follow(self._ready(change)))
        self._judging = True

    def _judge(self, estimate: Estimate, held: bool) -> None:
        """Say what the change was once the new run can tell, and take up the earlier run where it fits."""
        assert self.event is not None
        seconds, std = self.run.stream.seconds, float(estimate.std[0]) / self._unit
        if seconds < KIND_FROM:
            return
        self._judging = seconds <= RETURN_UNTIL
        if std <= RETURN_STD and self.runs.is_earlier(estimate):
            self._watch_anew(self.runs.go_back())
            self._judging = False
            self.event = replace(self.event, kind="return")
        elif self._unnamed and (std <= KIND_STD or seconds > KIND_LATEST or self.run.stream.stands):
            known = {(False, True): "grasp", (True, False): "release", (True, True): "swap"}
            self._unnamed = False
            self.event = replace(self.event, kind=known.get((self._held_before, held), "change"))

    def _watch_anew(self, dropped: PosteriorLeastSquares | None) -> None:
        """Begin to watch the current run; one that is not wanted any more has its thread stopped."""
        self._modes.reset()
        self._sure_t = np.inf
        self._look.clear()
        self.phase, self._gave_up = FOLLOWING, False
        if dropped is not None:
            self._closing = self._beside(dropped.close)

    # ------------------------------------------------------------------ what is done beside

    def _beside(self, task: Callable, *arguments: Any) -> Future:
        """Have something done by the watch's own thread."""
        if self._worker is None:
            self._worker = Worker()
        return self._worker.submit(task, *arguments)

    def _wait_for_closing(self) -> None:
        if self._closing is not None:
            self._closing.result()
            self._closing = None

    def hold(self) -> None:
        """Wait for what is done beside."""
        self._wait_for_closing()
        if self._change is not None:
            self._ready(self._change)
        for run in (*self.runs, *self._next):
            run.stream.hold()

    def close(self) -> None:
        """Stop what runs beside."""
        self.hold()
        for run in (*self.runs, *self._next):
            run.close()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None

    @property
    def _next(self) -> list[PosteriorLeastSquares]:
        """The run after a change, where it is ready."""
        made = None if self._change is None else self._change.following
        return [made] if isinstance(made, PosteriorLeastSquares) else []
