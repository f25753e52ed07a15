"""The procedure: plan, consent, a run without the payload, one with it that ends when enough is known, the answer."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.devices.guard import is_moving
from armload.devices.mover import AT_START, Mover, samples_of_movement
from armload.devices.recorder import Recorder
from armload.devices.supervision import Thresholds
from armload.errors import RecordingError, SafetyError, SourceError
from armload.excitation import Accuracy
from armload.identification import Identification, identify
from armload.identification.tare_age import age_of
from armload.inertia import Z95
from armload.measuring.basis import Basis
from armload.measuring.plan import BACK, EMPTY, LOADED, TO_START, Plan, Room, plan_of
from armload.motion import Motion
from armload.online import OnlineIdentifier
from armload.posterior import Known
from armload.recording import Recording, Sample, read_recording
from armload.runtime.interruption import held_back

LOGS = ("empty.csv", "loaded.csv")
ENOUGH = "the accuracy asked for is reached"
_LOOK = 0.02  # [s] between two looks at the accuracy: a tenth of a braking time
_STILL = 0.2  # [s] for which the arm must have stood before a movement: what was just put on has swung out
_FRESH = 0.05  # [s] older samples waited somewhere, while somebody mounted the payload, say
_TO_SETTLE = 5.0  # [s] of waiting for that, and for samples that waited to get newer
_TO_SWING_OUT = 1.0  # [s] of waiting for an arm that somebody has just stopped
_WARM_UP = 0.5  # [s] of the tare that the identifier is fed before the arm moves, so that all it compiles is compiled


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a measurement found.

    answer: of the log of the loaded run. empty, loaded: the logs; empty is None where a tare was given.
    seconds: of the loaded run. reached: whether the answer is as accurate as was asked for; None: nothing was asked.
    """

    answer: Identification
    empty: Path | None
    loaded: Path
    seconds: float
    reached: bool | None

    def to_dict(self) -> dict[str, Any]:
        """The answer's fields and `measurement`, ready for JSON."""
        empty = None if self.empty is None else str(self.empty)
        own = {"empty": empty, "loaded": str(self.loaded), "seconds": self.seconds, "reached": self.reached}
        return self.answer.to_dict() | {"measurement": own}


