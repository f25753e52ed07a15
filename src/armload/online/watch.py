"""One run for each payload: a change begins a new run, its transient kept out, and an old one may be taken up again.

    … run A (empty) ──change──▶ 0.2 s left out ──▶ run B (tare: A) ──change──▶ 0.2 s ──▶ run C, or A again if it fits

The watch is in one of three phases:

    FOLLOWING   the run takes the sample, and its innovations are looked at;
                they fit no more → DOUBTING, a change of payload explains them best → SETTLING
    DOUBTING    the sample is looked at, and the run is not told;
                samples fit again, or have not for too long → FOLLOWING, a change of payload → SETTLING
    SETTLING    the sample is left out, while the next run is made beside;
                the transient is over → FOLLOWING, with the next run

After a change the new run is *judged* while it is followed: it says what the change was, once its mass is known, and
gives way to the earlier run if it holds what that one held (a push that has ended). The run of the empty arm is a tare
of the runs after it, beside the one that was given, if one was. Of a run that ends the last rows are taken back: a
change is there before it is noticed.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from armload.estimators import Estimate
from armload.online.changes import ChangeDetector, Weighed
from armload.online.event import Event
from armload.online.runs import Gaussian, Runs
from armload.online.schedule import Deferred
from armload.online.thresholds import (
    BACK,
    BACK_AFTER,
    DECIDED,
    FIRST_TARED,
    FIRST_UNTARED,
    KIND_FROM,
    KIND_LATEST,
    KIND_STD,
    LEARNT,
    LONGEST,
    PASSING,
    PATIENCE,
    RETURN_STD,
    RETURN_UNTIL,
    TRANSIENT,
)
from armload.posterior import PosteriorLeastSquares
from armload.posterior.worker import Worker
from armload.recording import Sample
from armload.regression import payload_prior_std

Phase = Literal["following", "doubting", "settling"]
FOLLOWING: Phase = "following"
DOUBTING: Phase = "doubting"
SETTLING: Phase = "settling"


@dataclass
class _Change:
    """A change that is settling: until when [s], whether the run before it was a passing one, the run after it."""

    until: float
    passing: bool
    following: Future[PosteriorLeastSquares] | PosteriorLeastSquares


class PayloadWatch:
    """The runs of a stream, and the phase it is in.

    Args:
        first: the identifier of the first run.

    Attributes:
        phase: what becomes of samples at present. answered: the run that the last estimate is of.
        event: the last change noticed.
    """

    def __init__(self, first: PosteriorLeastSquares) -> None:
        self._runs = Runs(first)
        self._unit = float(payload_prior_std(first.arm)[0])
        self._look = Deferred()
        self._worker: Worker | None = None
        self._closing: Future[None] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the stream; the next sample is the first."""
        self._wait_for_closing()
        self._runs.reset()
        self._look.reset()
        self.phase: Phase = FOLLOWING
        self.answered = self.run
        self.event: Event | None = None
        self._detector: ChangeDetector | None = None
        self._gaussian: tuple[PosteriorLeastSquares, Gaussian] | None = None  # before the row, and of which run
        self._doubted_at = np.inf
        self._gave_up = False  # doubting: what does not fit is believed until it fits again
        self._change: _Change | None = None
        self._judging = False  # whether the run is new, and may give way to the earlier one
        self._held_before = False

    @property
    def run(self) -> PosteriorLeastSquares:
        """The identifier of the current run."""
        return self._runs.current

    @property
    def runs(self) -> Runs:
        """The runs that are kept."""
        return self._runs

    @property
    def settling(self) -> bool:
        """Whether samples are left out because the payload has just changed."""
        return self.phase == SETTLING

    @property
    def doubting(self) -> bool:
        """Whether samples are left out because they do not fit: a push, or a change not yet sure."""
        return self.phase == DOUBTING

    def update(self, sample: Sample, held: bool) -> Estimate | None:
        """Take one sample; None while it does not count. `held`: whether anything was, by the last estimate."""
        if self.phase == SETTLING:
            assert self._change is not None
            if sample.t < self._change.until:
                return None
            self._take_up_the_next()
        if self.phase == DOUBTING:
            self._look_on(sample, held)
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
        if state is None or row is None or row.h <= 0.0:
            return
        if self._detector is None:
            self._detector = ChangeDetector(self._unit, stream.correction.effort)
            state.predict(row)  # loaded now, not in the middle of a change
        found = self._detector.take(row.h, state.seen, row.X, state.scale, *self._before_row)
        self._gaussian = (self.run, stream.answer())
        if stream.seconds <= (FIRST_TARED if stream.tares else FIRST_UNTARED):
            return
        self._gave_up = self._gave_up and self._detector.suspicious
        if found is not None:
            self._begin_change(sample, found, held)
        elif self._detector.suspicious and not self._gave_up:
            self.phase, self._doubted_at = DOUBTING, sample.t

    @property
    def _before_row(self) -> Gaussian:
        """phi and covariance before the row, under the weak prior."""
        if self._gaussian is None or self._gaussian[0] is not self.run:
            return np.zeros(10), np.diag(payload_prior_std(self.run.arm) ** 2)
        return self._gaussian[1]

    # ------------------------------------------------------------------ doubting

    def _look_on(self, sample: Sample, held: bool) -> None:
        """Look at a sample that the run is not told: something may be pulling at the arm, or the payload changing."""
        stream, detector = self.run.stream, self._detector
        assert stream.state is not None
        assert detector is not None
        row = stream.look(*sample)
        if row is None or row.h <= 0.0:
            return
        seen, scale = stream.state.predict(row)
        found = detector.take(row.h, seen, row.X, scale, *self._before_row)
        since = sample.t - self._doubted_at
        if found is not None and since < DECIDED:
            self._begin_change(sample, found, held)
        elif self._judging and since > BACK_AFTER and self._earlier_explains():
            self._begin_change(sample, detector.last, held)
        knows_its_arm = bool(stream.tares) or stream.seconds > LEARNT
        self._gave_up = since > (PATIENCE if knows_its_arm else DECIDED)
        if self.phase == DOUBTING and (self._gave_up or not detector.suspicious):
            self.phase = FOLLOWING

    def _earlier_explains(self) -> bool:
        """Whether what was held before the last change explains the last rows better than what is held now."""
        before = self._runs.payload_of(self._runs.previous)
        assert self._detector is not None
        return before is not None and self._detector.ratio(before[0] - self._before_row[0]) > BACK

    # ------------------------------------------------------------------ a change, and the run after it

    def _begin_change(self, sample: Sample, found: Weighed, held: bool) -> None:
        """A change: the next run is made beside the stream while the transient lasts."""
        assert self._detector is not None
        run = self.run
        passing = self._judging and run.stream.seconds < PASSING
        self.event = Event("change", sample.t, sample.t - self._detector.seconds(found.rows), float(found.delta[0]))
        self._held_before, self._judging = held, False
        following = self._beside(self._made, run, self._runs.reference_for_next(held))
        self._change, self.phase = _Change(sample.t + TRANSIENT, passing, following), SETTLING

    @staticmethod
    def _made(run: PosteriorLeastSquares, reference: PosteriorLeastSquares | None) -> PosteriorLeastSquares:
        run.stream.finish(taken_back=LONGEST)
        following = run.another(reference)
        following.prepare()
        return following

    def _take_up_the_next(self) -> None:
        """The transient is over: the next run begins."""
        self.hold()
        assert self._change is not None
        change, self._change = self._change, None
        assert isinstance(change.following, PosteriorLeastSquares)
        self._watch_anew(self._runs.follow(change.following, change.passing))
        self._judging = True

    def _judge(self, estimate: Estimate, held: bool) -> None:
        """Say what the change was once the new run can tell, and take up the earlier run where it fits."""
        assert self.event is not None
        seconds, std = self.run.stream.seconds, float(estimate.std[0]) / self._unit
        if seconds < KIND_FROM:
            return
        self._judging = seconds <= RETURN_UNTIL
        if std <= RETURN_STD and self._runs.is_earlier(estimate):
            self._watch_anew(self._runs.go_back())
            self._judging = False
            self.event = replace(self.event, kind="return")
        elif self.event.kind == "change" and (std <= KIND_STD or seconds > KIND_LATEST):
            known = {(False, True): "grasp", (True, False): "release", (True, True): "swap"}
            kind = known.get((self._held_before, held))
            self.event = replace(self.event, kind=kind or ("grasp" if self.event.mass > 0 else "release"))

    def _watch_anew(self, dropped: PosteriorLeastSquares | None) -> None:
        """Begin to watch the current run; one that is not wanted any more has its thread stopped."""
        if self._detector is not None:
            self._detector.reset()
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
        if self._change is not None and isinstance(self._change.following, Future):
            self._change.following = self._change.following.result()
        for run in (*self._runs, *self._next):
            run.stream.hold()

    def close(self) -> None:
        """Stop what runs beside."""
        self.hold()
        for run in (*self._runs, *self._next):
            run.close()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None

    @property
    def _next(self) -> list[PosteriorLeastSquares]:
        """The run after a change, where it is ready."""
        made = None if self._change is None else self._change.following
        return [made] if isinstance(made, PosteriorLeastSquares) else []
