"""One run for each payload: a change begins a new run, its transient kept out, and an old one may be taken up again.

    … run A (empty) ──change──▶ hand-over left out ──▶ run B (tare: A) ──change──▶ … ──▶ run C, or A again if it fits

The watch is in one of three phases, by what the last rows are (`weighing.py`):

    FOLLOWING   the run takes the sample;
                it is probably not steady → DOUBTING, the payload has surely changed or is changing → SETTLING
    DOUBTING    the sample is looked at, and the run does not take it;
                steady again, or not for too long → FOLLOWING, the payload has surely changed → SETTLING
    SETTLING    the sample is looked at with what the run before knows, the next run is made in the background
                and takes what may be of the new payload;
                that stays → FOLLOWING with the next run, it was none → DOUBTING with the old

After a change the new run is *judged* while it is followed (`event.py`): it says what the change was, once its mass is
known, and gives way to the earlier run if it holds what that one held. The run of the empty arm is a tare of the runs
after it, beside the one that was given, if one was. Of a run that ends the last rows are taken back: they show it.
"""

from __future__ import annotations

from dataclasses import replace

from armload.estimators import Estimate, Identifier
from armload.online.change import Change, next_run
from armload.online.event import Event, Naming
from armload.online.lasting import Lasting
from armload.online.runs import Runs
from armload.online.schedule import Deferred
from armload.online.thresholds import LIKELY, PATIENCE, SURE, TAKEN_BACK, UNLIKELY
from armload.online.tracking import Tracker
from armload.online.weighing import Weighing
from armload.posterior import PosteriorLeastSquares
from armload.posterior.worker import Worker
from armload.recording import Sample


