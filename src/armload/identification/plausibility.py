"""Is this log what it claims to be? Units, columns, limits and the arm, checked before anything is identified.

Every test is meant to pass any sound log of the right arm, with noise, gaps, low rates, motor-side friction and
payloads up to twice the rated one, and to refuse what would give a wrong answer without a sign of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import ARMS, Arm
from armload.errors import RecordingError
from armload.identification.exchanged import check_for_exchanged_torques
from armload.identification.thresholds import (
    ANY_SPEED,
    CURRENT_HIGH,
    CURRENT_LOW,
    DEGREES_FROM,
    EFFORT,
    EFFORT_EVER,
    EFFORT_SHARE,
    FROZEN_MOTION,
    FROZEN_TIME,
    JUMP,
    MODEL_MISFIT,
    NO_TORQUE,
    NOT_DERIVATIVE,
    POSITION_TOLERANCE,
    SCALE_SURE,
    SPEED,
    WINDOW_MOVES,
)
from armload.identification.torque_scale import TorqueScale, torque_scale
from armload.recording import Recording, blocks, with_gravity
from armload.recording.columns import check_joint_count
from armload.recording.windows import integrals, windows

_DEGREE = 180.0 / np.pi
_FULL_TURN = 2.0 * np.pi
# of the arm's own torque: of what holds less the percentage is said; where that may be none, gravity was taken out
_NEARLY_NONE = 0.25


def check_plausible(recording: Recording, arm: Arm) -> None:
    """Refuse a log that is not a log of this arm in SI units; the rows in messages count from 0.

    Raises:
        RecordingError: another number or other names of joints; degrees; positions outside the limits; positions that
            jump; dq that is not the derivative of q (unit, sign, swapped columns, time in milliseconds); too fast;
            torque missing, frozen, too large, or not that of this arm (wrong arm, unit, sign, base orientation,
            exchanged columns, or a channel without gravity). One sentence that names the place.
    """
    _check_joints(recording, arm)
    _check_radians(recording, arm)
    _check_jumps(recording, arm)
    _check_limits(recording, arm)
    _check_velocity_is_derivative(recording)
    _check_speed(recording, arm)
    _check_effort(recording, arm)
    if recording.channel == "measured":  # the others need not hold the arm's own weight
        _check_torque_goes_on(recording)
        _check_no_torque_is_dead(recording)
        _check_torque_is_the_arms(recording, arm)


def _check_joints(recording: Recording, arm: Arm) -> None:
    check_joint_count(recording.n, recording.source, arm)
    names = recording.joint_names
    if names is not None and tuple(names) != arm.joint_names:
        same = "in another order" if sorted(names) == sorted(arm.joint_names) else "of another arm"
        raise RecordingError(
            f"{recording.source} has joints {same} ({', '.join(names)}): expected {', '.join(arm.joint_names)}; read "
            f"the log for {arm.name}, or name the robot that made it"
        )


def _check_radians(recording: Recording, arm: Arm) -> None:
    """Most rows outside the limits, several angles beyond a full turn, and none outside once taken as degrees."""
    outside, fits = 0, True
    for q in _parts(recording.q):
        outside += int(np.any(_beyond(q, arm) > POSITION_TOLERANCE, axis=1).sum())
        fits = fits and bool(np.all(_beyond(q / _DEGREE, arm) <= POSITION_TOLERANCE))
    largest, rows = _largest(recording.q)
    if outside > 0.5 * len(recording) and np.sum(largest > DEGREES_FROM) >= min(2, arm.n) and fits:
        j = int(np.argmax(largest))
        k = rows[j]
        q = float(recording.q[k : k + 1][0, j])
        raise RecordingError(
            f"{recording.source}: positions look like degrees (q{j + 1} = {q:.4g} at {_row(recording, k)}): "
            "expected radians; of a table say so with --columns q_unit=deg,dq_unit=deg/s, else multiply by pi/180"
        )


def _check_limits(recording: Recording, arm: Arm) -> None:
    first = 0
    for q in _parts(recording.q):
        bad = np.argwhere(_beyond(q, arm) > POSITION_TOLERANCE)
        if not len(bad):
            first += len(q)
            continue
        k, j = first + bad[0][0], bad[0][1]
        low, high = arm.limits.position_low[j], arm.limits.position_high[j]
        raise RecordingError(
            f"{recording.source}: q{j + 1} = {q[bad[0][0], j]:.4f} rad at {_row(recording, k)} is outside the limits "
            f"of {arm.name}'s {arm.joint_names[j]} ({low:.4f} to {high:.4f} rad): expected the joint positions of this "
            "robot; check the robot, the order of the joints and the unit"
        )


def _beyond(q: NDArray[np.float64], arm: Arm) -> NDArray[np.float64]:
    """How far positions (N, n) lie outside the limits [rad]; −inf where there is no limit."""
    return np.maximum(arm.limits.position_low - q, q - arm.limits.position_high)


def _check_jumps(recording: Recording, arm: Arm) -> None:
    speed = np.where(np.isfinite(arm.limits.velocity), arm.limits.velocity, ANY_SPEED)
    for part in blocks(len(recording)):
        rows = slice(max(part.start - 1, 0), part.stop)
        step = np.diff(recording.t[rows])[:, None]
        jump = np.abs(np.diff(recording.q[rows], axis=0))
        bad = np.argwhere(jump > SPEED * speed * step + JUMP)
        if not len(bad):
            continue
        k, j = bad[0]
        wrap = " (a full turn: unwrap the angle)" if abs(jump[k, j] - _FULL_TURN) < 0.3 else ""
        raise RecordingError(
            f"{recording.source}: q{j + 1} jumps by {jump[k, j]:.3f} rad in {step[k, 0]:.4g} s at "
            f"{_row(recording, rows.start + k + 1)}{wrap}: expected a continuous motion; remove the rows or "
            "split the log there"
        )


def _check_velocity_is_derivative(recording: Recording) -> None:
    """Compare the change of q over short windows with the integral of dq, which noise hardly touches."""
    parts = windows(recording)
    if len(parts.first) < 3:
        return
    change = recording.q[parts.last] - recording.q[parts.first]
    integral = integrals(recording, lambda rows: recording.dq[rows], parts)
    size_q, size_dq = _rms(change), _rms(integral)
    moves = np.maximum(size_q, size_dq) > WINDOW_MOVES
    difference = _rms(change - integral) / np.maximum(np.maximum(size_q, size_dq), WINDOW_MOVES)
    wrong = np.flatnonzero(moves & (difference > NOT_DERIVATIVE))
    if len(wrong) == 0:
        return
    j = int(wrong[0])
    what = f"dq{j + 1} is not the derivative of q{j + 1}"
    if size_dq[j] < 1e-3 * size_q[j]:
        what = f"dq{j + 1} is zero although q{j + 1} moves"
    raise RecordingError(f"{recording.source}: {what}: {_why_not_derivative(change, integral, wrong)}")


def _why_not_derivative(change: NDArray, integral: NDArray, wrong: NDArray) -> str:
    """The likeliest cause, judged over all joints concerned."""
    likeness = np.array([[_likeness(change[:, j], integral[:, i]) for i in range(change.shape[1])] for j in wrong])
    own = likeness[np.arange(len(wrong)), wrong]
    if np.all(np.abs(own) > 0.9):
        factor = float(np.median([change[:, j] @ integral[:, j] / (integral[:, j] @ integral[:, j]) for j in wrong]))
        for value, cause in (
            (-1.0, "it has the opposite sign; turn it around"),
            (1.0 / _DEGREE, "it looks like degrees per second: --columns dq_unit=deg/s"),
            (_DEGREE, "q looks like degrees: --columns q_unit=deg"),
            (1e-3, "t looks like milliseconds; divide it by 1000"),
            (1e-6, "t looks like microseconds; divide it by 1e6"),
            (1e-9, "t looks like nanoseconds; divide it by 1e9"),
            (np.pi / 30.0, "it looks like revolutions per minute; multiply dq by pi/30"),
        ):
            if abs(factor / value - 1.0) < 0.25:
                return f"expected rad, rad/s and s, but {cause}"
        return f"the derivative is {factor:.3g} times dq; expected rad, rad/s and s"
    for row, j in enumerate(wrong):
        i = int(np.argmax(likeness[row]))
        if i != j and likeness[row, i] > 0.9:
            return (
                f"it is that of another joint (dq{i + 1} fits q{j + 1}); expected the joints of q and dq in one order"
            )
    return "expected the measured joint velocity in rad/s; check the columns, their units and the time"


def _check_speed(recording: Recording, arm: Arm) -> None:
    limit = arm.limits.velocity
    count, found = 0, None
    for part in blocks(len(recording)):
        bad = np.argwhere(np.abs(recording.dq[part]) > SPEED * limit)
        count += len(bad)
        if found is None and len(bad):
            found = part.start + int(bad[0][0]), int(bad[0][1])
    if found is not None:
        k, j = found
        speed = float(recording.dq[k : k + 1][0, j])
        degrees = np.all(np.percentile(np.abs(recording.dq[:]), 99, axis=0) / _DEGREE < limit)
        unit = "; q and dq look like degrees" if degrees and count > 0.05 * len(recording) else ""
        raise RecordingError(
            f"{recording.source}: dq{j + 1} = {speed:.4g} rad/s at {_row(recording, k)} is more than "
            f"{SPEED:g} times the limit of {arm.joint_names[j]} ({limit[j]:.4g} rad/s): expected rad/s of "
            f"{arm.name}{unit}"
        )


def _check_effort(recording: Recording, arm: Arm) -> None:
    largest, at = _largest(recording.tau)
    if recording.channel == "measured" and largest.max() < NO_TORQUE:
        rows = np.linspace(0, len(recording) - 1, 20).round().astype(int)
        if np.abs(arm.torque(recording.q[rows])).max() > 1.0:
            raise RecordingError(
                f"{recording.source}: tau is zero in all joints and rows although {arm.name} has weight to hold: "
                "expected the measured joint torque in N·m, gravity included"
            )
    beyond = sum((np.abs(tau) / arm.limits.effort > EFFORT).sum(axis=0) for tau in _parts(recording.tau))
    if np.any(beyond > EFFORT_SHARE * len(recording)) or np.any(largest > EFFORT_EVER * arm.limits.effort):
        j = int(np.argmax(largest / arm.limits.effort))
        k = at[j]
        tau = float(recording.tau[k : k + 1][0, j])
        raise RecordingError(
            f"{recording.source}: tau{j + 1} = {tau:.4g} at {_row(recording, k)} is "
            f"{largest[j] / arm.limits.effort[j]:.3g} times the limit of {arm.joint_names[j]} "
            f"({arm.limits.effort[j]:g} N·m): expected joint torque in N·m of {arm.name}"
        )


def _check_torque_goes_on(recording: Recording) -> None:
    """Refuse torque that repeats itself exactly in all joints while the arm moves: its sensor or logger stood still."""
    same = np.zeros(len(recording) + 1, dtype=np.int8)
    for part in blocks(len(recording)):
        rows = slice(max(part.start - 1, 0), part.stop)
        tau = recording.tau[rows]
        same[rows.start + 1 : rows.stop] = np.all(tau[1:] == tau[:-1], axis=1)
    edges = np.diff(same)
    for first, last in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        time = recording.t[last] - recording.t[first]
        if time > FROZEN_TIME and np.any(_span(recording.q, slice(first, last + 1)) > FROZEN_MOTION):
            raise RecordingError(
                f"{recording.source}: tau stays exactly the same in all joints from {_row(recording, first)} for "
                f"{time:.2f} s although the arm moves: expected the torque of every moment; remove the rows"
            )


def _check_no_torque_is_dead(recording: Recording) -> None:
    """Refuse a torque that is exactly the same in all rows although its joint moves, beside others that are alive."""
    dead = _span(recording.tau) == 0.0
    moves = _span(recording.q) > FROZEN_MOTION
    if np.any(dead & moves) and not np.all(dead):
        j = int(np.flatnonzero(dead & moves)[0])
        raise RecordingError(
            f"{recording.source}: tau{j + 1} is {recording.tau[:1][0, j]:.4g} in all rows although q{j + 1} moves: "
            "expected the measured joint torque in N·m; the channel is dead, or another one was meant"
        )


def _check_torque_is_the_arms(recording: Recording, arm: Arm) -> None:
    fit = torque_scale(recording, arm)
    if fit is None:
        return
    check_for_exchanged_torques(recording, arm, fit)
    if fit.is_wrong:
        _check_for_currents(recording, arm, fit.scale)
        _check_for_compensation(recording, arm, fit)
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
        raise RecordingError(
            f"{recording.source}: tau does not fit {arm.name} with any payload (misfit {fit.misfit:.1f} times a sound "
            "robot's): expected a log of this robot; check the robot, the order of the joints and the base (--gravity)"
        )


def _check_for_currents(recording: Recording, arm: Arm, scale: float) -> None:
    """Refuse motor currents in A by name: of a known arm what its torque constants make a sound log of.

    Of an arm whose gears or sensors nobody has described the size alone says so.
    """
    facts = ARMS.get(arm.known_as or "")
    constants = None if facts is None else facts.torque_constants
    if constants is not None:
        torque = replace(recording, tau=recording.tau * np.array(constants))
        fit = torque_scale(torque, arm)
        if fit is None or fit.is_wrong or fit.misfit > MODEL_MISFIT:
            return
        how = f"multiply each by its joint's torque constant ({', '.join(f'{k:g}' for k in constants)} N·m/A)"
    elif facts is not None and facts.torque_side == "link":
        return  # sensors in the joints: there is no current to be logged
    elif not 1.0 / CURRENT_HIGH < scale < 1.0 / CURRENT_LOW:
        return
    else:
        how = "multiply each by its joint's torque constant [N·m/A, at the joint], from the maker"
    raise RecordingError(
        f"{recording.source}: tau holds only {scale:.0%} of the torque {arm.name} needs to carry itself: these look "
        f"like currents, in A; expected joint torque in N·m: {how}"
    )


def _check_for_compensation(recording: Recording, arm: Arm, seen: TorqueScale) -> None:
    """Refuse torque without gravity by name: it holds nothing of the arm's own, and with gravity put back it is sound.

    Only of arms that measure motor current: their controllers report such torque. The payload that the controller was
    set to is not known here; the arm's own gravity is most of it.
    """
    if not arm.motor_torque or abs(seen.scale) > min(SCALE_SURE * seen.std, _NEARLY_NONE):
        return
    fit = torque_scale(with_gravity(recording, arm), arm)
    if fit is None or fit.is_wrong or fit.misfit > MODEL_MISFIT:
        return
    raise RecordingError(
        f"{recording.source}: tau seems to have gravity taken out: expected the measured joint torque in N·m, gravity "
        "included; say what the controller was set to carry (--compensated nothing, or a payload's file)"
    )


def _parts(x: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """x (N, n) a block at a time, as it lies in memory or on disk."""
    return (x[rows] for rows in blocks(len(x)))


def _largest(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[int]]:
    """The largest size of each column (n,), and the first rows that have it."""
    largest, at, first = np.full(x.shape[1], -np.inf), [0] * x.shape[1], 0
    for part in _parts(x):
        size = np.abs(part)
        rows = size.argmax(axis=0)
        for j, k in enumerate(rows.tolist()):
            if size[k, j] > largest[j]:
                largest[j], at[j] = size[k, j], first + k
        first += len(part)
    return largest, at


def _span(x: NDArray[np.float64], rows: slice | None = None) -> NDArray[np.float64]:
    """Largest less smallest of each column (n,), of some rows."""
    inside = slice(0, len(x)) if rows is None else rows
    parts = (slice(inside.start + r.start, inside.start + r.stop) for r in blocks(inside.stop - inside.start))
    low, high = zip(*((part.min(axis=0), part.max(axis=0)) for part in (x[r] for r in parts)), strict=True)
    return np.max(high, axis=0) - np.min(low, axis=0)


def _likeness(a: NDArray, b: NDArray) -> float:
    """Cosine between two signals."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


def _rms(x: NDArray) -> NDArray[np.float64]:
    return np.sqrt(np.mean(x**2, axis=0))


def _row(recording: Recording, k: int | np.integer) -> str:
    return f"row {int(k)} (t = {recording.t[int(k)]:.4f} s)"
