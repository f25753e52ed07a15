"""One run for each payload: a change begins a new run, its transient kept out, and an old one may be taken up again.

    … run A (empty) ──change──▶ 0.2 s left out ──▶ run B (tare: A) ──change──▶ 0.2 s ──▶ run C, or A again if it fits

The run of the empty arm is a tare of the runs after it, beside the one that was given, if one was: what was just
grasped is then found as well as with a tare at that place. A push that ends brings back the run before it, once the new
run is sure that it is the same. Rows that do not fit are left out until it is clear whether the payload has changed, or
whatever it was is over; of a run that ends, the last ones are taken back: a change is there before it is noticed.

Of a fast stream, the row, the answer and the suspicion fall on three samples, one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from armload.estimators import Estimate
from armload.online.changes import LONGEST, ChangeDetector, Suspicion, foresee
from armload.online.event import Event
from armload.posterior import StreamingIdentifier
from armload.posterior.live import FAST
from armload.posterior.stream import Worker
from armload.recording import Sample
from armload.regression import payload_prior_std
from armload.regression.rows import REGRESSOR_RATE

_FIRST = (0.5, 2.0)  # [s] of a run before which nothing is suspected, with a tare and without
_TRANSIENT = 0.2  # [s] left out after a change: four times the lag of the regression
_PASSING = 3.0  # [s] of a run not told yet, below which it may have been a push: the run before it may come back
_MOST_SHORT = 4  # of those in a row
_JUDGED = (0.25, 1.5, 6.0)  # [s] of a new run: kinds are told from, at the latest; an old run comes back until
_KNOWN, _SURE = 0.033, 0.01  # standard deviation of the mass, in a payload's own, for a kind and for an old run
_SAME = float(chi2.ppf(0.9, 4))  # of mass and first moments against an earlier run's
_DECIDED = 0.6  # [s] of rows that do not fit, in which a change shows
_AGAIN = 0.05  # [s] of such rows shortly after a change, after which it may be over: a push has ended,
_BACK = 6.0  # if ln of the likelihood ratio of what was held before, over what is held now, is above this
_LEARNT, _PATIENCE = 10.0, 4.0  # [s] of a run that knows its arm; what it leaves out at most, others leave _DECIDED out
_REFERENCE = 3.0  # [s] an empty run must have lasted to be a tare
_ROW = 0.9 / REGRESSOR_RATE  # [s] between rows


class PayloadWatch:
    """The runs of a stream.

    Args:
        first: the identifier of the first run.

    Attributes:
        run: the identifier of the current run; answered: of the run the last estimate is of. event: the last change
            noticed. settling: whether its transient lasts.
    """

    def __init__(self, first: StreamingIdentifier) -> None:
        self.run, self.answered, self._first = first, first, first
        self._worker: Worker | None = None
        self._dropped: Future[None] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the stream; the next sample is the first."""
        if self._dropped is not None:
            self._dropped.result()
            self._dropped = None
        for run in (self.run, getattr(self, "_previous", None), getattr(self, "_earlier", None)):
            if run is not None:
                run.close()
        self.run = self._first
        self.run.reset()
        self._previous: StreamingIdentifier | None = None  # the run before this one
        self._earlier: StreamingIdentifier | None = None  # the one before that: what may come back
        self._detector: ChangeDetector | None = None
        self._next: Future[StreamingIdentifier] | None = None
        self._ready: StreamingIdentifier | None = None
        self._until = -np.inf
        self._unresolved = False
        self._held_before = False
        self._last_t = self._row_t = -np.inf
        self._waited: int | None = None  # samples since a row that is not looked at yet
        self._aside = np.inf  # since when rows are not believed
        self._enough = False  # whether they were left out for long enough
        self._passing = False  # whether the run that ends was so short that it was no payload's
        self._short = 0  # such runs in a row
        self.event: Event | None = None

    @property
    def settling(self) -> bool:
        """Whether samples are left out because the payload has just changed."""
        return self._next is not None or self._ready is not None

    @property
    def doubting(self) -> bool:
        """Whether samples are left out because they do not fit: a push, or a change not yet sure."""
        return self._aside < np.inf

    def update(self, sample: Sample, held: bool) -> Estimate | None:
        """Take one sample; None while a change settles. `held`: whether anything was, by the last estimate."""
        if self.settling:
            if sample.t < self._until:
                return None
            self.hold()
            assert self._ready is not None
            if self._passing:
                dropped, self._earlier = self.run, self._previous
            else:
                dropped, self._earlier, self._previous = self._earlier, self._previous, self.run
            self.run, self._ready, self._unresolved = self._ready, None, True
            self._take_up(dropped)
        if self._aside < np.inf:
            self._look_on(sample, held)
            return None
        if self._waited is not None:
            self._waited += 1
            if self._waited == 2 or sample.t - self._row_t >= _ROW:
                self._suspect(sample, held)
                if self.settling or self._aside < np.inf:
                    return None
        slow, self._last_t = sample.t - self._last_t > FAST, sample.t
        before = 0 if self.run.stream is None else self.run.stream.rows
        self.answered = self.run
        estimate = self.run.update(sample)
        stream = self.run.stream
        if stream is not None and stream.rows > before:
            self._row_t, self._waited = sample.t, 0
            if slow:
                self._suspect(sample, held)
        if self._unresolved and self.run.fresh:
            self._resolve(estimate, held)
        return estimate

    def _take_up(self, dropped: StreamingIdentifier | None) -> None:
        """Begin to watch the run; one that is not wanted any more has its thread stopped."""
        if self._detector is not None:
            self._detector.reset()
        self._waited, self._aside, self._enough = None, np.inf, False
        if dropped is not None and all(run is not dropped for run in (self.run, self._previous, self._earlier)):
            self._dropped = self._beside(dropped.close)

    def _beside(self, task: Callable, *arguments: Any) -> Future:
        """Have something done by the watch's own thread."""
        if self._worker is None:
            self._worker = Worker()
        return self._worker.submit(task, *arguments)

    def _suspect(self, sample: Sample, held: bool) -> None:
        """Look at the last row."""
        self._waited = None
        stream = self.run.stream
        assert stream is not None
        state, row = stream.state, stream.row
        if state is None or row is None or row.h <= 0.0:
            return
        if self._detector is None:
            self._detector = ChangeDetector(float(payload_prior_std(self.run.arm)[0]), stream.correction.effort)
            foresee(state, row)  # loaded now, not in the middle of a change
        found = self._detector.take(row.h, state.seen, row.X, state.scale, *self._mean)
        self._mean = stream.answer()
        if stream.seconds <= _FIRST[not stream.tares]:
            return
        self._enough = self._enough and self._detector.uneasy
        if found is not None:
            self._begin(sample, found, held)
        elif self._detector.uneasy and not self._enough:
            self._aside = sample.t

    def _look_on(self, sample: Sample, held: bool) -> None:
        """Look at a sample that the run is not told: something may be pulling at the arm, or the payload changing."""
        stream, detector = self.run.stream, self._detector
        assert stream is not None
        assert stream.state is not None
        assert detector is not None
        row = stream.look(*sample)
        if row is None or row.h <= 0.0:
            return
        seen, scale = foresee(stream.state, row)
        found = detector.take(row.h, seen, row.X, scale, *self._mean)
        since = sample.t - self._aside
        sure = bool(stream.tares) or stream.seconds > _LEARNT
        if found is not None and since < _DECIDED:
            self._begin(sample, found, held)
        elif self._unresolved and self._short < _MOST_SHORT and since > _AGAIN and self._back():
            self._begin(sample, detector.last, held)
        self._enough = since > (_PATIENCE if sure else _DECIDED)
        if self.settling or self._enough or not detector.uneasy:
            self._aside = np.inf

    def _back(self) -> bool:
        """Whether what was held before the last change explains the last rows better than what is held now."""
        before = self._before_that(self._previous)
        assert self._detector is not None
        return before is not None and self._detector.ratio(before[0] - self._mean[0]) > _BACK

    @property
    def _mean(self) -> tuple[NDArray, NDArray]:
        """phi and covariance before the row, under the weak prior."""
        found = getattr(self, "_gaussian", None)
        if found is None or found[0] is not self.run:
            std = payload_prior_std(self.run.arm)
            return np.zeros(10), np.diag(std**2)
        return found[1]

    @_mean.setter
    def _mean(self, value: tuple[NDArray, NDArray]) -> None:
        self._gaussian = (self.run, value)

    def _begin(self, sample: Sample, found: Suspicion, held: bool) -> None:
        """A change: the next run is made beside the stream while the transient lasts."""
        assert self._detector is not None
        mass = float(found.delta[0])
        self.event = Event("change", sample.t, sample.t - self._detector.seconds(found.rows), mass)
        run = self.run
        self._passing = self._unresolved and run.stream is not None and run.stream.seconds < _PASSING
        self._short = self._short + 1 if self._passing else 0
        self._held_before, self._unresolved = held, False
        self._until = sample.t + _TRANSIENT
        reference = run.reference
        if reference is None and not held and run.stream is not None and run.stream.seconds >= _REFERENCE:
            reference = run
        self._next = self._beside(self._prepared, run, reference)

    @staticmethod
    def _prepared(run: StreamingIdentifier, reference: StreamingIdentifier | None) -> StreamingIdentifier:
        if run.stream is not None:
            run.stream.finish(taken_back=LONGEST)
        following = run.beside(reference)
        following.prepare()
        return following

    def _resolve(self, estimate: Estimate, held: bool) -> None:
        """Say what the change was once the new run can tell, and take up an old run that fits."""
        assert self.run.stream is not None
        assert self.event is not None
        seconds, std = self.run.stream.seconds, float(estimate.std[0] / payload_prior_std(self.run.arm)[0])
        if seconds < _JUDGED[0]:
            return
        self._unresolved = seconds <= _JUDGED[2]
        if std <= _SURE and self._earlier is not None and self._fits(estimate, self._earlier):
            dropped, self.run, self._earlier = self.run, self._earlier, None
            self._unresolved = False
            self._take_up(dropped)
            self.event = replace(self.event, kind="return")
        elif self.event.kind == "change" and (std <= _KNOWN or seconds > _JUDGED[1]):
            known = {(False, True): "grasp", (True, False): "release", (True, True): "swap"}
            kind = known.get((self._held_before, held))
            self.event = replace(self.event, kind=kind or ("grasp" if self.event.mass > 0 else "release"))

    def _fits(self, estimate: Estimate, earlier: StreamingIdentifier) -> bool:
        """Whether a new run's mass and first moments are an earlier run's."""
        last = self._before_that(earlier)
        if last is None:
            return False
        phi, covariance = (estimate.phi - last[0])[:4], (estimate.covariance + last[1])[:4, :4]
        return bool(phi @ np.linalg.solve(covariance, phi) < _SAME)

    def _before_that(self, earlier: StreamingIdentifier | None) -> tuple[NDArray, NDArray] | None:
        """phi (10,) and covariance of an earlier run, relative to what the current one is relative to, if it can be."""
        if earlier is None:
            return None
        if self.run.reference is earlier:
            return np.zeros(10), np.zeros((10, 10))
        if self.run.reference is not earlier.reference:
            return None
        return earlier.last.phi, earlier.last.covariance

    @property
    def runs(self) -> list[StreamingIdentifier]:
        """All runs that are kept."""
        kept = (self._first, self.run, self._previous, self._earlier, self._ready)
        return list({id(run): run for run in kept if run is not None}.values())

    def hold(self) -> None:
        """Wait for what is done beside."""
        if self._dropped is not None:
            self._dropped.result()
            self._dropped = None
        if self._next is not None:
            self._ready, self._next = self._next.result(), None
        for run in self.runs:
            if run.stream is not None:
                run.stream.hold()

    def close(self) -> None:
        """Stop what runs beside."""
        self.hold()
        for run in self.runs:
            run.close()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
