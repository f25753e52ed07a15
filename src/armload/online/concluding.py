"""What is doubted of a stream that has ended, as of a log (`identification.reporting`)."""

from __future__ import annotations

from armload.arms import Arm
from armload.estimators import Estimate, Identifier
from armload.identification.notes import gravity_doubted, gravity_turned, not_rigid
from armload.identification.reporting import EXCHANGED, NO_BODY
from armload.identification.thresholds import MISFIT
from armload.inertia import distance_to_body
from armload.online.learning import change_of_arm
from armload.posterior import PosteriorLeastSquares
from armload.posterior.restless import RESTLESS


def doubts_of(run: Identifier, estimate: Estimate, arm: Arm) -> tuple[bool, tuple[str, ...]]:
    """Whether a concluded run's answer is doubted, and why; that the arm has changed its notes say already."""
    mean, covariance = run.unprojected or (estimate.phi, estimate.covariance)
    posterior = run if isinstance(run, PosteriorLeastSquares) else None
    exchanged = posterior is not None and posterior.exchanged
    notes = []
    if exchanged or distance_to_body(mean, covariance) > MISFIT:
        notes.append(EXCHANGED if exchanged else NO_BODY)
    doubted = bool(notes) or change_of_arm(run) is not None
    if posterior is None:
        return doubted, tuple(notes)
    if posterior.stream.restlessness > RESTLESS and not doubted:
        doubted = True
        notes.append(not_rigid(posterior.stream.restlessness))
    tilt = posterior.stream.tilt
    if tilt is not None and tilt.found:
        doubted = True
        notes.append(gravity_turned(arm.gravity, arm.leaning(tilt.angles).gravity, False))
    elif (may := gravity_doubted(arm, tilt, posterior.posterior.torque)) is not None:
        doubted = True
        notes.append(may)
    return doubted, tuple(notes)
