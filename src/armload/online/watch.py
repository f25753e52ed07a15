"""One run for each payload: a change begins a new run, its transient kept out, and an old one may be taken up again.

    … run A (empty) ──change──▶ hand-over left out ──▶ run B (tare: A) ──change──▶ … ──▶ run C, or A again if it fits

The watch is in one of three phases, by what the last rows are (`modes.py`):

    FOLLOWING   the run takes the sample;
                it is probably not steady → DOUBTING, the payload has surely changed or is changing → SETTLING
    DOUBTING    the sample is looked at, and the run does not take it;
                steady again, or not for too long → FOLLOWING, the payload has surely changed → SETTLING
    SETTLING    the sample is looked at with what the run before knows, the next run is made in the background
                and takes what may be of the new payload;
                that stays → FOLLOWING with the next run, it was none → DOUBTING with the old

After a change the new run is *judged* while it is followed: it says what the change was, once its mass is known, and
gives way to the earlier run if it holds what that one held. The run of the empty arm is a tare of the runs after it,
beside the one that was given, if one was. Of a run that ends the last rows are taken back: they show it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from armload.estimators import Estimate
from armload.online.background import Background
from armload.online.change import Change, next_run
from armload.online.detector import ChangeDetector
from armload.online.event import Event, kind_of
from armload.online.lasting import Lasting
from armload.online.modes import Modes
from armload.online.runs import Gaussian, Runs
from armload.online.schedule import Deferred
from armload.online.thresholds import (
    FIRST_TARED,
    FIRST_UNTARED,
    KIND_FROM,
    KIND_LATEST,
    KIND_STD,
    LIKELY,
    PATIENCE,
    RETURN_STD,
    RETURN_UNTIL,
    SURE,
    TAKEN_BACK,
    UNLIKELY,
)
from armload.online.tracking import Tracker
from armload.posterior import PosteriorLeastSquares
from armload.posterior.sequential import SequentialPosterior
from armload.recording import GAP, Sample
from armload.regression import payload_prior_std
from armload.regression.rows import Row

Phase = Literal["following", "doubting", "settling"]
FOLLOWING: Phase = "following"
DOUBTING: Phase = "doubting"
SETTLING: Phase = "settling"


class PayloadWatch:
    """The runs of a stream, and the phase it is in.

    Args:
        first: the identifier of the first run.

    Attributes:
        runs: those that are kept. phase: what becomes of samples at present. answered: the run that the last estimate
            is of. event: the last change noticed. mixed: whether an interval of the run alone would leave out more than
            its 5 %, as the payload may have changed.
    """

    def __init__(self, first: PosteriorLeastSquares) -> None:
        self.runs = Runs(first)
        self._unit = float(payload_prior_std(first.arm)[0])
        self._look = Deferred()
        self._background = Background()
        self.reset()

    def reset(self) -> None:
        """Forget the stream; the next sample is the first."""
        self._background.wait()
        self.runs.reset()
        self._look.reset()
        self.phase: Phase = FOLLOWING
        self.answered, self.mixed = self.run, False
        self.event: Event | None = None
        self._modes = Modes(self._unit, self.run.stream.correction.effort)
        self._gaussian: tuple[PosteriorLeastSquares, Gaussian] | None = None  # before the row, and of which run
        self._detector, self._tracker = ChangeDetector(self._unit), Tracker()
        self._row_t = self._doubted_at = -np.inf  # of the last row, of the doubt
        self._gave_up = False  # doubting: what does not fit is believed until it fits again
        self._change: Change | None = None
        self._judging = self._unnamed = False  # whether the run is new, and may give way; whether its kind is not known
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
    def likely(self) -> tuple[float, float, float]:
        """Probabilities that the payload is not what the run holds, or changes; of a contact; of a drift of the arm."""
        changed = self._modes.handing + self._modes.other + self._modes.steady * self._tracker.goes_on
        return changed, self._modes.contact, self._modes.drift

    @property
    def sure(self) -> bool:
        """Whether nothing but the arm as it was and the same payload explains the last rows."""
        return self.phase == FOLLOWING and sum(self.likely) < 1.0 - LIKELY

    def track(self, t: float) -> Estimate:
        """At t [s], by the run and by all that the last rows may be besides."""
        last = self.run.last
        phi, covariance = self._tracker.track(self._modes, self._row_t, (last.phi, last.covariance))
        return replace(last, t=t, phi=phi, covariance=covariance)

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
        return self._follow(sample, held) if self.phase == FOLLOWING else None

    def conclude(self) -> Estimate:
        """The estimate of the current run after a last solution."""
        self.hold()
        self.answered = run = self.run
        return run.conclude()

    # ------------------------------------------------------------------ following

    def _follow(self, sample: Sample, held: bool) -> Estimate:
        self.answered = self.run
        before, estimate = self.run.stream.rows, self.run.update(sample)
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
        if (state := stream.state) is None or (row := stream.row) is None:
            return
        self._modes.side = stream.posterior.torque
        h, self._row_t = row.t - self._row_t, row.t
        known = stream.seconds > (FIRST_TARED if stream.tares else FIRST_UNTARED)
        self._tracker.row(self.run, self._modes.level)
        if row.h > 0.0:
            if known:
                self._modes.take(row.h, state.seen, row.X, state.scale, *self._before_row, True)
            self._gaussian = (self.run, stream.answer())
        elif known and 0.0 < h <= GAP and stream.posterior.torque == "link":  # at rest, where friction hides no load
            self._weigh(row, h, state)
        if known:
            self._decide(sample, held)
            changed = self._modes.handing + self._modes.other > UNLIKELY
            self.mixed = self.phase == FOLLOWING and (changed or self._tracker.lasting is not None)

    @property
    def _before_row(self) -> Gaussian:
        """phi and covariance before the row, under the weak prior."""
        if self._gaussian is not None and self._gaussian[0] is self.run:
            return self._gaussian[1]
        return np.zeros(10), np.diag(payload_prior_std(self.run.arm) ** 2)

    # ------------------------------------------------------------------ doubting

    def _looked(self, sample: Sample, state: SequentialPosterior | None) -> bool:
        """Look at a sample that the run does not take; whether it completed a row that says something."""
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
        """Weigh a row that the run did not take, for as long as it stands."""
        seen, scale = state.predict(row._replace(h=h))
        self._modes.take(h, seen, row.X, scale, *self._before_row, False)

    def _decide(self, sample: Sample, held: bool) -> None:
        """What becomes of the run, by what the last rows are."""
        if self._detector.take(self._modes, self._row_t, self._before_row):
            self._begin_change(sample, held)
        elif self._detector.steady(self._modes) > 0.5:
            self.phase, self._gave_up = FOLLOWING, False
        elif self.phase == DOUBTING and sample.t - self._doubted_at > PATIENCE:
            self.phase, self._gave_up = FOLLOWING, True
            self._detector.believe()
        elif self.phase == FOLLOWING and not self._gave_up:
            self.phase, self._doubted_at, self._held_before = DOUBTING, sample.t, held

    # ------------------------------------------------------------------ a change, and the run after it

    def _begin_change(self, sample: Sample, held: bool) -> None:
        """A change: the next run is made in the background while it settles."""
        run, state = self.run, self.run.stream.state
        assert state is not None
        if self.phase == FOLLOWING:
            self._held_before = held
        began = max(self._detector.steady_t, sample.t - PATIENCE)
        until = began - max(sample.t - began, TAKEN_BACK)
        self.event, self._judging, self._unnamed = Event("change", sample.t, began, None), False, True
        following = self._background.submit(next_run, run, self.runs.reference_for_next(self._held_before), until)
        self._change, self.phase = Change(sample.t, began, state, following), SETTLING

    def _settle(self, sample: Sample) -> None:
        """A sample while the payload may go on changing; then the next run begins, or the run before goes on."""
        change, modes = self._change, self._modes
        assert change is not None
        looked = self._looked(sample, change.state)
        if looked and modes.steady + modes.contact > SURE:
            self._call_off()
            return
        if looked:
            change.looked(sample.t, modes, self._row_t)
        change.take(sample, modes.level)
        if sample.t - change.t > PATIENCE or (looked and modes.other > LIKELY and change.stays(modes, self._row_t)):
            self._take_up_the_next()

    def _call_off(self) -> None:
        """The payload is what it was: the run before goes on."""
        assert self._change is not None
        assert self.event is not None
        change, self._change = self._change, None
        self._background.close_run(change.run)
        self.event = replace(self.event, kind="return", mass=0.0)
        self.phase, self._doubted_at, self._gave_up = DOUBTING, change.t, False

    def _take_up_the_next(self) -> None:
        """The payload stays: the next run begins."""
        self.hold()
        assert self._change is not None
        change, self._change = self._change, None
        self._watch_anew(self.runs.follow(change.run), change.ended(self._modes))
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
            self._unnamed = False
            self.event = replace(self.event, kind=kind_of(self._held_before, held))

    def _watch_anew(self, dropped: PosteriorLeastSquares | None, lasting: Lasting | None = None) -> None:
        """Begin to watch the current run; one that is not wanted any more has its thread stopped."""
        self._modes.reset()
        self._detector.begin_run()
        self._look.clear()
        self.phase, self._gave_up, self.mixed = FOLLOWING, False, lasting is not None
        self._tracker.lasting = lasting
        if dropped is not None:
            self._background.close_run(dropped)

    def hold(self) -> None:
        """Wait for what is done in the background."""
        self._background.wait()
        for run in self._all:
            run.stream.hold()

    def close(self) -> None:
        """Stop what runs in the background."""
        self.hold()
        for run in self._all:
            run.close()
        self._background.stop()

    @property
    def _all(self) -> list[PosteriorLeastSquares]:
        """The runs that are kept, and the run after a change, waited for."""
        return [*self.runs, *([] if self._change is None else [self._change.run])]
