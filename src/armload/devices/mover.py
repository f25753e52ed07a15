"""An arm that is read and moved: a source of samples that also follows motions.

    with open_mover("sim", arm) as mover:
        mover.follow(motion)
        for sample in mover:
            ...
            if not mover.moving:
                break

A movement begins only where the arm is commanded to be, goes along the motion's path and nowhere else, and ends at
rest: at its end, or, braked along the path (`Course`), when `stop` is asked for, by whoever holds the mover or by its
`Supervision`. Samples come all the time, at rest too.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.arms.units import unit_of
from armload.devices.heard import Heard
from armload.devices.load import Load
from armload.devices.source import Source
from armload.devices.supervision import SILENCE, Supervision, Thresholds
from armload.errors import SafetyError, SinkError, SourceError
from armload.motion import Course, Motion
from armload.recording import Sample

AT_START = 0.005  # [rad] between where the arm is commanded to be and where a motion begins: what rounding leaves
_BLEND = 0.5  # [s] in which that is taken up
_STOOD = 1.0  # [s] of samples whose times do not rise, after which their clock counts as one that stands
SETTLE = 0.2  # [s] of samples after a movement's end, while the arm swings out
_LOOK = 0.5  # [s] between two looks while no sample comes
_LOST = 5.0  # [s] without a sample after which an arm on its way counts as lost, whatever its client waits for
_USUAL = 3.0  # samples that may be missing of an arm that sends few


class Mover(Source):
    """A source that moves its arm.

    Attributes:
        arm: which it is.
        why: why the last movement was stopped before its end; None: it was not.
        writes: whether its controller takes a payload (`write`).
        see: what to look at where the arm does not follow; "": nothing in particular.
    """

    arm: Arm
    why: str | None = None
    writes: bool = False
    see: str = ""

    @property
    @abstractmethod
    def moving(self) -> bool:
        """Whether a movement is under way."""

    @abstractmethod
    def commanded(self) -> NDArray[np.float64]:
        """Where the controller holds the arm, q (n,) [rad]; known from the first sample on."""

    @abstractmethod
    def follow(self, motion: Motion, thresholds: Thresholds | None = None) -> None:
        """Begin a movement.

        Raises:
            SafetyError: the arm moves already, would not follow, or is not where the motion begins.
        """

    @abstractmethod
    def stop(self, why: str) -> None:
        """Let the arm come to rest on its path, soon; from any thread. Nothing happens at rest."""

    def hindrance(self) -> str | None:
        """Why the arm would not follow a movement now, by what its controller says of itself; None: nothing is said."""
        return None

    def silence(self, seconds: float) -> str:
        """What to say where no sample came for so many seconds while the arm was on its way."""
        return (
            f"{self.name} was lost: no sample for {seconds:g} s while the arm was on its way; see that it is switched "
            "on and its cable is in, and open it again"
        )

    def mount(self) -> bool:
        """Put on the payload, where the mover can (a simulator); False: somebody has to."""
        return False

    def write(self, load: Load, *, allow_undetermined_inertia: bool = False) -> Any:  # noqa: ARG002
        """Tell the controller the load, guarded (`check_writable`), and return what was sent.

        Raises:
            SinkError: it must not be written, or there is no controller that takes one.
        """
        raise SinkError(f"{self.name} takes no payload: export it instead (armload export)")


class StreamedMover(Mover):
    """A mover that sends a command for each sample; makes derive from it.

    Args:
        arm: which it is.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm, self.n = arm, arm.n
        self._heard = Heard()
        self._movement: Movement | None = None
        self._stop_for: str | None = None  # any thread may set it, and none takes it back before the next movement

    @property
    def moving(self) -> bool:
        """Whether a movement is under way."""
        return self._movement is not None

    def follow(self, motion: Motion, thresholds: Thresholds | None = None) -> None:
        """Begin a movement with the next command."""
        away = check_start(self, motion)
        self.why = self._stop_for = None
        self._movement = Movement(self.arm, motion, thresholds or Thresholds(), away)
        self._movement.supervision.off = self.see

    def stop(self, why: str) -> None:
        """Brake with the next command."""
        self._stop_for = self._stop_for or why

    def _took(self, sample: Sample, begun: Callable[[], float]) -> Movement | None:
        """Look at a sample; the movement it belongs to, braked if it must be; None at rest.

        begun: called when a movement begins: the time on the samples' clock at which its first command takes effect.
        """
        passed, waited = self._heard.at(sample.t)
        movement = self._movement
        if movement is None:
            return None
        if movement.begun is None:
            movement.begun = begun()
        elif abs(passed) > max(SILENCE, _USUAL / self.rate):
            self._missed(movement, passed, waited)
        else:
            self._went_on(movement, passed)
        t, course = sample.t - movement.begun, movement.course
        if course.braked is None:
            found = movement.supervision.problem(max(t, 0.0), sample, course)
            if found is not None:
                self._halt(found)
        if t > course.duration + SETTLE:
            self._movement = None
            return None
        return movement

    def _missed(self, movement: Movement, passed: float, waited: float) -> None:
        """Stop: between two samples their clock went on by `passed` [s], more than it may, and ours by `waited` [s].

        Commands are given by the samples' clock: the next one would be as far along the path.
        """
        if 0.0 < passed < 2.0 * waited:
            why = f"no sample came for {passed:.2f} s"
            self._silent(movement, passed)
        else:
            why = f"the clock of its samples jumped by {passed:+.2f} s (see what sets it)"
            self._jumped(movement, passed)
        self._halt(why)

    def _halt(self, why: str) -> None:
        """Brake, and say why, also where the movement is over but for its samples."""
        self.stop(why)
        self.why = self._stop_for

    def _went_on(self, movement: Movement, passed: float) -> None:
        """The samples' clock went on by `passed` [s], little enough for the next command to be as far along the path.

        A controller that stands at the last command meanwhile must not be asked to catch up.
        """

    def _silent(self, movement: Movement, passed: float) -> None:
        """Go on after `passed` [s] without a sample: the arm stands at the last command, and stays there."""
        assert movement.begun is not None
        movement.begun += passed
        movement.course.stand(self._heard.newest - movement.begun + 1.0 / self.rate)

    def _jumped(self, movement: Movement, passed: float) -> None:
        """Go on where the arm is on its path, though the samples' clock jumped by `passed` [s]."""
        assert movement.begun is not None
        movement.begun += passed

    def _brakes(self, movement: Movement, t: float) -> None:
        """Brake from t [s] on the movement's clock on, if that was asked for."""
        if self._stop_for is not None and movement.course.braked is None and t < movement.course.duration:
            movement.course.brake(max(t, 0.0))
            self.why = self._stop_for


