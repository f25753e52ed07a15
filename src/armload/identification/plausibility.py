"""Is this log what it claims to be? Units, columns, limits and the arm, checked before anything is identified.

Every test is meant to pass any sound log of the right arm, with noise, gaps, low rates, motor-side friction and
payloads up to twice the rated one, and to refuse what would give a wrong answer without a sign of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.arms.units import unit_of
from armload.errors import RecordingError
from armload.identification.thresholds import (
    ANY_SPEED,
    DEGREES_FROM,
    JUMP,
    NOT_DERIVATIVE,
    POSITION_TOLERANCE,
    SPEED,
    WINDOW_MOVES,
)
from armload.identification.torque_plausibility import check_torque, row_of
from armload.recording import Recording, blocks, largest, parts_of
from armload.recording.columns import check_joint_count
from armload.recording.windows import integrals, windows

_DEGREE = 180.0 / np.pi
_FULL_TURN = 2.0 * np.pi


def check_plausible(recording: Recording, arm: Arm) -> None:
    """Refuse a log that is not a log of this arm in SI units; the rows in messages count from 0.

    Raises:
        RecordingError: another number or other names of joints; degrees; positions outside the limits; positions that
            jump; times too small; dq that is not the derivative of q (unit, sign, swapped columns, time in
            milliseconds); too fast; torque missing, frozen, too large, or not that of this arm (wrong arm, unit, sign,
            base orientation, exchanged columns, or a channel without gravity). One sentence that names the place.
    """
    _check_joints(recording, arm)
    _check_radians(recording, arm)
    _check_jumps(recording, arm)
    _check_limits(recording, arm)
    _check_velocity_is_derivative(recording, arm)
    _check_speed(recording, arm)
    check_torque(recording, arm)


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
    for q in parts_of(recording.q):
        outside += int(np.any(_beyond(q, arm) > POSITION_TOLERANCE, axis=1).sum())
        fits = fits and bool(np.all(_beyond(np.where(arm.limits.slides, q, q / _DEGREE), arm) <= POSITION_TOLERANCE))
    most, rows = largest(recording.q)
    if outside > 0.5 * len(recording) and np.sum(most > DEGREES_FROM) >= min(2, arm.n) and fits:
        j = int(np.argmax(most))
        k = rows[j]
        q = float(recording.q[k : k + 1][0, j])
        raise RecordingError(
            f"{recording.source}: positions look like degrees (q{j + 1} = {q:.4g} at {row_of(recording, k)}): "
            "expected radians; say so with --columns q_unit=deg,dq_unit=deg/s, or multiply by pi/180"
        )


def _check_limits(recording: Recording, arm: Arm) -> None:
    first = 0
    for q in parts_of(recording.q):
        bad = np.argwhere(_beyond(q, arm) > POSITION_TOLERANCE)
        if not len(bad):
            first += len(q)
            continue
        k, j = first + bad[0][0], bad[0][1]
        low, high, unit = arm.limits.position_low[j], arm.limits.position_high[j], _unit(arm, j)
        raise RecordingError(
            f"{recording.source}: q{j + 1} = {q[bad[0][0], j]:.4f} {unit} at {row_of(recording, k)} is outside the "
            f"limits of {arm.name}'s {arm.joint_names[j]} ({low:.4f} to {high:.4f} {unit}): expected the joint "
            "positions of this robot; check the robot, the order of the joints and the unit"
        )


def _beyond(q: NDArray[np.float64], arm: Arm) -> NDArray[np.float64]:
    """How far positions (N, n) lie outside the limits [rad]; −inf where there is no limit."""
    return np.maximum(arm.limits.position_low - q, q - arm.limits.position_high)


def _unit(arm: Arm, j: np.intp | int) -> str:
    return unit_of("position", arm.limits.slides[j])


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
            f"{recording.source}: q{j + 1} jumps by {jump[k, j]:.3f} {_unit(arm, j)} in {step[k, 0]:.4g} s at "
            f"{row_of(recording, rows.start + k + 1)}{wrap}: expected a continuous motion; remove the rows or "
            "split the log there"
        )


def _check_pace(recording: Recording, arm: Arm) -> None:
    """See that no joint gets farther from where it is first than it can: for logs, or times, too short for windows."""
    speed = np.where(np.isfinite(arm.limits.velocity), arm.limits.velocity, ANY_SPEED)
    start = recording.q[:1][0]
    for part in blocks(len(recording)):
        since = (recording.t[part] - recording.t[0])[:, None]
        bad = np.argwhere(np.abs(recording.q[part] - start) > SPEED * speed * since + JUMP)
        if not len(bad):
            continue
        k, j = part.start + bad[0][0], int(bad[0][1])
        away = abs(float(recording.q[k : k + 1][0, j] - start[j]))
        raise RecordingError(
            f"{recording.source}: q{j + 1} changes by {away:.3f} {_unit(arm, j)} in "
            f"{recording.t[k] - recording.t[0]:.2g} s, which {arm.joint_names[j]} cannot do (its limit is "
            f"{speed[j]:.4g} {_unit(arm, j)}/s): expected s, but t looks too small; "
            "check its unit, --columns t_unit=…"
        )


def _check_velocity_is_derivative(recording: Recording, arm: Arm) -> None:
    """Compare the change of q over short windows with the integral of dq, which noise hardly touches."""
    parts = windows(recording)
    if len(parts.first) < 3:
        _check_pace(recording, arm)
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
    raise RecordingError(
        f"{recording.source}: {what}: {_why_not_derivative(change, integral, wrong)}; where the positions are right, "
        "--columns dq=none takes the velocities from them"
    )


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
            (1e-3, "t looks like milliseconds: --columns t_unit=ms"),
            (1e-6, "t looks like microseconds: --columns t_unit=us"),
            (1e-9, "t looks like nanoseconds: --columns t_unit=ns"),
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
        slides = arm.limits.slides[j]
        seems = degrees and not slides and count > 0.05 * len(recording)
        unit, per_second = "; dq looks like degrees per second" if seems else "", unit_of("velocity", slides)
        raise RecordingError(
            f"{recording.source}: dq{j + 1} = {speed:.4g} {per_second} at {row_of(recording, k)} is more than "
            f"{SPEED:g} times the limit of {arm.joint_names[j]} ({limit[j]:.4g} {per_second}): expected "
            f"{per_second} of {arm.name}{unit}"
        )


def _likeness(a: NDArray, b: NDArray) -> float:
    """Cosine between two signals."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


def _rms(x: NDArray) -> NDArray[np.float64]:
    return np.sqrt(np.mean(x**2, axis=0))
