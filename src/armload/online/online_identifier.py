"""The identifier that runs next to a robot for days: nothing it is fed makes it stop, every sample is answered."""

from __future__ import annotations

import math
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Self

from armload.arms import Arm
from armload.arms import arm as arm_named
from armload.errors import IdentificationError
from armload.estimators import Estimate, Identifier
from armload.identification.choice import choose
from armload.identification.known_payload import know
from armload.identification.tare_age import checked_age, drift_after
from armload.online.estimate import OnlineEstimate
from armload.online.event import Event
from armload.online.gate import Health, all_finite
from armload.online.judgement import Judgement
from armload.online.learning import Seen, learned_from
from armload.online.listening import Listening
from armload.online.state import load_state, save_state
from armload.online.thresholds import KIND_LATEST, SELDOM
from armload.online.watch import PayloadWatch
from armload.posterior import Known, PosteriorLeastSquares, Profile
from armload.posterior.map import PUBLISH
from armload.recording import Recording, Sample, read_recording

# what an `OnlineEstimate` has of the judgement under the same name
_JUDGED = ("determined", "held", "rests_on_prior", "torque_gain_std", "around", "before", "p_held")


class OnlineIdentifier:
    """Payload identification on a live stream, with any method.

    >>> identifier = OnlineIdentifier("panda")
    >>> estimate = identifier.update(0.0, [0, 0, 0, -1.5, 0, 1.5, 0], [0] * 7, [0, -24.9, 0, 22.4, 0, 2.5, 0])
    >>> estimate.held, estimate.moving, identifier.update(0.0, [0], None, "x").health.bad
    (False, False, 1)

    Args:
        arm: the bare arm (or with a tool that is known, `with_tool`), with the frame and gravity wanted; or as for
            `identify`.
        tare: an earlier log of the same arm, or its path, on any motion, with whatever was mounted then: estimates are
            of what was added since.
        method: a name of the catalogue, or a trained model's file; None: the most trustworthy for the arm.
        profile: what was learned of this arm from many logs; estimates are of what was added since.
        known: of a payload, apart from the stream; used while something is held and no sample contradicts (`notes`).
        every: [s] between two new answers of a payload whose run has begun 1.5 s ago, at most 0.1; changes are looked
            for in each row all the same.
        tare_age: [s]; offsets and friction may have changed since.

    Attributes:
        method: its name. event: the last change of payload that was noticed, on the stream's clock.

    Raises:
        ArmloadError: an unknown method, one that cannot use what is known, or a model or tare of another arm.
    """

    def __init__(
        self,
        arm: Arm | str | Path,
        tare: Recording | str | Path | None = None,
        method: str | Path | None = None,
        profile: Profile | None = None,
        known: Known | None = None,
        every: float = PUBLISH,
        tare_age: float = 0.0,
    ) -> None:
        self.arm = arm = arm if isinstance(arm, Arm) else arm_named(arm)
        tare = tare if tare is None or isinstance(tare, Recording) else read_recording(tare, arm)
        self.profile, self._tared = profile, tare is not None
        self._of_tare = None if profile is None or tare is None else profile.learned_from(tare)
        self._engine = first = choose(arm, tare, method, live=True, profile=profile).identifier
        know(first, known)
        if tare is not None and isinstance(first, PosteriorLeastSquares):
            first.allow_for(drift_after(checked_age(tare_age)))
        self._watch = PayloadWatch(first) if isinstance(first, PosteriorLeastSquares) else None
        self._every = min(max(every, PUBLISH), SELDOM)
        self.method = self.engine.name
        self._stream = Listening(arm)
        self._judgement = Judgement(arm, first.payload_prior, self._tared or profile is not None)
        self.reset()

    @property
    def engine(self) -> Identifier:
        """What identifies the current payload."""
        return self._engine if self._watch is None else self._watch.run

    @property
    def relative_to(self) -> str:
        """What the answer is relative to: the bare "arm", its "tool", the "tare", the "profile", or "before".

        That is the empty arm before the last change, taken for a tare.
        """
        if self._tared:
            return "tare"
        if getattr(self._judgement.run or self.engine, "reference", None) is not None:
            return "before"
        if self.profile is not None:
            return "profile"
        return "arm" if self.arm.attached is None else "tool"

    @property
    def arm_changed(self) -> str | None:
        """That the arm is not as at its tare or profile; None: it is, as far as anybody can tell."""
        return self._judgement.doubts.arm_changed

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against the error bars, but for what only the end shows."""
        return (*self._seen.doubt, *self._judgement.doubts.sentences)

    @property
    def health(self) -> Health:
        """Counts of the stream since `reset`."""
        return self._stream.gate.health

    @property
    def trouble(self) -> str | None:
        """What keeps the stream's samples from being used at present; `notes` says it too."""
        return self._stream.trouble

    def reset(self) -> None:
        """Forget the stream (not the tare); the next sample is the first."""
        (self._watch or self._engine).reset()
        self._stream.reset()
        self._published = -math.inf
        self._since: float | None = None
        self._since_before: float | None = None  # the same before the last change
        self._blind = False  # whether a change of payload would not be seen now
        self._seen = Seen(self._of_tare)
        self.event: Event | None = None
        self._event_t, self._event_shift = -math.inf, 0.0  # of the event on the samples' clock, and to the stream's [s]
        self._judgement.reset()

    def __getstate__(self) -> dict[str, Any]:
        """For a copy: nothing in the background changes while it is made."""
        if self._watch is not None:
            self._watch.hold()
        return vars(self)

    def __repr__(self) -> str:
        return f"<OnlineIdentifier {self.method} for {self.arm.name} about {self.arm.frame}>"

    def update(self, t: Any, q: Any, dq: Any, tau: Any) -> OnlineEstimate:
        """Take one sample and say what is known; a sample that cannot be right is counted and left out.

        Args:
            t: [s], on any clock. q, dq, tau: (n,) [rad, rad/s, N·m]; tau = rigid body + friction, gravity in it.
        """
        sample = self._stream.take(t, q, dq, tau)
        if sample is None:
            return self._present()
        self._since = self._stream.clock if self._since is None else self._since
        if self.profile is not None:
            self._seen.take(sample, self.profile)
        if self._watch is None:
            self._pass_on(sample)
        else:
            self._identify(sample, self._watch)
            self._blind = self._watch.blind
        return self._present()

    def conclude(self) -> OnlineEstimate:
        """A last solution from all samples of the current payload, as no more will come.

        It says what `armload.identify` says of a log of the same samples, if they show no change of payload.
        """
        if self._watch is not None and self._watch.undecided:
            return self._present()
        if self.health.used:
            self._blind = False
            estimate = (self._watch or self._engine).conclude()
            if all_finite(estimate.phi):
                if self._watch is not None:
                    self._judgement.doubts.look(self._watch.run, self.relative_to)
                estimate = self._judgement.allowing(estimate, self.engine, concluded=True)
                self._judge(estimate, self.engine)
                self._judgement.conclude(estimate, self.engine, self.relative_to, self._stream.now)
        return self._present()

    def learned(self, name: str = "stream", profile: Profile | None = None) -> Profile | None:
        """The profile with this stream as one more session (`learning.learned_from`); None: there is nothing to learn.

        Args:
            name: of the session. profile: to add to in the place of the stream's own, which has grown to it meanwhile.

        Raises:
            IdentificationError: there is no profile to learn for; and as `learning.learned_from`, as ModelError.
        """
        if self.profile is None or self._watch is None:
            raise IdentificationError("nothing is learned without a profile: make one with `armload profile`")
        self._watch.hold()
        runs = () if self._judgement.doubts.another else self._watch.runs
        return learned_from(self.profile, profile or self.profile, runs, name, tuple(self._seen.marks))

    def close(self) -> None:
        """Stop what runs beside; the identifier may go on."""
        if self._watch is not None:
            self._watch.close()

    def save(self, path: str | PathLike[str]) -> Path:
        """Write all there is to know to one .npz file; `restore` goes on from it exactly.

        Raises:
            IdentificationError: the method keeps something that cannot be written.
            OSError: it cannot be written there, or what is there is no regular file.
        """
        state = {k: v for k, v in self.__getstate__().items() if k not in ("arm", "profile", "_every")}
        return save_state(path, state, self.arm, self.method, self._engine)

    @classmethod
    def restore(
        cls,
        path: str | PathLike[str],
        arm: Arm | str | Path,
        method: str | Path | None = None,
        profile: Profile | None = None,
        known: Known | None = None,
        every: float = PUBLISH,
    ) -> Self:
        """An identifier in the state that was saved.

        Args:
            path: what `save` wrote. arm, method, profile: what the identifier was made with; a tare and its age are in
                the state.
            known: of payloads from now on. every: as for the constructor.

        Raises:
            IdentificationError: the file is none, or of another arm or trained model.
        """
        new = cls(arm, method=method, profile=profile, known=known, every=every)
        try:
            saved = load_state(path, new.arm, new.method, new._engine)
        finally:
            new.close()
        new.__dict__.update(saved)
        for run in [new._engine] if new._watch is None else new._watch.all_runs:
            know(run, known)
        return new

    def _pass_on(self, sample: Sample) -> None:
        """To a method that is not watched."""
        estimate = self._engine.update(sample)
        if not all_finite(estimate.phi):
            return
        self._judgement.newest = sample.t
        self._stream.forget_pauses()
        estimate = self._judgement.allowing(estimate, self._engine)
        if not 0.0 <= sample.t - self._published < self._every:
            self._published = sample.t
            self._judge(estimate, self._engine)
        self._judgement.take(estimate, self._engine)

    def _identify(self, sample: Sample, watch: PayloadWatch) -> None:
        judgement, event, run = self._judgement, watch.event, watch.run
        run.publish = self._every if run.stream.seconds > KIND_LATEST else PUBLISH
        estimate = watch.update(sample, judgement.held, judgement.run)
        if watch.event is not event and watch.event is not None:
            self._noticed(watch.event, watch, self._stream.clock - sample.t)
        if estimate is None:
            if sample.t - self._published > PUBLISH:
                self._track(watch, sample)
            return
        run, mixed = watch.answered, watch.mixed
        fresh = run.fresh
        if not fresh and run is not judgement.run and math.isfinite(run.data_t):
            return  # a run just taken up again: until it answers anew, its answer is of long ago
        if fresh and not all_finite(estimate.phi):
            return
        counts, stands = judgement.counts(run)
        if counts:
            self._stream.forget_pauses()
        if mixed and not fresh:
            return
        judgement.doubts.look(run, self.relative_to)
        estimate = judgement.allowing(watch.track(sample.t) if mixed else estimate, run, mixed)
        if fresh:
            self._published = sample.t
            self._judge(estimate, run, stands)
        judgement.take(estimate, run)

    def _track(self, watch: PayloadWatch, sample: Sample) -> None:
        """While samples are left out: what all that may have happened makes of the payload."""
        self._published, estimate = sample.t, self._judgement.allowing(watch.track(sample.t), watch.run, True)
        self._judgement.take(estimate, None)
        if watch.settling or watch.likely[0] > 0.5:  # then phi follows what the samples say
            self._judgement.newest = sample.t
        self._judge(estimate, watch.run)
        self._judgement.left_out(watch)

    def _noticed(self, event: Event, watch: PayloadWatch, shift: float) -> None:
        """A change of payload, or what it was; the stream's clock is ahead of its by `shift` [s]."""
        if watch.settling:
            self._since_before, self._since, self._published = self._since, self._stream.clock, -math.inf
            self._stream.forget_pauses()
        elif watch.called_off:  # it was none
            self._since = self._since_before
        if self._event_t != event.t:  # the same event keeps its time, however long a pause there was since
            self._event_t, self._event_shift = event.t, shift
        self.event = replace(event, t=event.t + self._event_shift, began=event.began + self._event_shift)

    def _judge(self, estimate: Estimate, run: Identifier, stands: bool = False) -> None:
        about = self.relative_to, self._stream.moving, stands and self.trouble is None
        self._judgement.judge(estimate, run, *about)

    def _present(self) -> OnlineEstimate:
        stream, judged, watch, moving = self._stream, self._judgement, self._watch, self._stream.moving
        change, contact, drift = (None, None, None) if watch is None else watch.likely
        sure = watch is None or watch.sure
        notes = (*self._seen.doubt, *judged.words(None if sure else watch, self._blind, moving))
        doubted = judged.doubted or self._blind or bool(self._seen.doubt)
        return OnlineEstimate.of(
            {
                **vars(judged.estimate),
                **{name: getattr(judged, name) for name in _JUDGED},
                "t": stream.clock,
                "age": float(stream.unseen + stream.ahead + judged.age(stream.now)),
                "lag": 0.0,
                "since": stream.clock if self._since is None else self._since,
                "relative_to": self.relative_to,
                "method": self.method,
                "same_arm_assumed": (self._tared or self.profile is not None) and not judged.doubts.asked_whose,
                "calibrated": self.engine.calibrated and sure and not doubted,
                "p_change": change,
                "p_contact": contact,
                "p_drift": drift,
                "moving": moving,
                "settling": watch is not None and watch.settling,
                "event": self.event,
                "health": stream.gate.health,
                "notes": notes if stream.trouble is None else (*notes, stream.trouble),
            }
        )
