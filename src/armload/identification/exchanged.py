"""Torque columns, or joints, in each other's place: found by the fit of the arm's own torque, before and after.

Gravity that pulls another way than given, as on a wall, takes joints for each other, too. So no exchange is named where
the base mounted otherwise explains the log better. Torques that are exchanged alone look like joints that are exchanged
whole, and the other way round: of both, what explains the log best is named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from armload.arms import Arm
from armload.errors import RecordingError
from armload.identification.mounting import better_gravity, check_mounted_as_given
from armload.identification.thresholds import (
    EXCHANGED_BY_GEARS,
    JOINTS_EXCHANGED,
    MODEL_MISFIT,
    SWAPPED_MISFIT,
    SWAPPED_SHARE,
)
from armload.identification.torque_scale import FEW_WINDOWS, MOST_WINDOWS, TorqueScale, torque_scale, torque_scales
from armload.recording import Recording


class _Exchange(NamedTuple):
    """Two joints i and j, from 0, in each other's place, how the log fits without it, and whether q and dq are, too."""

    fit: TorqueScale
    i: int
    j: int
    whole: bool


def check_for_exchanged_torques(recording: Recording, arm: Arm, seen: TorqueScale) -> None:
    """Refuse a log that is a sound one with two torque columns exchanged back, and fits far worse as it is.

    Args:
        recording, arm: the log and what it should be of. seen: how its torque fits.

    Raises:
        RecordingError: so it is; the sentence names the two columns, or joints where these explain the log better.
    """
    if seen.misfit < SWAPPED_MISFIT:
        return
    fits = _torque_fits(recording, arm, MOST_WINDOWS)
    if not fits:
        return
    fit, i, j = min(fits, key=lambda found: found[0].misfit)
    misfit = fit.misfit
    enough = misfit < min(SWAPPED_MISFIT, SWAPPED_SHARE * seen.misfit)
    if enough and all(b.misfit < a.misfit for a, b in _in_parts(recording, _torques_exchanged(recording, i, j), arm)):
        check_mounted_as_given(recording, arm, better_gravity(recording, arm, lambda fit: fit.misfit < misfit))
        raise _told(recording, arm, seen, _likeliest(recording, arm) or _Exchange(fit, i, j, False))


def check_for_exchanged_joints(recording: Recording, arm: Arm) -> None:
    """Refuse a log of which the arm's own torque tells that two joints are in each other's place.

    The order of ROS drivers may be that of the alphabet. Wrist joints, which bear little, tell nothing. A log that
    names its joints is not asked.

    Args:
        recording, arm: the log and what it should be of.

    Raises:
        RecordingError: so it is; the sentence names the two joints, or columns where these explain the log better.
    """
    seen = None if recording.joint_names is not None else torque_scale(recording, arm, most=FEW_WINDOWS)
    if seen is None or seen.evidence > -JOINTS_EXCHANGED:  # no evidence is far above 0
        return
    fits = _joint_fits(recording, arm)
    found = [_Exchange(*fitted, True) for fitted in fits if fitted[0].misfit <= MODEL_MISFIT]
    most = max(found, key=lambda exchange: exchange.fit.evidence, default=None)
    if most is None or most.fit.evidence < seen.evidence + JOINTS_EXCHANGED:
        return
    other = _joints_exchanged(recording, most.i, most.j)
    if all(b.evidence > a.evidence for a, b in _in_parts(recording, other, arm)) and _with_gears_too(
        recording, other, arm
    ):
        likeliest = _likeliest(recording, arm) or most
        best = likeliest.fit.evidence
        check_mounted_as_given(recording, arm, better_gravity(recording, arm, lambda fit: fit.evidence > best))
        raise _told(recording, arm, seen, likeliest)