class Procedure:
    """A measurement on one arm; nothing moves before `run`, nor in `run` before `consent` says yes.

    Args:
        mover: the arm, at rest.
        arm: which it is: bare, or with a tool that is known and mounted in both runs.
        motion: what is run, from rest to rest; empty_motion: what is run without the payload (None: the same).
        folder: for the logs `empty.csv` (unless there is a tare) and `loaded.csv`, which must not exist.
        basis: what is known of the arm and the payload; the movements are checked with its `heaviest`. None: nothing.
        room: see `plan_of`.
        accuracy: the loaded run ends when it is reached; None: with the motion.
        thresholds: where a movement is stopped.
        say: called with what is being done.

    Raises:
        RecordingError: a log is there already, or the folder cannot be made.
        SourceError: the arm does not say where it is.
        SafetyError: the arm moves, or is too far from the motion's start; or this machine is too busy to look at it.
        IdentificationError, ModelError: see `Basis.known`.
    """

    def __init__(
        self,
        mover: Mover,
        arm: Arm,
        motion: Motion,
        folder: str | Path,
        *,
        empty_motion: Motion | None = None,
        basis: Basis | None = None,
        room: Room | None = None,
        accuracy: Accuracy | None = None,
        thresholds: Thresholds | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.mover, self.arm, self.motion, self.empty_motion = mover, arm, motion, empty_motion
        self.folder, self.basis, self.room = Path(folder), basis or Basis(), room or Room()
        self._known = self.basis.known(arm)
        self.accuracy, self.thresholds, self._say = accuracy, thresholds or Thresholds(), say
        for path in (self.folder / name for name in LOGS[self.basis.tare is not None :]):
            if path.exists():
                raise RecordingError(f"{path} exists: a log is never written over; name another folder")
        at = self._standing(_TO_SWING_OUT)
        self.plan = self._plan(at, empty_run=self.basis.tare is None)

    def run(self, consent: Callable[[Plan], bool], mount: Callable[[], None]) -> Measurement:
        """Make the measurement.

        Args:
            consent: asked with the plan before the first movement, and with a new one should the arm be elsewhere
                when the payload is on; False: nothing moves.
            mount: returns when the payload is on and the arm may move again.

        Raises:
            SafetyError: the plan passes a limit, there is no consent, or the arm had to be stopped. It is at rest then.
            SourceError: the connection was lost.
            RecordingError: a log cannot be written. The arm is at rest.
            KeyboardInterrupt: somebody interrupted. The arm is at rest.
            ArmloadError: the answer cannot be found; the logs are kept.
        """
        self._allowed(self.plan, consent)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"{self.folder} cannot be made: {error.strerror}") from None
        empty, loaded = (self.folder / name for name in LOGS)
        tare = self.basis.tare
        if tare is None:
            self._move(self.plan, TO_START)
            self._move(self.plan, EMPTY, empty)
        try:
            if tare is None:
                self._move(self.plan, BACK)
                mount()
                tare = read_recording(empty, self.arm)
            seconds = self._loaded_run(tare, loaded, consent)
        except BaseException:  # also Ctrl-C
            if self.basis.tare is None:
                self._say(f"the empty run is whole: once the payload is on, --tare {empty} goes on from there")
            raise
        self._say("identifying")
        about = self.basis
        known = {"mass": about.mass, "com": about.com, "body": about.body, "family": about.family}
        of_arm = {"tare": tare, "tare_age": about.tare_age, "profile": about.profile}
        answer = identify(loaded, self.arm, **of_arm, **known, method=about.method)
        reached = None
        if self.accuracy is not None:
            half_width = Z95 * np.sqrt(np.maximum(np.diag(answer.covariance), 0.0))
            reached = self.accuracy.holds(half_width)
        return Measurement(answer, empty if about.tare is None else None, loaded, seconds, reached)

    def check(self, plan: Plan | None = None) -> None:
        """See that the arm may make all movements of a plan (None: of the first), and would; SafetyError if not."""
        plan = plan or self.plan
        plan.check(self._so_far(plan))
        if (why := self.mover.hindrance()) is not None:
            raise SafetyError(f"{self._so_far(plan)}: {self.mover.name} would not follow: {why}")

    def _loaded_run(self, tare: Recording, log: Path, consent: Callable[[Plan], bool]) -> float:
        """Move with the payload, from wherever the arm is now; how long that took [s]."""
        identifier = self._warm(tare)
        try:
            plan = self._again(consent)
            self._move(plan, TO_START)
            return self._move(plan, LOADED, log, identifier)
        finally:
            identifier.close()

    def _plan(self, at: NDArray[np.float64], empty_run: bool) -> Plan:
        more = {"empty_motion": self.empty_motion, "room": self.room, "heaviest": self.basis.heaviest}
        return plan_of(self.arm, self.motion, at, empty_run=empty_run, **more)

    def _allowed(self, plan: Plan, consent: Callable[[Plan], bool]) -> None:
        self.check(plan)
        if not consent(plan):
            raise SafetyError(f"{self._so_far(plan)}: there was no consent; type yes when asked, or give --move")

    def _so_far(self, plan: Plan) -> str:
        return "nothing was moved" if plan is self.plan else "nothing was moved with the payload on"

    def _again(self, consent: Callable[[Plan], bool]) -> Plan:
        """The plan of what is left, from where the arm is now; agreed to anew if that is not where it was left."""
        at = self._standing(_TO_SETTLE)
        expected = self.plan.legs[-1 if self.basis.tare is None else 0].motion.position([0.0])[0]
        plan = self._plan(at, empty_run=False)
        if np.abs(at - expected).max() > AT_START:
            self._say("the arm is not where it was left")
            self._allowed(plan, consent)
        self.check(plan)
        return plan

    def _standing(self, patience: float) -> NDArray[np.float64]:
        """Where the arm is commanded to be; it must come to rest within `patience` [s] of its own clock.

        Samples that waited somewhere are passed over, as long as this machine catches up with them.
        """
        begun: float | None = None  # of the newest stretch of rest, among samples that did not wait anywhere
        asked: float | None = None  # the first of these samples
        waited: tuple[float, float] | None = None  # how old a sample was that waited, and when that was seen
        for sample in self.mover:
            lag, now = self.mover.lag(), time.monotonic()
            fresh = lag < _FRESH
            if fresh:
                waited = None
            elif waited is None or now - waited[1] > _TO_SETTLE:
                if waited is not None and lag >= waited[0]:
                    raise SafetyError(
                        f"the samples of {self.mover.name} are {lag:.2g} s old when they are looked at, and do not get "
                        f"newer: expected less than {_FRESH:g} s; give this machine less other work"
                    )
                waited = lag, now
            begun = None if not fresh or is_moving(sample.dq) else sample.t if begun is None else begun
            if begun is not None and sample.t - begun >= _STILL:
                return self.mover.commanded()
            asked = sample.t if asked is None and fresh else asked
            if fresh and begun is None and asked is not None and sample.t - asked > patience:
                if not np.all(np.isfinite(sample.dq)):
                    raise SafetyError(
                        f"{self.mover.name} does not say how fast its joints are: expected finite velocities, without "
                        "which nobody knows whether it stands; see what its driver sends"
                    )
                raise SafetyError(f"{self.mover.name} moves: a measurement begins at rest; stop it first")
        raise SourceError(f"{self.mover.name} ended before its first sample")

    def _warm(self, tare: Recording) -> OnlineIdentifier:
        """An identifier that has compiled and loaded what it needs, and has seen nothing."""
        age, _ = age_of(tare, time.time(), self.basis.tare_age)  # that of the log says how old it is
        kind = None if self._known is None else Known.of(None, None, families=self._known.families)
        about = self.basis
        identifier = OnlineIdentifier(self.arm, tare, about.method, about.profile, known=kind, tare_age=age)
        short = tare.between(tare.t[0], tare.t[0] + _WARM_UP)
        for row in zip(short.t, short.q, short.dq, short.tau, strict=True):
            identifier.update(*row)
        identifier.reset()
        return identifier

    def _move(
        self, plan: Plan, purpose: str, log: Path | None = None, identifier: OnlineIdentifier | None = None
    ) -> float:
        """Make one movement of a plan, if it is needed; how long it took [s]."""
        leg = plan.leg(purpose)
        if leg is None:
            return 0.0
        self._say(f"moving {purpose}")
        first, last, looked = np.inf, -np.inf, -np.inf
        recorder = None if log is None else Recorder(log, self.mover.n)
        unkept: RecordingError | None = None
        lost = int(getattr(self.mover, "lost", 0))
        try:
            with held_back() as interruption:
                for sample in samples_of_movement(self.mover, leg.motion, self.thresholds):
                    if recorder is not None and unkept is None:
                        try:
                            recorder.append(sample)
                        except RecordingError as error:  # what nobody keeps is of no use, and the arm is on its way
                            unkept = error
                            self.mover.stop("its log cannot be written")
                    if interruption.name is not None:
                        self.mover.stop(f"interrupted by {interruption.name}")
                    first, last = min(first, sample.t), sample.t
                    if identifier is not None and self._enough(identifier, sample, sample.t - looked > _LOOK):
                        self.mover.stop(ENOUGH)
                    looked = sample.t if sample.t - looked > _LOOK else looked
        except SourceError as error:
            raise SourceError(f"{error}; {_kept(log)}") from None
        except KeyboardInterrupt:
            now = "whether it rests is not known: see the arm" if self.mover.moving else "it is at rest"
            self._say(f"the arm was interrupted on its way {purpose}, and {now}; {_kept(log)}")
            raise
        finally:
            if recorder is not None:
                recorder.close()
        if unkept is not None:
            raise RecordingError(
                f"{unkept}; the arm was stopped on its way {purpose}: make room, and measure again into another folder"
            )
        if self.mover.why not in (None, ENOUGH):
            raise SafetyError(f"the arm was stopped on its way {purpose}: {self.mover.why}; {_kept(log)}")
        if recorder is not None and len(recorder.paths) > 1:
            raise RecordingError(
                f"the clock of {self.mover.name} went back on the way {purpose}, and the log is in parts "
                f"({', '.join(map(str, recorder.paths))}): see what sets that clock, and measure into another folder"
            )
        if log is not None and (missed := int(getattr(self.mover, "lost", 0)) - lost):
            self._say(
                f"this process did not run for a while: {log} lacks {missed} samples, and the answer rests on the rest"
            )
        return last - first

    def _enough(self, identifier: OnlineIdentifier, sample: Sample, look: bool) -> bool:
        estimate = identifier.update(*sample)
        if not look or self.accuracy is None or estimate.settling or estimate.n_samples == 0:
            return False
        return self.accuracy.reached(estimate, self._known)


def _kept(log: Path | None) -> str:
    return "nothing was being recorded" if log is None else f"what was recorded until then is in {log}"
