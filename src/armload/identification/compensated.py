"""Torque that is said to have gravity taken out: what was taken is put back, unless it is there already."""

from __future__ import annotations

from collections.abc import Sequence

from armload.arms import Arm
from armload.errors import RecordingError
from armload.identification.thresholds import OTHER_FORM
from armload.identification.torque_scale import torque_scale
from armload.inertia import InertialParameters
from armload.recording import Recording, with_gravity


def uncompensated(
    logs: Sequence[Recording], arm: Arm, payload: InertialParameters | None = None
) -> tuple[Recording, ...]:
    """Logs of one robot with the gravity that its controller took out of the torque put back.

    Each is asked whether its torque is rather that of the arm as it is, or with gravity added: the log odds of
    `torque_scale`, those of all logs together. Where gravity is surely in the torque, to add it once more would be
    answered with another payload.

    Args:
        logs: of one robot whose controller reports tau − g(q) [N·m]: a run and its tare.
        arm: with its base's orientation.
        payload: what the controller was set to carry, about the arm's payload frame; None: nothing.

    Raises:
        RecordingError: their torque has gravity in it.
    """
    restored = tuple(with_gravity(log, arm, payload) for log in logs)
    odds = [_log_odds(log, other, arm) for log, other in zip(logs, restored, strict=True)]
    if sum(odds) > OTHER_FORM:
        surest = logs[odds.index(max(odds))]
        raise RecordingError(
            f"{surest.source}: tau seems to have gravity in it already: expected torque from which a controller has "
            "taken gravity; leave `compensated` out, or check how the base is mounted (--gravity)"
        )
    return restored


def _log_odds(log: Recording, restored: Recording, arm: Arm) -> float:
    """Of torque that has gravity in it over torque without."""
    has_it, has_not = torque_scale(log, arm), torque_scale(restored, arm)
    return 0.0 if has_it is None or has_not is None else has_it.evidence - has_not.evidence
