"""Two torque columns in each other's place: found by the fit of the arm's own torque, before and after."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from armload.arms import Arm
from armload.errors import RecordingError
from armload.identification.thresholds import SWAPPED_MISFIT, SWAPPED_SHARE
from armload.identification.torque_scale import TorqueScale, torque_scale
from armload.recording import Recording


def check_for_exchanged_torques(recording: Recording, arm: Arm, seen: TorqueScale) -> None:
    """Refuse a log that is a sound one with two torque columns exchanged back, and fits far worse as it is.

    Args:
        recording, arm: the log and what it should be of. seen: how its torque fits.

    Raises:
        RecordingError: so it is; the sentence names the two columns.
    """
    if seen.misfit < SWAPPED_MISFIT:
        return
    found = []
    for i, j in combinations(range(recording.n), 2):
        fit = torque_scale(_exchanged(recording, i, j), arm)
        if fit is not None and not fit.is_wrong:
            found.append((fit.misfit, i, j))
    if not found:
        return
    misfit, i, j = min(found)
    if misfit < min(SWAPPED_MISFIT, SWAPPED_SHARE * seen.misfit) and _throughout(recording, arm, i, j):
        raise RecordingError(
            f"{recording.source}: tau{i + 1} and tau{j + 1} seem to be exchanged (misfit {seen.misfit:.1f} times a "
            f"sound robot's, {misfit:.1f} with these two columns the other way round): expected the torques in the "
            f"order of {arm.name}'s joints; exchange them"
        )


def _exchanged(recording: Recording, i: int, j: int) -> Recording:
    order = list(range(recording.n))
    order[i], order[j] = j, i
    return replace(recording, tau=recording.tau[:, order])


def _throughout(recording: Recording, arm: Arm, i: int, j: int) -> bool:
    """Whether each third of a log fits better with two columns exchanged.

    A payload that changes within a log leaves a misfit, too, but not in the parts before and after.
    """
    edges = np.linspace(recording.t[0], recording.t[-1], 4)
    for begin, end in pairwise(edges):
        part = recording.between(begin, end)
        fits = torque_scale(part, arm), torque_scale(_exchanged(part, i, j), arm)
        if fits[0] is not None and fits[1] is not None and fits[1].misfit >= fits[0].misfit:
            return False
    return True
