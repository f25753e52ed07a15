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
from numpy.typing import NDArray

from armload.estimators import Estimate
from armload.online.modes import Modes
from armload.online.event import Event
from armload.online.runs import Gaussian, Runs
from armload.online.schedule import Deferred
from armload.online.thresholds import (
    DECIDED,
    FIRST_TARED,
    FIRST_UNTARED,
    KIND_FROM,
    KIND_LATEST,
    KIND_STD,
    LEARNT,
    AFTER_CONTACT,
    LAG,
    LONG_ENOUGH,
    LIGHT,
    LONGEST_HANDOVER,
    LONGEST,
    PASSING,
    PATIENCE,
    RETURN_STD,
    RETURN_UNTIL,
    SETTLED,
    STEADY,
    SURE,
    UNSURE,
)
from armload.posterior import PosteriorLeastSquares
from armload.posterior.sequential import SequentialPosterior
from armload.posterior.worker import Worker
from armload.recording import Sample
from armload.regression import payload_prior_std

Phase = Literal["following", "doubting", "settling"]
FOLLOWING: Phase = "following"
DOUBTING: Phase = "doubting"
SETTLING: Phase = "settling"


@dataclass
class _Change:
    """A change that is settling: when [s], whether the run before it was a passing one, the run after it."""

    t: float
    began: float
    passing: bool
    state: SequentialPosterior
    following: Future[PosteriorLeastSquares] | PosteriorLeastSquares
    fed: float = -np.inf


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
        self._modes: Modes | None = None
        self._row_t = self._steady_t = -np.inf
        self._touched = False
        self._gaussian: tuple[PosteriorLeastSquares, Gaussian] | None = None  # before the row, and of which run
        self._doubted_at = np.inf
        self._gave_up = False  # doubting: what does not fit is believed until it fits again
        self._change: _Change | None = None
        self._judging = False  # whether the run is new, and may give way to the earlier one
        self._held_before = self._held_before_doubt = False

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

    @property
    def sure(self) -> bool:
        """Whether nothing but the arm and the same payload explains the last rows."""
        return self.phase == FOLLOWING and (self._modes is None or self._modes.steady > STEADY)

    def update(self, sample: Sample, held: bool) -> Estimate | None:
        """Take one sample; None while it does not count. `held`: whether anything was, by the last estimate."""
        if self.phase == SETTLING:
            self._settle(sample)
            return None
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
        if state is None or row is None:
            return
        if self._modes is None:
            self._modes = Modes(self._unit, stream.correction.effort)
            state.predict(row)  # loaded now, not in the middle of a change
        known = stream.seconds > (FIRST_TARED if stream.tares else FIRST_UNTARED)
        h, self._row_t = row.t - self._row_t, row.t
        if row.h > 0.0:
            if known:
                self._modes.take(row.h, state.seen, row.X, state.scale, *self._before_row, False)
            self._gaussian = (self.run, stream.answer())
        elif known and 0.0 < h < 0.1 and stream.posterior.torque == "link":
            seen, scale = state.predict(row._replace(h=h))
            self._modes.take(h, seen, row.X, scale, *self._before_row, True)
        if known:
            self._decide(sample, held)

    def _decide(self, sample: Sample, held: bool) -> None:
        """What becomes of the run, by what the last rows are."""
        modes = self._modes
        assert modes is not None
        doubtful = modes.steady < UNSURE
        if modes.steady > SURE:
            self._steady_t, self._touched = sample.t, False
        self._touched = self._touched or modes.contact > UNSURE
        changed = modes.other + (0.0 if self._touched else modes.handing)
        if changed > SURE and (not self._touched or modes.since > AFTER_CONTACT) and self._possible():
            self._begin_change(sample, self._held_before_doubt if self.phase == DOUBTING else held)
            return
        if not doubtful:
            self.phase, self._gave_up = FOLLOWING, False
        elif self.phase == FOLLOWING and not self._gave_up:
            self.phase, self._doubted_at, self._held_before_doubt = DOUBTING, sample.t, held
        elif self.phase == DOUBTING:
            stream = self.run.stream
            knows_its_arm = bool(stream.tares) or stream.seconds > LEARNT
            if sample.t - self._doubted_at > (PATIENCE if knows_its_arm else DECIDED):
                self.phase, self._gave_up = FOLLOWING, True

    def _possible(self) -> bool:
        """Whether what would be held now has a mass that can be."""
        assert self._modes is not None
        mean, covariance = self._before_row
        shift, spread = self._modes.shift
        std = float(np.sqrt(covariance[0, 0] + spread[0, 0]))
        return float(mean[0] + shift[0]) > -LIGHT * self._unit - 2.0 * std

    @property
    def _before_row(self) -> Gaussian:
        """phi and covariance before the row, under the weak prior."""
        if self._gaussian is None or self._gaussian[0] is not self.run:
            return np.zeros(10), np.diag(payload_prior_std(self.run.arm) ** 2)
        return self._gaussian[1]

    # ------------------------------------------------------------------ doubting

    def _look_on(self, sample: Sample, held: bool) -> None:
        """Look at a sample that the run is not told: something may be pulling at the arm, or the payload changing."""
        if self._looked(sample, self.run.stream.state):
            self._decide(sample, held)

    def _looked(self, sample: Sample, state: SequentialPosterior | None) -> bool:
        """Whether a sample that the run is not told completed a row, which is weighed."""
        assert state is not None
        assert self._modes is not None
        row = self.run.stream.look(*sample)
        if row is None:
            return False
        h, self._row_t = row.t - self._row_t, row.t
        if not 0.0 < h < 0.1:
            return False
        seen, scale = state.predict(row._replace(h=h))
        self._modes.take(h, seen, row.X, scale, *self._before_row, True)
        return True

    def _settle(self, sample: Sample) -> None:
        """A sample while the payload may go on changing; the next run begins, or the run before goes on."""
        change, modes = self._change, self._modes
        assert change is not None
        assert modes is not None
        if not self._looked(sample, change.state):
            if change.fed > -np.inf:
                assert isinstance(change.following, PosteriorLeastSquares)
                change.following.update(sample)
            return
        if modes.steady + modes.contact > SURE:
            self._call_off()
            return
        self._feed(sample)
        if sample.t - change.t > LONGEST_HANDOVER or (modes.other > SETTLED and self._stays()):
            self._take_up_the_next()

    def _stays(self) -> bool:
        """Whether the payload has been the same for so long that, had it gone on changing, that would show."""
        modes, change = self._modes, self._change
        assert modes is not None
        assert change is not None
        for_how_long = modes.since
        if for_how_long < LAG:
            return False
        if for_how_long > LONG_ENOUGH:
            return True
        shift, spread = modes.shift
        took = self._row_t - change.began
        # a ramp of the mean rate since it began spreads by rate·T/√12 over T: three standard deviations of the mean
        return for_how_long * abs(float(shift[0])) > 3.0 * 12.0**0.5 * took * float(np.sqrt(spread[0, 0]))

    def _feed(self, sample: Sample) -> None:
        """The next run takes samples as soon as the payload seems to be the same, and begins anew if it was not."""
        modes, change = self._modes, self._change
        assert modes is not None
        assert change is not None
        if modes.other > UNSURE and modes.since >= LAG:
            if isinstance(change.following, Future):
                change.following = change.following.result()
            if change.fed < sample.t - modes.since:
                change.following.reset()
                change.fed = sample.t
            change.following.update(sample)
        else:
            change.fed = -np.inf

    def _call_off(self) -> None:
        """It was no payload: the run before goes on."""
        self.hold()
        assert self._change is not None
        assert self.event is not None
        following, self._change = self._change.following, None
        assert isinstance(following, PosteriorLeastSquares)
        self._closing = self._beside(following.close)
        self.event = replace(self.event, kind="return")
        self._look.clear()
        self.phase, self._doubted_at, self._gave_up = DOUBTING, self._row_t, False

    @property
    def tracked(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi (10,) and covariance while samples are looked at: of all that may have happened."""
        modes = self._modes
        assert modes is not None
        (x, spread), p = modes.shift, modes.handing + modes.other
        last = self.run.last
        late = p * (x - modes.lately)
        return last.phi + p * x, last.covariance + p * spread + p * (1.0 - p) * np.outer(x, x) + np.outer(late, late)

    # ------------------------------------------------------------------ a change, and the run after it

    def _begin_change(self, sample: Sample, held: bool) -> None:
        """A change: the next run is made beside the stream while the transient lasts."""
        assert self._modes is not None
        run = self.run
        passing = self._judging and run.stream.seconds < PASSING
        self.event = Event("change", sample.t, self._steady_t, float(self._modes.shift[0][0]))
        self._held_before, self._judging = held, False
        state = run.stream.state
        assert state is not None
        following = self._beside(self._made, run, self._runs.reference_for_next(held))
        self._change, self.phase = _Change(sample.t, self._steady_t, passing, state, following), SETTLING

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
            self.event = replace(self.event, kind=kind or ("grasp" if self.event.mass > 0 else "change"))

    def _watch_anew(self, dropped: PosteriorLeastSquares | None) -> None:
        """Begin to watch the current run; one that is not wanted any more has its thread stopped."""
        if self._modes is not None:
            self._modes.reset()
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