def _likeliest(recording: Recording, arm: Arm) -> _Exchange | None:
    """The exchange that explains a log best: of any two joints, or of their torques alone; None: all are surely wrong.

    Of a log that names its joints, torques alone.
    """
    found = [_Exchange(*fitted, False) for fitted in _torque_fits(recording, arm, FEW_WINDOWS)]
    if recording.joint_names is None:
        found += [_Exchange(*fitted, True) for fitted in _joint_fits(recording, arm)]
    return max(found, key=lambda exchange: exchange.fit.evidence, default=None)


def _told(recording: Recording, arm: Arm, seen: TorqueScale, exchange: _Exchange) -> RecordingError:
    """That a log which fits as `seen` has two joints, or their torques, in each other's place."""
    i, j = exchange.i + 1, exchange.j + 1
    if exchange.whole:
        return RecordingError(
            f"{recording.source}: joints {i} and {j} seem to be exchanged, in q, dq and tau: expected the "
            f"order of {arm.name}'s joints ({', '.join(arm.joint_names)}); a ROS driver may give that of the alphabet; "
            "name the columns, or exchange them"
        )
    return RecordingError(
        f"{recording.source}: tau{i} and tau{j} seem to be exchanged (misfit {seen.misfit:.1f} times a "
        f"sound robot's, {exchange.fit.misfit:.1f} with these two columns the other way round): expected the "
        f"torques in the order of {arm.name}'s joints; exchange them"
    )


def _with_gears_too(recording: Recording, other: Recording, arm: Arm) -> bool:
    """Whether another log fits better with viscous friction and rotors among the unknowns, too.

    Of motor currents they are what makes one wrist joint look like the other.
    """
    as_it_is, exchanged = (torque_scale(log, arm, most=FEW_WINDOWS, gears=True) for log in (recording, other))
    if as_it_is is None or exchanged is None:
        return False
    return exchanged.evidence > as_it_is.evidence + EXCHANGED_BY_GEARS


def _torque_fits(recording: Recording, arm: Arm, most: int) -> list[tuple[TorqueScale, int, int]]:
    """How the log fits with the torques of each pair exchanged, where that is not surely wrong."""
    pairs = list(combinations(range(recording.n), 2))
    orders = [_order(recording.n, i, j) for i, j in pairs]
    return _not_wrong(torque_scales(recording, arm, orders, most), pairs)


def _joint_fits(recording: Recording, arm: Arm) -> list[tuple[TorqueScale, int, int]]:
    """How the log fits with each pair of joints exchanged, where that is not surely wrong, of `FEW_WINDOWS` windows."""
    pairs = list(combinations(range(recording.n), 2))
    others = (_joints_exchanged(recording, i, j) for i, j in pairs)
    return _not_wrong([torque_scale(other, arm, most=FEW_WINDOWS) for other in others], pairs)


def _not_wrong(fits: list[TorqueScale | None], pairs: list[tuple[int, int]]) -> list[tuple[TorqueScale, int, int]]:
    return [(fit, i, j) for fit, (i, j) in zip(fits, pairs, strict=True) if fit is not None and not fit.is_wrong]


def _torques_exchanged(recording: Recording, i: int, j: int) -> Recording:
    return replace(recording, tau=recording.tau[:, _order(recording.n, i, j)])


def _joints_exchanged(recording: Recording, i: int, j: int) -> Recording:
    q, dq, tau = (x[:, _order(recording.n, i, j)] for x in (recording.q, recording.dq, recording.tau))
    return replace(recording, q=q, dq=dq, tau=tau)


def _order(n: int, i: int, j: int) -> list[int]:
    order = list(range(n))
    order[i], order[j] = j, i
    return order


def _in_parts(recording: Recording, other: Recording, arm: Arm) -> Iterator[tuple[TorqueScale, TorqueScale]]:
    """How each third of a log fits, and of another of the same times, where both say anything.

    A payload that changes within a log leaves a misfit, too, but not in the parts before and after.
    """
    for begin, end in pairwise(np.linspace(recording.t[0], recording.t[-1], 4)):
        fits = [torque_scale(log.between(begin, end), arm) for log in (recording, other)]
        if fits[0] is not None and fits[1] is not None:
            yield fits[0], fits[1]
