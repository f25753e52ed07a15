"""From a source to the newest state: the loop that identifies, and what others may ask of it meanwhile.

The loop runs in one thread and never waits. Other threads read the newest estimate, or leave an order, which is carried
out between two samples.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue

import numpy as np

from armload.arms import Arm
from armload.devices import Recorder, Source, Steadied
from armload.errors import SourceError
from armload.inertia import Z95, InertialParameters
from armload.online import OnlineEstimate, OnlineIdentifier
from armload.posterior import Known, Profile
from armload.posterior.map import PUBLISH
from armload.recording import Recording, Sample, Turns
from armload.service.history import History
from armload.service.plausible import Plausibility
from armload.service.recent import Recent
from armload.service.session_log import SessionLog
from armload.service.tare import Tare, tare_log

_KEPT = 0.1  # [s] between two estimates of a record: as often as lines come
TICK = 0.1  # [s] between two looks at a silent source: as often as lines come


class Session:
    """A source and the identifier it feeds.

    >>> from armload.arms import arm
    >>> from armload.devices import open_source
    >>> panda = arm("panda")
    >>> session = Session(open_source("sim", panda, speed=None, duration=0.5), panda, method="map")
    >>> session.run()
    >>> session.estimate.n_samples > 400, session.estimate.method, session.log[-1].text
    (True, 'map', 'the source has ended')

    Args:
        source: closed with the session.
        arm: the bare arm, or with a tool that is known. tare: an earlier log of it. method, profile, known, every,
            tare_age: see `OnlineIdentifier`. identifier: one that goes on, made with these.
        warn: called with each warning on the stream, also with the error it ended with in a thread (`start`).
        recorder: keeps every sample that was taken and what was said of it; closed with the session.

    Attributes:
        identifier: at work; only the thread that runs the loop may save it or learn from it.
        sample: the newest that could be used. estimate: the newest. None before the first.
        history: rows (30,) of phi, half-widths of the 95 % intervals and the truth, NaN where it is not known.
        log: what happened, the last 200 entries.
        tare: what answers are relative to; None: the arm as it was given.
        ended: the source has ended. error: what it ended with, if that was one.

    Raises:
        ArmloadError: an unknown method, a model of another arm, or a tare of another arm.
    """

    def __init__(
        self,
        source: Source,
        arm: Arm,
        tare: Recording | None = None,
        method: str | Path | None = None,
        warn: Callable[[str], None] | None = None,
        profile: Profile | None = None,
        identifier: OnlineIdentifier | None = None,
        known: Known | None = None,
        every: float = PUBLISH,
        recorder: Recorder | None = None,
        tare_age: float = 0.0,
    ) -> None:
        self.source, self.arm, self.profile = source, arm, profile
        self.tare = None if tare is None else Tare(tare, tare_age)
        self._known, self._every = known, every
        self._recorder, self._kept = recorder, -math.inf  # and when it last kept an estimate, on the stream's clock
        self._ordered: tuple[Tare | None, str | Path | None] = self.tare, method  # last; perhaps not at work yet
        self.identifier = self._made(self.tare, method) if identifier is None else identifier
        self.sample: Sample | None = None
        self.estimate: OnlineEstimate | None = None
        self._answered: OnlineEstimate | None = None  # the same when its sample had just arrived
        self.history = History(30)
        self.log = SessionLog(warn, self._recorded)
        self.ended = False
        self.error: Exception | None = None
        self._orders: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._recent = Recent(arm.n)
        self._plausibility = Plausibility(arm, source.name, isinstance(source, Steadied), profile is not None)
        self._said: tuple[str, ...] = ()  # what the source notes, and has been said
        self._thread: threading.Thread | None = None
        self._stop = False

    @property
    def doubt(self) -> str | None:
        """Why the samples cannot come from this arm; None: nothing says so."""
        return self._plausibility.doubt

    @property
    def lost(self) -> int:
        """Samples the source had to drop because the identifier was too slow."""
        return int(getattr(self.source, "lost", 0))

    def as_of_now(self) -> OnlineEstimate | None:
        """The newest estimate, as old as it is now, whatever the loop waits for."""
        return None if self._answered is None else self._answered.behind(self.source.lag())

    # ------------------------------------------------------------------ the loop

    def estimates(self, duration: float | None = None) -> Iterator[OnlineEstimate]:
        """One estimate per sample, until the source ends or has given `duration` [s].

        While none comes, the last one every `TICK` seconds, older each time, where the source can tell.

        Raises:
            SourceError: the connection was lost.
        """
        first: float | None = None
        for sample in self.source.ticking(TICK):
            while not self._orders.empty():
                self._orders.get()()
            if sample is None:
                self.estimate = self.as_of_now()
                if self.estimate is not None:
                    yield self.estimate
                if self._stop:
                    break
                continue
            yield self._take(sample)
            if first is None and math.isfinite(sample.t):
                first = sample.t
            if self._stop or (duration is not None and first is not None and sample.t - first >= duration):
                break
        if self._plausibility.look_at_last(self._recent):
            self._doubted()
        self._advise()
        if self.estimate is not None:
            self._answered = self._plausibility.qualified(self.identifier.conclude())
            self.estimate = self._answered.behind(self.source.lag())
            self._keep(self.estimate, True)
        self._write("the source has ended")
        self.ended = True

    def run(self, duration: float | None = None) -> None:
        """The same to the end, for those who look at the newest estimate."""
        for _ in self.estimates(duration):
            pass

    def start(self, duration: float | None = None) -> None:
        """The same in a thread of its own; an error is kept in `error` and in the log."""

        def loop() -> None:
            try:
                self.run(duration)
            except Exception as error:
                self.error, self.ended = error, True
                self._warn(str(error))

        self._thread = threading.Thread(target=loop, name="armload-session", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the loop and close source and identifier."""
        self._stop = True
        self.source.close()
        if self._thread is not None:
            self._thread.join(5.0)
        self.identifier.close()
        if self._recorder is not None:
            self._recorder.close()

    def _take(self, sample: Sample) -> OnlineEstimate:
        if self.source.notes != self._said:
            self._said = self.source.notes
            for note in self._said:
                self._warn(note)
        came = self.source.as_it_came(sample)
        if self._recorder is not None:
            self._recorder.append(came)
        before, used = self.estimate, self.identifier.health.used
        estimate = self.identifier.update(*sample)
        event = estimate.event
        changed = event is not None and (before is None or event != before.event)
        if event is not None and changed and self.log.write_event(event):
            self._recent.clear()
            self._plausibility.forget()
        usable = estimate.health.used > used
        if usable:
            self._recent.append(came)
            if self._plausibility.look(came, estimate.health, self._recent):
                self._doubted()
            self._advise()
        self._answered = self._plausibility.qualified(estimate)
        estimate = self._answered.behind(self.source.lag())
        self.sample, self.estimate = sample if usable else self.sample, estimate
        self._keep(estimate, changed)
        self.log.report_trouble(estimate.t, self.identifier.trouble)
        if usable and self.history.due(estimate.t):
            truth = self.truth(estimate.t)
            known = np.full(10, np.nan) if truth is None else truth.phi
            self.history.append(estimate.t, np.concatenate([estimate.phi, Z95 * estimate.std, known]))
        return estimate

    def _keep(self, estimate: OnlineEstimate, at_once: bool) -> None:
        if self._recorder is not None and (at_once or abs(estimate.t - self._kept) >= 0.999 * _KEPT):
            self._recorder.keep(estimate)
            self._kept = estimate.t

    def _recorded(self, text: str, warning: bool) -> None:
        if self._recorder is not None and self.error is None:  # the error may be that nothing more can be written
            self._recorder.say(text, warning)

    def _doubted(self) -> None:
        doubt = self._plausibility.doubt
        self._write("the samples are plausible now") if doubt is None else self._warn(doubt)

    def _advise(self) -> None:
        advice = self._plausibility.advice()
        if advice is not None:
            self._warn(advice)

    def truth(self, t: float) -> InertialParameters | None:
        """What was added since the tare, or is held at all, at time t [s]; None where the source does not know."""
        held, before = self.source.truth(t), InertialParameters.zero(self.arm.frame)
        if self.tare is not None:
            before = self.tare.held
        return None if held is None or before is None else held - before

    # ------------------------------------------------------------------ orders, from any thread

    def use(self, method: str | Path) -> None:
        """Go on with another method, from nothing.

        Raises:
            ArmloadError: the method cannot be used here; the present one goes on.
        """
        self._exchange(self._ordered[0], method, f"method {method}")

    def reset(self) -> None:
        """Forget the stream so far; the next sample is the first."""
        self._running()

        def order() -> None:
            self.identifier.reset()
            self._recent.clear()
            self._plausibility.reset()
            self._write("started anew")

        self._orders.put(order)

    def take_tare(self) -> None:
        """What is held now counts as nothing: the last half minute becomes the tare.

        Raises:
            ArmloadError: the payload is changing, something touches the arm, too little was seen since the payload last
                changed, or the method can use no tare.
        """
        self._running()
        log = Turns(self.arm).of(tare_log(self._recent, self.estimate))
        tare = Tare(log, held=self.source.truth(float(log.t[-1])), taken=True)
        self._exchange(tare, self._ordered[1], f"tared with the last {log.duration:.0f} s")

    def _exchange(self, tare: Tare | None, method: str | Path | None, text: str) -> None:
        self._running()
        identifier = self._made(tare, method)
        self._ordered = tare, method

        def order() -> None:
            self.identifier.close()
            self.identifier, self.tare = identifier, tare
            self._recent.clear()
            self._plausibility.forget()
            self._write(text)

        self._orders.put(order)

    def _running(self) -> None:
        if self.ended:
            raise SourceError(f"{self.source.name} has ended: open it again")

    def _made(self, tare: Tare | None, method: str | Path | None) -> OnlineIdentifier:
        log, age = (None, 0.0) if tare is None else (self.source.as_handed_on(tare.recording), tare.age_now)
        return OnlineIdentifier(self.arm, log, method, self.profile, self._known, self._every, age)

    def _write(self, text: str) -> None:
        self.log.write(self._t, text)

    def _warn(self, text: str) -> None:
        self.log.warn(self._t, text)

    @property
    def _t(self) -> float:
        return 0.0 if self.estimate is None else self.estimate.t
