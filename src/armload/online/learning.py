"""What a stream teaches a profile: one more session of the empty arm, and never anything it may have held."""

from __future__ import annotations

from collections.abc import Iterable

from armload.arms import rated_effort
from armload.estimators import Identifier
from armload.inertia import HELD
from armload.online.thresholds import LEARN_FROM
from armload.posterior import PosteriorLeastSquares, Profile
from armload.posterior.drift import Drift
from armload.posterior.profile_learning import with_session
from armload.regression import Correction


def drift_of_run(run: Identifier) -> Drift | None:
    """By how much the arm differs from its tare or profile, where that is beyond what is expected; else None."""
    drift = run.stream.drift if isinstance(run, PosteriorLeastSquares) else None
    return drift if drift is not None and drift.changed else None


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
    data.less(best.stream.posterior.phi)
    return with_session(profile, Correction(best.arm, rated_effort(best.arm)), data, name=name)


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
    return abs(mass) <= HELD * std and drift_of_run(run) is None