class PayloadWatch:
    """The runs of a stream, and the phase it is in.

    Args:
        first: the identifier of the first run.

    Attributes:
        runs: those that are kept. answered: the run that the last estimate is of. mixed: whether an interval of the run
            alone would leave out more than its 5 %, as the payload may have changed. called_off: whether the last
            change that settled was none.
    """

    def __init__(self, first: PosteriorLeastSquares) -> None:
        self.runs = Runs(first)
        self._look = Deferred()
        self._background = Worker()
        self._weighing = Weighing(first)
        self._change: Change | None = None  # settling
        self.reset()

    def reset(self) -> None:
        """Forget the stream; the next sample is the first."""
        self._background.wait()
        if self._change is not None:
            self._change.run.close()
        self.runs.reset()
        self._look.reset()
        self.answered, self.mixed = self.run, False
        self._naming, self._tracker = Naming(), Tracker()
        self._weighing.reset(self.run)
        self._doubted_at: float | None = None  # doubting, since then [s]
        self._gave_up = False  # following: what does not fit is believed until it fits again
        self._change, self.called_off = None, False

    @property
    def run(self) -> PosteriorLeastSquares:
        """The identifier of the current run."""
        return self.runs.current

    @property
    def event(self) -> Event | None:
        """The last change noticed."""
        return self._naming.event

    @property
    def settling(self) -> bool:
        """Whether samples are left out because the payload has just changed."""
        return self._change is not None

    @property
    def _following(self) -> bool:
        return self._change is None and self._doubted_at is None

    @property
    def undecided(self) -> bool:
        """Whether the last rows are likelier of another payload than of the run's, and no run has them yet."""
        return self.settling or self.lifted or (self._doubted_at is not None and self.likely[0] > 0.5)

    @property
    def likely(self) -> tuple[float, float, float]:
        """Probabilities that the payload is not what the run holds, or changes; of a contact; of a drift of the arm."""
        modes, lasting = self._weighing.modes, self._tracker.lasting
        goes_on = 0.0 if lasting is None else lasting.goes_on
        return modes.handing + modes.other + modes.steady * goes_on, modes.contact, modes.drift

    @property
    def sure(self) -> bool:
        """Whether nothing but the arm as it was and the same payload explains the last rows."""
        return self._following and sum(self.likely) < 1.0 - LIKELY

    @property
    def lifted(self) -> bool:
        """Whether the last rows are of an arm that is lifted, or that has lost what was on it from the start."""
        return self._weighing.modes.taken_off > 0.0

    @property
    def blind(self) -> bool:
        """Whether a change of payload would not show yet (`Weighing.blind`)."""
        return self._weighing.blind

    def track(self, t: float) -> Estimate:
        """At t [s], by the run and by all that the last rows may be besides."""
        last = self.run.last
        phi, covariance = self._tracker.track(self._weighing.modes, self._weighing.row_t, (last.phi, last.covariance))
        return replace(last, t=t, phi=phi, covariance=covariance)

    def update(self, sample: Sample, held: bool, by: Identifier | None) -> Estimate | None:
        """Take one sample; None while it does not count.

        held: whether anything was, by the last estimate. by: the run that this was of; None: of none alone.
        """
        if self._change is not None:
            self._settle(self._change, sample)
            return None
        if self._doubted_at is not None:
            if self._weighing.passed_over(sample, self.run, self.run.stream.state):
                self._decide(sample, held)
            return None
        if self._look.due(sample.t):
            self._examine(sample, held)
            if not self._following:
                return None
        return self._follow(sample, held, by)

    def conclude(self) -> Estimate:
        """The estimate of the current run after a last solution, and of a hand-over that may go on in it."""
        self.hold()
        self.answered = self.run
        last = self.run.conclude()
        phi, covariance = self._tracker.of_now((last.phi, last.covariance))
        return replace(last, phi=phi, covariance=covariance)

    # ------------------------------------------------------------------ following

    def _follow(self, sample: Sample, held: bool, by: Identifier | None) -> Estimate:
        run = self.answered = self.runs.current
        before, estimate = run.stream.rows, run.update(sample)
        if run.stream.rows > before and self._look.row(sample.t):
            self._examine(sample, held)
        self._look.seen(sample.t)
        if run.fresh and self._weighing.steady > LIKELY:
            self.runs.note_steady()
        if run.fresh and self._naming.judging and self._naming.judge(self.runs, held if by is run else None):
            self._watch_anew(self.runs.go_back())
        return estimate

    def _examine(self, sample: Sample, held: bool) -> None:
        """Look at the innovations of the last row, which the run has taken."""
        self._look.clear()
        self._tracker.row(self.runs.current, self._weighing.modes.level)
        if self._weighing.taken(self.runs.current):
            self._decide(sample, held)
            changed = self._weighing.modes.handing + self._weighing.modes.other > UNLIKELY
            self.mixed = self._following and (changed or self._tracker.lasting is not None)

    # ------------------------------------------------------------------ doubting

    def _decide(self, sample: Sample, held: bool) -> None:
        """What becomes of the run, by what the last rows are."""
        if self._following:
            self._naming.held_before = held
        if self._weighing.changed():
            self._begin_change(sample)
        elif self._weighing.steady > 0.5:
            self._doubted_at, self._gave_up = None, False
        elif self._doubted_at is None:
            self._doubted_at = None if self._gave_up else sample.t
        elif self._weighing.believed(sample.t - self._doubted_at):
            self._doubted_at, self._gave_up = None, True

    # ------------------------------------------------------------------ a change, and the run after it

    def _begin_change(self, sample: Sample) -> None:
        """A change: the next run is made in the background while it settles."""
        run, state = self.run, self.run.stream.state
        assert state is not None
        began = max(self._weighing.steady_t, sample.t - PATIENCE)
        until = began - max(sample.t - began, TAKEN_BACK)
        shift = self._weighing.modes.shift()[0]
        step, corrects = float(shift[0]) / self.runs.unit, self._naming.corrects_the_recognition
        self._naming.begin(sample.t, began, run, self._tracker.rest(shift) or corrects(sample.t, step))
        next_about = run, self.runs.reference_for_next(), until, self._weighing.sticks
        following = self._background.submit(next_run, *next_about)
        self._change, self._doubted_at, self.called_off = Change(sample.t, began, state, following), None, False

    def _settle(self, change: Change, sample: Sample) -> None:
        """A sample while the payload may go on changing; then the next run begins, or the run before goes on."""
        modes, stays = self._weighing.modes, False
        if self._weighing.passed_over(sample, self.run, change.state):
            if modes.steady + modes.contact > SURE:
                self._call_off(change)
                return
            change.looked(sample.t, modes, self._weighing.row_t)
            stays = modes.other > LIKELY and change.stays(modes, self._weighing.row_t)
        change.take(sample, modes.level)
        if stays or sample.t - change.t > PATIENCE:
            self._take_up_the_next(change)

    def _call_off(self, change: Change) -> None:
        """The payload is what it was: the run before goes on."""
        self._background.submit(change.run.close)
        self._naming.call_off(self.runs)
        self._change, self._doubted_at, self._gave_up, self.called_off = None, change.t, False, True

    def _take_up_the_next(self, change: Change) -> None:
        """The payload stays: the next run begins."""
        self.hold()
        self._change = None
        self._watch_anew(self.runs.follow(change.run), change.ended(self._weighing.modes))
        self._naming.judging = True

    def _watch_anew(self, dropped: PosteriorLeastSquares | None, lasting: Lasting | None = None) -> None:
        """Begin to watch the current run; one that is not wanted any more has its thread stopped."""
        self._weighing.begin_run()
        self._look.clear()
        self._doubted_at, self._gave_up, self.mixed = None, False, lasting is not None
        self._tracker.lasting = lasting
        if dropped is not None:
            self._background.submit(dropped.close)

    def hold(self) -> None:
        """Wait for what is done in the background."""
        self._background.wait()
        for run in self.all_runs:
            run.stream.hold()

    def close(self) -> None:
        """Stop what runs in the background."""
        self.hold()
        for run in self.all_runs:
            run.close()
        self._background.stop()

    @property
    def all_runs(self) -> list[PosteriorLeastSquares]:
        """The runs that are kept, and the run after a change, waited for."""
        return [*self.runs, *([] if self._change is None else [self._change.run])]