class Movement:
    """What a streamed mover knows of the movement that it is on."""

    def __init__(self, arm: Arm, motion: Motion, thresholds: Thresholds, away: NDArray[np.float64]) -> None:
        self.course = Course(motion, arm.limits)
        self.supervision = Supervision(arm, motion, thresholds)
        self.begun: float | None = None
        self._away = away

    def target(self, t: float) -> NDArray[np.float64]:
        """The command q (n,) for t [s] on the movement's clock: without a jump from where the arm was held."""
        x = min(max(t / _BLEND, 0.0), 1.0)
        left = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        return self.course.position([t])[0] + left * self._away


def check_start(mover: Mover, motion: Motion) -> NDArray[np.float64]:
    """See that a movement may begin; how far the arm is from its start (n,) [rad], which is at most `AT_START`.

    Raises:
        SafetyError: the arm moves already, would not follow, or is not where the motion begins; the motion is of
            another arm, or does not begin and end at rest.
    """
    if mover.moving:
        raise SafetyError(f"{mover.name} moves already: wait until it is at rest")
    if (why := mover.hindrance()) is not None:
        raise SafetyError(f"{mover.name} would not follow: {why}")
    if motion.n != mover.n:
        raise SafetyError(f"the motion {motion.name!r} moves {motion.n} joints: {mover.name} has {mover.n}")
    q, dq, _ = motion([0.0, motion.duration])
    if np.abs(dq).max() > 1e-3:
        raise SafetyError(f"the motion {motion.name!r} does not begin and end at rest")
    away = mover.commanded() - q[0]
    j = int(np.argmax(np.abs(away)))
    if not abs(away[j]) <= AT_START:
        unit = unit_of("position", mover.arm.limits.slides[j])
        raise SafetyError(
            f"{mover.arm.joint_names[j]} is {abs(away[j]):.3f} {unit} from where the motion {motion.name!r} begins: "
            "move the arm to its start first" + (f", and where it does not get there, {mover.see}" if mover.see else "")
        )
    return away


def samples_of_movement(mover: Mover, motion: Motion, thresholds: Thresholds | None = None) -> Iterator[Sample]:
    """Let the arm follow a motion; its samples until it is at rest again.

    Raises:
        SafetyError: the movement must not begin.
        SourceError: the connection was lost, no more samples come, or their clock stands still.
    """
    mover.follow(motion, thresholds)
    newest, heard = -np.inf, time.monotonic()
    risen = heard
    for sample in mover.ticking(_LOOK):
        if sample is None:
            if time.monotonic() - heard > _LOST:
                raise SourceError(mover.silence(_LOST))
            continue
        heard = time.monotonic()
        yield sample
        if not mover.moving:
            return
        if sample.t > newest:
            newest, risen = sample.t, time.monotonic()
        elif time.monotonic() - risen > _STOOD:  # the end of the movement would never come
            raise SourceError(
                f"the clock of {mover.name} has stood still for {_STOOD:g} s while the arm was on its way: expected "
                "times that rise; see that the controller runs"
            )
    raise SourceError(f"{mover.name} ended while the arm was on its way: see what the robot says, and open it again")
