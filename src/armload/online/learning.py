"""What a stream teaches a profile: one more session of the empty arm, and never anything it may have held."""

from __future__ import annotations

from collections.abc import Iterable

from armload.arms import rated_effort
from armload.estimators import Identifier
from armload.identification.notes import arm_changed
from armload.inertia import HELD
from armload.online.thresholds import LEARN_FROM
from armload.posterior import PosteriorLeastSquares, Profile
from armload.posterior.profile_session import compared, with_session
from armload.posterior.scales import AnotherArm
from armload.regression import Correction


def change_of_arm(run: Identifier, what: str = "profile", another: AnotherArm | None = None) -> str | None:
    """That a run's arm is not as at its tare or as its profile says; None: it is, as far as anybody can tell.

    Args:
        what: that is spoken of, "profile" or "tare".
        another: what was found of the arm in an earlier run of the stream, which has the same arm; None: nothing.
    """
    if not isinstance(run, PosteriorLeastSquares):
        return None
    return arm_changed(run.stream.drift, another or run.stream.another, what)


def learned_from(profile: Profile, runs: Iterable[PosteriorLeastSquares], name: str) -> Profile | None:
    """The profile with the longest run of the empty arm as one more session; None where there is none to learn from.

    A run is learned from if it lasted `LEARN_FROM`, holds nothing as far as it can tell, and if the arm was then as in
    its other sessions: an exchanged or repaired arm is another one, and is not averaged with it. What the run seems to
    hold within its error bars is taken off its rows, so that a light thing does not become a part of the arm.
    """
    best = max((run for run in runs if _is_empty(run)), key=lambda run: run.stream.seconds, default=None)
    if best is None:
        return None
    data = best.stream.accumulated()
    correction = Correction(best.arm, rated_effort(best.arm))
    data.session = profile.session(correction)
    if compared(profile, correction, data)[2]:  # the stream asks now and then only
        return None
    data.less(best.stream.posterior.phi)
    return with_session(profile, correction, data, name=name)


def _is_empty(run: PosteriorLeastSquares) -> bool:
    stream = run.stream
    if (
        run.reference is not None
        or stream.seconds < LEARN_FROM
        or not stream.solutions
        or stream.difference is not None
    ):
        return False
    mass, std = float(run.last.phi[0]), float(run.last.std[0])
    return abs(mass) <= HELD * std and change_of_arm(run) is None
