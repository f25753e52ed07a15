"""What a stream teaches a profile: one more session of the empty arm, and never anything it may have held."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from armload.arms import rated_effort
from armload.errors import IdentificationError
from armload.identification.arm_notes import arm_changed
from armload.identification.notes import learned_from as known_already
from armload.inertia import HELD
from armload.online.thresholds import LEARN_FROM
from armload.posterior import PosteriorLeastSquares, Profile
from armload.posterior.profile import MARKS
from armload.posterior.profile_session import compared, with_session
from armload.recording import Sample, mark_of
from armload.regression import Correction

_MOST = MARKS // 16  # marks that are kept of a stream, so that they leave those of logs their place


class Seen:
    """Marks of a stream's samples, by which a log or a stream of the same measurements is known (`mark_of`).

    Of many, those of every other, fourth, eighth value are kept.

    Args:
        known: the session of the stream's profile that holds some of its samples, or of its tare's; None: none does.
    """

    known: str | None = None

    def __init__(self, known: str | None = None) -> None:
        self.marks: dict[str, None] = {}
        self._every, self.known = 1, known

    @property
    def doubt(self) -> tuple[str, ...]:
        """That the profile knows the samples already, as of a log; nothing where it does not."""
        return () if self.known is None else (known_already(self.known),)

    def take(self, sample: Sample, profile: Profile | None = None) -> None:
        """Go on by one sample; `profile`: of the stream."""
        mark = mark_of(sample)
        if mark is None:
            return
        if self.known is None and profile is not None:
            self.known = profile.holding([mark])
        if int(mark, 16) % self._every:
            return
        self.marks[mark] = None
        while len(self.marks) > _MOST:
            self._every *= 2
            self.marks = {mark: None for mark in self.marks if int(mark, 16) % self._every == 0}


def learned_from(
    own: Profile, profile: Profile, runs: Iterable[PosteriorLeastSquares], name: str, marks: Sequence[str]
) -> Profile | None:
    """A profile with the longest run of the empty arm as one more session; None where there is none to learn from.

    A run is learned from if it lasted `LEARN_FROM`, holds nothing as far as it can tell, and if the arm was then as in
    its other sessions: an exchanged or repaired arm is another one, and is not averaged with it. What the run seems to
    hold within its error bars is taken off its rows, so that a light thing does not become a part of the arm.

    Args:
        own: of the stream. profile: to add to; `own`, or what that has grown to meanwhile. runs: of the stream.
        name: of it. marks: of its samples.

    Raises:
        IdentificationError: the profile is learned from some of these samples, or no later state of the stream's own.
        ModelError: it is of another arm.
    """
    if profile.features != own.features:
        raise IdentificationError("the profile was made anew while the stream ran: nothing is added to it")
    if (known := profile.holding(marks)) is not None:
        raise IdentificationError(f"{name} holds measurements of {known}, which the profile is learned from")
    best = max((run for run in runs if _is_empty(run)), key=lambda run: run.stream.seconds, default=None)
    if best is None:
        return None
    profile.check(best.arm)
    data, correction = best.stream.accumulated(), Correction(best.arm, rated_effort(best.arm))
    data.session = profile.session(correction)
    if compared(profile, correction, data)[2]:  # the stream asks now and then only
        return None
    data.less(best.stream.posterior.phi)
    return with_session(profile, correction, data, name=name, marks=marks)


def _is_empty(run: PosteriorLeastSquares) -> bool:
    stream, last = run.stream, run.last
    told = run.reference is None and stream.solutions > 0 and stream.difference is None
    as_it_was = arm_changed(run.arm, stream.drift, stream.another) is None
    return told and as_it_was and stream.seconds >= LEARN_FROM and abs(last.phi[0]) <= HELD * last.std[0]
