"""What a stream teaches a profile: one more session of the empty arm, and never anything it may have held."""

from __future__ import annotations

from collections.abc import Iterable

from armload.arms import rated_effort
from armload.identification.notes import arm_changed
from armload.inertia import HELD
from armload.online.thresholds import LEARN_FROM
from armload.posterior import PosteriorLeastSquares, Profile
from armload.posterior.profile_session import compared, with_session
from armload.regression import Correction


def learned_from(profile: Profile, runs: Iterable[PosteriorLeastSquares], name: str) -> Profile | None:
    """The profile with the longest run of the empty arm as one more session; None where there is none to learn from.

    A run is learned from if it lasted `LEARN_FROM`, holds nothing as far as it can tell, and if the arm was then as in
    its other sessions: an exchanged or repaired arm is another one, and is not averaged with it. What the run seems to
    hold within its error bars is taken off its rows, so that a light thing does not become a part of the arm.
    """
    best = max((run for run in runs if _is_empty(run)), key=lambda run: run.stream.seconds, default=None)
    if best is None:
        return None
    data, correction = best.stream.accumulated(), Correction(best.arm, rated_effort(best.arm))
    data.session = profile.session(correction)
    if compared(profile, correction, data)[2]:  # the stream asks now and then only
        return None
    data.less(best.stream.posterior.phi)
    return with_session(profile, correction, data, name=name)


def _is_empty(run: PosteriorLeastSquares) -> bool:
    stream, last = run.stream, run.last
    told = run.reference is None and stream.solutions > 0 and stream.difference is None
    as_it_was = arm_changed(stream.drift, stream.another) is None
    return told and as_it_was and stream.seconds >= LEARN_FROM and abs(last.phi[0]) <= HELD * last.std[0]
