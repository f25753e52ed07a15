"""Was gravity missing where it was put back? Torque that had it all the time would be answered with another payload."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError
from armload.identification.thresholds import OTHER_FORM
from armload.identification.torque_scale import torque_scale
from armload.recording import Recording


def check_gravity_was_missing(logs: Sequence[Recording], arm: Arm) -> None:
    """Refuse logs into whose torque gravity was put back (`with_gravity`) though it was in it already.

    Each is asked whether its torque is rather that of the arm as it is now, or as it was reported: the log odds of
    `torque_scale`, those of all logs together.

    Args:
        logs: of one robot; those with the torque of their source say nothing. arm: with its base's orientation.

    Raises:
        RecordingError: their torque had gravity in it.
    """
    restored = [log for log in logs if log.gravity_of is not None]
    odds = [_log_odds(log, arm) for log in restored]
    if sum(odds) > OTHER_FORM:
        surest = restored[odds.index(max(odds))]
        raise RecordingError(
            f"{surest.source}: tau seems to have gravity in it already: expected torque from which a controller has "
            "taken gravity; leave `compensated` out, or check how the base is mounted (--gravity)"
        )


def _log_odds(log: Recording, arm: Arm) -> float:
    """Of torque that had gravity in it when it was reported, over torque that had not."""
    put_back = log.gravity_of
    assert put_back is not None

    def twice(q: NDArray) -> NDArray:
        return -put_back.torque(q)

    had, had_not = torque_scale(log, arm, lacks=twice), torque_scale(log, arm)
    return 0.0 if had is None or had_not is None else had.evidence - had_not.evidence
