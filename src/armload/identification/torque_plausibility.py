"""Is the torque of a log that of this arm? Missing, frozen, too large, of another arm, in another unit."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armload.arms import ARMS, Arm, rated_effort
from armload.arms.units import called, unit_of
from armload.errors import RecordingError
from armload.identification.compensated import check_gravity_was_missing
from armload.identification.exchanged import (
    check_for_exchanged_joints,
    check_for_exchanged_torques,
)
from armload.identification.mounting import better_gravity, check_mounted_as_given, likelier_gravity
from armload.identification.thresholds import (
    CURRENT_HIGH,
    CURRENT_LOW,
    CURRENT_USUAL,
    EFFORT,
    EFFORT_EVER,
    EFFORT_SHARE,
    FROZEN_LONGER,
    FROZEN_MOTION,
    FROZEN_TIME,
    MODEL_ERROR,
    MODEL_MISFIT,
    NO_TORQUE,
    OTHER_FORM,
    PARTS_SHARE,
    SWAPPED_MISFIT,
    SWAPPED_SHARE,
)
from armload.identification.torque_scale import TorqueScale, log_odds_of_change, torque_scale
from armload.recording import Recording, blocks, largest, parts_of, span

# of the arm's own torque: of what holds less the percentage is said
_NEARLY_NONE = 0.25
# [log odds] that must be left for a torque without gravity where viscous friction and rotors may be in it: of 85 sound
# logs of a simulator that is not ours at most -0.1; 50 of 54 without gravity that are beyond `OTHER_FORM` have more
_STILL = 0.5
# values of a torque that are held longest, and the longest stretches of each: what is looked at, however long a log is
_MOST_HELD, _MOST_STRETCHES = 20, 200


def check_torque(recording: Recording, arm: Arm) -> None:
    """Refuse torque that no log of this arm holds.

    Raises:
        RecordingError: one sentence that names the place.
    """
    _check_effort(recording, arm)
    if recording.channel == "measured":  # the others need not hold the arm's own weight
        check_gravity_was_missing([recording], arm)
        _check_torque_goes_on(recording)
        _check_no_torque_is_dead(recording)
        _check_no_torque_stands_still(recording, arm)
        _check_torque_is_the_arms(recording, arm)


def _check_effort(recording: Recording, arm: Arm) -> None:
    most, at = largest(recording.tau)
    if recording.channel == "measured" and most.max() < NO_TORQUE:
        rows = np.linspace(0, len(recording) - 1, 20).round().astype(int)
        if np.abs(arm.torque(recording.q[rows])).max() > 1.0:
            raise RecordingError(
                f"{recording.source}: tau is zero in all joints and rows although {arm.name} has weight to hold: "
                "expected the measured joint torque in N·m, gravity included"
            )
    beyond = sum((np.abs(tau) / arm.limits.effort > EFFORT).sum(axis=0) for tau in parts_of(recording.tau))
    if np.any(beyond > EFFORT_SHARE * len(recording)) or np.any(most > EFFORT_EVER * arm.limits.effort):
        j = int(np.argmax(most / arm.limits.effort))
        k = at[j]
        tau = float(recording.tau[k : k + 1][0, j])
        unit, what = unit_of("torque", arm.limits.slides[j]), called("torque", arm.limits.slides[j])
        raise RecordingError(
            f"{recording.source}: tau{j + 1} = {tau:.4g} at {row_of(recording, k)} is "
            f"{most[j] / arm.limits.effort[j]:.3g} times the limit of {arm.joint_names[j]} "
            f"({arm.limits.effort[j]:g} {unit}): expected joint {what} in {unit} of {arm.name}"
        )


def _check_torque_goes_on(recording: Recording) -> None:
    """Refuse torque that repeats itself exactly in all joints while the arm moves: its sensor or logger stood still."""
    for first, last in _repeats(recording, slice(None))[0]:
        time = recording.t[last] - recording.t[first]
        if time > FROZEN_TIME and np.any(span(recording.q, slice(first, last + 1)) > FROZEN_MOTION):
            raise RecordingError(
                f"{recording.source}: tau stays exactly the same in all joints from {row_of(recording, first)} for "
                f"{time:.2f} s although the arm moves: expected the torque of every moment; remove the rows"
            )


def _repeats(recording: Recording, joints: slice) -> tuple[NDArray[np.intp], float]:
    """First and last row (K, 2) of each stretch in which the torques of some joints are exactly the same.

    And the smallest step between two rows of them [N·m]: what they are rounded to, or less.
    """
    same, least = np.zeros(len(recording) + 1, dtype=np.int8), np.inf
    for part in blocks(len(recording)):
        rows = slice(max(part.start - 1, 0), part.stop)
        step = np.abs(np.diff(recording.tau[rows][:, joints], axis=0)).max(axis=1)
        same[rows.start + 1 : rows.stop] = step == 0.0
        least = min(least, step[step > 0.0].min(initial=np.inf))
    edges = np.diff(same)
    return np.column_stack([np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)]), float(least)


def _check_no_torque_stands_still(recording: Recording, arm: Arm) -> None:
    """Refuse a torque that is held at one value, as no measured one is, while its joint moves.

    It is held for longer than `FROZEN_TIME` in all, while the joint moves by more than `FROZEN_MOTION`. And either what
    the arm itself asks of it changes in a stretch by more than a model error and ten times what the torque is rounded
    to. Or, of a torque that is rounded to less than a tenth of a model error, no other value is held a tenth as long.
    """
    error = MODEL_ERROR * rated_effort(arm)
    for j in range(recording.n):
        stretches, least = _repeats(recording, slice(j, j + 1))
        values, which = np.unique(recording.tau[stretches[:, 0]][:, j], return_inverse=True)
        lasting = recording.t[stretches[:, 1]] - recording.t[stretches[:, 0]]
        held = np.bincount(which, lasting, len(values))
        for k in np.argsort(-held)[:_MOST_HELD]:
            if held[k] <= FROZEN_TIME:
                break
            mine = np.flatnonzero(which == k)
            mine = stretches[np.sort(mine[np.argsort(-lasting[mine])[:_MOST_STRETCHES]])]
            rows = np.linspace(mine[:, 0], mine[:, 1], 5).round().astype(int)  # (5, M)
            moved = np.ptp(recording.q[rows.ravel()][:, j].reshape(rows.shape), axis=0)
            if moved.sum() <= FROZEN_MOTION:
                continue
            own = np.ptp(arm.torque(recording.q[rows.ravel()])[:, j].reshape(rows.shape), axis=0)
            alone = FROZEN_LONGER * least < error[j] and held[k] > FROZEN_LONGER * np.delete(held, k).max(initial=0.0)
            if alone or own.max() > error[j] + FROZEN_LONGER * least:
                unit = unit_of("torque", arm.limits.slides[j])
                raise _held_torque(recording, j, f"{values[k]:.4g} {unit}", float(values[k]), mine, float(held[k]))


def _held_torque(
    recording: Recording, j: int, shown: str, value: float, rows: NDArray[np.intp], time: float
) -> RecordingError:
    """That the torque of joint j is held at a value, shown so, in stretches of rows (M, 2), `time` [s] in all."""
    low = min(float(tau[:, j].min()) for tau in parts_of(recording.tau))
    high = max(float(tau[:, j].max()) for tau in parts_of(recording.tau))
    if value in (low, high):
        end = f"its {'largest' if value == high else 'least'} value, for {time:.2f} s in all"
        return RecordingError(
            f"{recording.source}: tau{j + 1} is exactly {shown}, {end}, first at "
            f"{row_of(recording, rows[0, 0])}, although joint {j + 1} moves: its sensor or logger is at its limit; "
            "expected the torque of every moment; record a slower motion, or a lighter payload"
        )
    first, last = rows[np.argmax(rows[:, 1] - rows[:, 0])]
    return RecordingError(
        f"{recording.source}: tau{j + 1} stays exactly the same from {row_of(recording, first)} for "
        f"{recording.t[last] - recording.t[first]:.2f} s although joint {j + 1} moves: expected the torque of every "
        "moment; remove the rows"
    )


def _check_no_torque_is_dead(recording: Recording) -> None:
    """Refuse a torque that is exactly the same in all rows although its joint moves, beside others that are alive."""
    dead = span(recording.tau) == 0.0
    moves = span(recording.q) > FROZEN_MOTION
    if np.any(dead & moves) and not np.all(dead):
        j = int(np.flatnonzero(dead & moves)[0])
        value = recording.tau[:1][0, j] + 0.0  # no -0
        raise RecordingError(
            f"{recording.source}: tau{j + 1} is {value:.4g} in all rows although q{j + 1} moves: "
            "expected the measured joint torque in N·m; the channel is dead, or another one was meant"
        )


def _check_torque_is_the_arms(recording: Recording, arm: Arm) -> None:
    fit = torque_scale(recording, arm)
    if fit is None:
        return
    check_for_exchanged_torques(recording, arm, fit)
    check_for_exchanged_joints(recording, arm)
    if (fit.is_wrong or fit.misfit > MODEL_MISFIT) and _sound_in_parts(recording, arm, fit):
        return
    if arm.motor_torque:
        _check_form(recording, arm, fit)
    if fit.is_wrong:
        check_mounted_as_given(recording, arm, likelier_gravity(recording, arm, partial(torque_scale, recording, arm)))
        if ARMS.get(arm.known_as or "") is None and 1.0 / CURRENT_HIGH < fit.scale < 1.0 / CURRENT_LOW:
            raise _currents(recording, arm, fit)  # its gears and sensors are not described: the size says so by itself
        if fit.is_negative:
            what = "has the opposite sign of"
        elif fit.scale < _NEARLY_NONE:
            what = f"holds only {max(fit.scale, 0.0):.0%} of"
        else:
            what = f"is {fit.scale:.2f} times"
        raise RecordingError(
            f"{recording.source}: tau {what} the torque {arm.name} needs to carry itself: expected the measured joint "
            "torque in N·m, gravity included; check the robot, the unit, the torque channel and the base (--gravity)"
        )
    if fit.misfit > MODEL_MISFIT:
        sound = min(SWAPPED_MISFIT, SWAPPED_SHARE * fit.misfit)
        check_mounted_as_given(recording, arm, better_gravity(recording, arm, lambda other: other.misfit < sound))
        raise RecordingError(
            f"{recording.source}: tau does not fit {arm.name} with any payload (misfit {fit.misfit:.1f} times a sound "
            "robot's): expected a log of this robot; check the robot, the order of the joints and the base (--gravity)"
        )


def _sound_in_parts(recording: Recording, arm: Arm, seen: TorqueScale, deeper: bool = True) -> bool:
    """Whether a log fits far better in its thirds than as a whole, all but one, and that one likewise in its thirds.

    A payload that changes within a log may look like any share of the arm's own torque in a small motion, and like no
    arm in a large one, but not in the parts before and after; what is wrong with a log's unit or robot is wrong in its
    parts, too, and what goes wrong within a log is wrong in what follows, where that is long enough to tell.
    """
    edges = np.linspace(recording.t[0], recording.t[-1], 4)
    parts = [recording.between(begin, end) for begin, end in pairwise(edges)]
    fits = [torque_scale(part, arm) for part in parts]
    told = [fit is not None and not fit.is_wrong and fit.misfit < PARTS_SHARE * seen.misfit for fit in fits]
    untold = [fit is None and not deeper for fit in fits]  # a ninth may be too short to say anything
    other = [part for part, a, b in zip(parts, told, untold, strict=True) if not (a or b)]
    return not other or (len(other) == 1 and (not deeper or _sound_in_parts(other[0], arm, seen, False)))


def _check_form(recording: Recording, arm: Arm, seen: TorqueScale) -> None:
    """Refuse motor currents, and torque without gravity, by name, of arms whose controllers report either.

    The form that explains the log best is the one it has, where neither the torque, with one payload or one that
    changes, nor any share of it does as well. The payload that the controller was set to is not known here; the arm's
    own gravity is most of it.
    """
    facts = ARMS.get(arm.known_as or "")
    constants = (facts and facts.torque_constants) or (CURRENT_USUAL,) * arm.n
    forms = {
        "currents": partial(torque_scale, recording, arm, np.array(constants)),
        "compensated": partial(torque_scale, recording, arm, lacks=arm.torque),
    }
    fits = {name: form() for name, form in forms.items()}
    sound = {
        name: fit.evidence
        for name, fit in fits.items()
        if fit is not None and fit.is_determined and not fit.is_wrong and fit.misfit <= MODEL_MISFIT
    }
    likeliest = max(sound, key=lambda name: sound[name], default="")
    if not likeliest or sound[likeliest] < max(seen.evidence + OTHER_FORM, seen.best):
        return
    if sound[likeliest] < seen.evidence + log_odds_of_change(recording, arm) + OTHER_FORM:
        return
    if likeliest == "currents":
        check_mounted_as_given(recording, arm, likelier_gravity(recording, arm, forms[likeliest]))
        raise _currents(recording, arm, seen)
    with_it, without = (torque_scale(recording, arm, lacks=lacks, gears=True) for lacks in (None, arm.torque))
    if with_it and without and without.evidence < with_it.evidence + _STILL:
        return  # what moves to and fro accelerates against its position: rotors look like gravity that lacks
    check_mounted_as_given(recording, arm, likelier_gravity(recording, arm, forms[likeliest]))
    raise RecordingError(
        f"{recording.source}: tau seems to have gravity taken out: expected the measured joint torque in N·m, gravity "
        "included; say what the controller was set to carry (--compensated nothing, or a payload's file; of a ROS 2 "
        "topic ?compensated=…), or how the base is mounted (--gravity) if gravity is in it"
    )


def _currents(recording: Recording, arm: Arm, seen: TorqueScale) -> RecordingError:
    """That these are motor currents, and what to do."""
    facts = ARMS.get(arm.known_as or "")
    if facts is None or facts.torque_constants is None:
        n = arm.n
        how = f'--columns "torque_constants=…", {n} numbers in N·m/A at the joint, from the maker, multiplies them'
    else:
        each = ", ".join(f"{k:g}" for k in facts.torque_constants)
        how = f"--columns tau_unit=A multiplies each by its joint's torque constant ({each} N·m/A)"
    less = f"holds only {max(seen.scale, 0.0):.0%} of" if seen.is_wrong else "is not"
    return RecordingError(
        f"{recording.source}: tau {less} the torque {arm.name} needs to carry itself: these look like currents, in A; "
        f"expected joint torque in N·m: {how}"
    )


def row_of(recording: Recording, k: int | np.integer) -> str:
    return f"row {int(k)} (t = {recording.t[int(k)]:.4f} s)"
