"""What is said beside an answer: what is missing, a tare or another motion, and what rests on the prior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.arms.tellable import tellable
from armload.arms.units import unit_of
from armload.identification.tare_age import in_words
from armload.identification.thresholds import KNOWN, MOVES, NOMINAL, PAUSE_SAID
from armload.inertia import NAMES, SHRINK, Z95
from armload.recording import Recording, blocks

RECORD = "record the arm as it is, without the payload, on any motion of 20 s, and name the log with --tare"


def of_readers(*logs: Recording) -> tuple[str, ...]:
    """What the readers of some logs did; what they did to several alike is said once."""
    of: dict[str, list[str]] = {}
    for log in logs:
        for note in log.notes:
            alike = note.removeprefix(log.source)
            of.setdefault(alike, []).extend([log.source] if alike != note else [])
    return tuple(_together(sources) + alike for alike, sources in of.items())


def _together(names: list[str]) -> str:
    """The names of a few logs, or of one and how many others there are."""
    return f"{names[0]} and {len(names) - 1} other logs" if len(names) > 2 else " and ".join(names)


MAY_CHANGE = (
    "the payload may change within the log, by a little: its first and its last part do not quite agree; the answer "
    "takes it for the same throughout: record it once more if nothing was taken up or put down"
)


SHIFTS = (
    "what is held weighs the same before and after a change within the log, as far as it tells: it shifts, as a part "
    "does that slips or a gripper that opens, at once or slowly, or the arm's base moves, or it was exchanged; the "
    "answer takes it for rigid in each part: if it may shift, hold it tighter, and record it once more"
)


def torques_drift(arm: Arm, joint: int, torque: float, parts: int) -> str:
    """That the torques drift within a log of so many parts, most of all that of a joint, from 1, by `torque`."""
    where = "the log" if parts == 1 else "a part of the log"
    unit = unit_of("torque", arm.limits.slides[joint - 1])
    return (
        f"the torques drift within {where}, most of all that of joint {joint}, by {torque:+.2g} {unit} from its start "
        "to its end: an arm that warms up, a sensor that fails, or a payload that is filled or poured out; the answer "
        f"takes both for the same {'throughout' if parts == 1 else 'throughout each part'}: record it once more"
    )


ALLOWED = (
    "this log fits better with the noise of its velocities taken out and friction that grows with the load allowed "
    "for: the answer is made so"
)


MANY_POSES = (
    "the log goes to so many poses that the arm's own error was sought among three times as many functions of the "
    "pose: with fewer, something looked wrong"
)


UNCHECKED = (
    "the intervals of an answer made so were checked with a tare, and without a profile, only: they may be too narrow; "
    "record a tare"
)


# a torque that a controller works out, not one that a sensor measures
COMPUTED = (
    "no joint that moves shows friction, as every torque does that is measured: if tau is computed, a desired or a "
    "model's torque, what is held is not in it"
)


def lacking(
    arm: Arm,
    tared: bool,
    determined: NDArray[np.bool_],
    known_arm_std: NDArray[np.float64] | None,
    weak_std: NDArray[np.float64],
) -> list[str]:
    """What to do about what the log does not determine, the first thing first.

    Args:
        tared: whether there was a tare. determined: which parameters (10,) the log determines.
        known_arm_std: standard deviation (10,), were the arm known exactly: a tare can tell no more. None: not known.
        weak_std: standard deviation (10,) before the log.
    """
    notes = []
    nominal = not tared and arm.link_spread >= NOMINAL
    if nominal:
        notes.append(
            f"record a tare: the figures of this arm's links are nominal, and their errors count as payload ({RECORD})"
        )
    never = ~determined & ~tellable(arm)
    if never.any():
        notes.append(
            f"no motion of this arm determines {_names(never)}: its joints do not feel them, or not each by itself; "
            "what was known before is reported for them; say what else is known of the payload (--mass, --com, --body)"
        )
    missing = ~determined & ~never
    if known_arm_std is None or tared:
        if missing.any():
            notes.append(
                f"this motion does not determine {_names(missing)}: what was known before is reported for them"
            )
        return notes
    hidden = missing & (known_arm_std <= KNOWN * weak_std / SHRINK)
    still = missing & ~hidden
    if hidden.any():
        record = "a tare" if nominal else f"a tare ({RECORD})"
        notes.append(
            f"errors of the arm's model hide {_names(hidden)} from this log: {record} is missing, or a faster motion "
            "of the wrist; what was known before is reported for them"
        )
    if still.any():
        notes.append(
            f"this motion does not determine {_names(still)}, with a tare or without: move the wrist faster and "
            "further; what was known before is reported for them"
        )
    return notes


def without_mass(arm: Arm) -> list[str]:
    """That the description leaves out what some links weigh, which then counts as payload.

    But for what the first joint moves: it turns about the vertical, or slides, and bears no weight.
    """
    joints = [name for name, phi in zip(arm.joint_names[1:], arm.link_parameters[1:], strict=True) if phi[0] == 0.0]
    if not joints:
        return []
    return [
        f"the description of {arm.name} gives no mass to what {', '.join(joints)} move{'s' * (len(joints) == 1)}: what "
        "that weighs counts as payload; complete the description, or record a tare"
    ]


def leaning_on_prior(leaning: NDArray[np.bool_], families: Sequence[str] = ()) -> list[str]:
    """That the intervals of some parameters (10,) rest on a learned prior. families: of which the payload is."""
    if not leaning.any():
        return []
    if families:
        return [
            f"the intervals of {_names(leaning)} rest on what payloads of the kind given ({', '.join(families)}) are "
            "usually like more than on this log"
        ]
    return [
        f"the intervals of {_names(leaning)} rest on what payloads are usually like more than on this log: for a wide "
        "and thin payload (a tray, a frame) use --method map-gp"
    ]


def not_rigid(restlessness: float, joint: int = 0) -> str:
    """That what is held seems to move on its own. joint: whose torque is the most restless, from 1; 0: not known."""
    which = f", most of all that of joint {joint}" if joint else ""
    return (
        f"the torques are {restlessness:.1f} times as restless with the payload as they should be{which}: part of it "
        "seems to swing, slosh or slip, the arm touches something, or a torque is wrong (its sensor, or late); the "
        "intervals are those of a rigid body: hold it tighter, move more slowly, or look at that torque in another log"
    )


def less_than_nothing(mass: float, std: float, relative_to: str) -> str:
    """That something may have been taken off: by an estimate mass ± std [kg] that is likely negative, not surely."""
    since = f" since the {relative_to}" if relative_to in ("tare", "profile") else ""
    return (
        f"something may have been taken off{since}: the mass would be {mass:.2g} ± {Z95 * std:.2g} kg (95 %), and the "
        "answer is the nearest body"
    )


def paused(recording: Recording) -> tuple[str, ...]:
    """That a log pauses for so long that the payload may have been another before, if it does."""
    steps = np.diff(recording.t)
    long = np.flatnonzero(steps > PAUSE_SAID)
    if not long.size:
        return ()
    k = long[np.argmax(steps[long])]
    often = "" if long.size == 1 else f"{long.size} times, the longest "
    length = f"{steps[k]:.1f} s" if steps[k] < 120.0 else in_words(float(steps[k]))
    return (
        f"the log pauses {often}for {length}, {recording.t[k] - recording.t[0]:.1f} s after its start: nothing "
        "is known of what was taken up or put down meanwhile; if it is not of one payload, cut it there",
    )


def rested(recording: Recording, arm: Arm) -> tuple[str, ...]:
    """That an arm stands at the end for as long as an exchange takes, where its torque does not show one."""
    rests = _stands_at_the_end(recording) if arm.motor_torque else 0.0
    if rests < PAUSE_SAID:
        return ()
    return (
        f"the arm stands in the last {rests:.1f} s: what is taken up or put down there hardly shows in the motors' "
        "torque; let the arm move on after it",
    )


def _stands_at_the_end(recording: Recording) -> float:
    """How long [s]; 0 where the arm never moves."""
    for rows in reversed(list(blocks(len(recording)))):
        moved = np.flatnonzero(np.abs(recording.q[rows] - recording.q[-1]).max(axis=1) > MOVES)
        if moved.size:
            return float(recording.t[-1] - recording.t[rows.start + moved[-1]])
    return 0.0


def learned_from(session: str) -> str:
    """That a log is asked with a profile which knows it already."""
    return (
        f"the profile is learned from these very measurements ({session}): what they say counts twice, and the "
        "intervals are too narrow; ask another log, or a profile without it"
    )


MOTOR_PROFILE = (
    "the intervals of answers with a profile were checked for arms whose torque is measured behind the gears only: of "
    "motor currents they may be too narrow; record a tare of today and leave the profile out"
)


def changed_within(times: list[float], part: int, parts: int) -> str:
    """That the payload changes within a log, when, and which part, from 1, the answer is of."""
    when = ", ".join(f"{t:.2f}" for t in times)
    others = "`segments` of the JSON, or a survey's other rows, have the others"
    which = f"the last of {parts} parts, what is held at the end" if part == parts else f"part {part} of {parts}"
    return (
        f"the payload changes within the log, {when} s after its start: the answer is of {which}; {others}; "
        "if nothing was taken up or put down, something pushed the arm, or a torque is wrong"
    )


def _names(which: NDArray[np.bool_]) -> str:
    return ", ".join(name for name, one in zip(NAMES, which, strict=True) if one)
