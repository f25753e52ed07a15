"""One log in, one answer out: which method, relative to what, with which error bars, and what the log cannot tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.arms import arm as arm_named
from armload.errors import IdentificationError
from armload.identification.answer import Identification, Segment
from armload.identification.compensated import check_gravity_was_missing
from armload.identification.found import Asked, found_in
from armload.identification.known_options import families
from armload.identification.many_poses import more_features
from armload.identification.mounting import likelier_gravity, mounted_otherwise
from armload.identification.notes import (
    ALLOWED,
    MANY_POSES,
    MAY_CHANGE,
    MOTOR_PROFILE,
    SHIFTS,
    UNCHECKED,
    changed_within,
    learned_from,
    of_readers,
    paused,
    rested,
    torques_drift,
)
from armload.identification.one_payload import Question, answer_of_one_payload, known_of, plausible_known
from armload.identification.plausibility import check_plausible
from armload.identification.segments import changes_of_payload
from armload.identification.tare_age import drift_since
from armload.identification.thresholds import EXPLAINS, LOWEST_RATE, SETTLED, SWAYS
from armload.identification.torque_scale import torque_scale
from armload.inertia import HELD, Z95, InertialParameters
from armload.payloads import Payload, read_payload
from armload.posterior import KnownCentre, KnownMass, Profile, load_profile
from armload.posterior.drift import CHANGED
from armload.recording import Recording, check_own_measurements, read_recording, steadied
from armload.regression.mismatch import LINK_LOSS
from armload.runtime.one_thread import one_thread


@one_thread()
def identify(
    recording: Recording | str | Path,
    arm: Arm | str | Path,
    *,
    tare: Recording | str | Path | None = None,
    tare_age: float | None = None,
    tool: InertialParameters | Payload | str | Path | None = None,
    mass: KnownMass | tuple[float, float] | None = None,
    com: KnownCentre | tuple[ArrayLike, float] | None = None,
    body: Payload | str | Path | None = None,
    family: str | Sequence[str] | None = None,
    profile: Profile | str | Path | None = None,
    method: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the payload of a log.

    Args:
        recording: measured joint torque (rigid body + friction, gravity included), position and velocity; or the path
            of such a log.
        arm: the bare arm, with the frame and gravity wanted; or the name of a built-in one, or the path of a URDF.
        tare: an earlier log of the same arm, on any motion, with whatever was mounted then; the answer is what was
            added since. It shares no samples with the recording.
        tare_age: time between tare and recording [s]: offsets and friction may have changed meanwhile. None: what the
            logs' own clocks say, or nothing. Whether the arm is as it was at the tare is asked in any case.
        tool: a tool mounted in the recording whose parameters are known, or the path of its file; the answer is what it
            carries. Whether it was mounted at the tare too is found from the tare.
        mass: of what is identified, where it was weighed, and its standard deviation [kg].
        com: its centre of mass (3,), where that is known, in the arm's payload frame, and its standard deviation along
            each axis [m].
        body: all that is known of it, as of a drawing, with how well (`Payload.uncertainty`), or the path of its file.
        family: what kind it is of, or several: "boxes", "shapes", "tools", "container", "wide" or "light".
        profile: what was learned of this arm from many logs (`armload.posterior.learn_profile`), or the path of its
            file; the answer is what was added since. With a tare too, the tare is of the recording's own day.
        method: a name in `armload.METHODS`, or the path of a trained model; None: the most trustworthy for the arm,
            "hybrid" where one is shipped, "map-gp" elsewhere.
        progress: called with a few words on what is being done.

    Raises:
        ArmloadError: a file cannot be read, the log is not plausible for this arm, or the method cannot be used on it.
    """
    say = progress or (lambda _: None)
    arm = arm if isinstance(arm, Arm) else arm_named(arm)
    drawn = read_payload(body) if isinstance(body, str | Path) else body
    known = plausible_known(known_of(arm, mass, com, drawn, families(family)), arm)
    if tare_age and tare is None:
        raise IdentificationError(
            "tare_age says how old a tare is, but there is no tare: give it, or leave the age out"
        )
    recording = recording if isinstance(recording, Recording) else read_recording(recording, arm)
    tare = tare if tare is None or isinstance(tare, Recording) else read_recording(tare, arm)
    read = recording.notes if tare is None else of_readers(recording, tare)
    notes = (*read, *paused(recording), *rested(recording, arm))
    for log in (recording, tare):
        if log is not None:
            check_usable(log, arm)
    if tare is not None:
        check_gravity_was_missing([recording, tare], arm)
        check_own_measurements(recording, tare)
    drift, aged = (0.0, ()) if tare is None else drift_since(tare, recording, tare_age)
    profile = load_profile(profile) if isinstance(profile, str | Path) else profile
    asked, notes = Asked(method, drift, known, profile), (*notes, *aged)
    if profile is not None and arm.motor_torque:
        notes = (*notes, MOTOR_PROFILE)
    if tare is not None and profile is not None:
        _check_same_mounted(tare, arm, asked)
    mounted = read_payload(tool) if isinstance(tool, str | Path) else tool
    say("identifying")
    question = Question(tare, mounted, asked, notes)
    account, question = _of_all_poses(recording, arm, question, say)
    if (account.doubts or account.left > 1.0) and not arm.motor_torque:
        say("asking whether noise of the velocities, or friction that grows with the load, would explain it")
        steady = None if tare is None else steadied(tare)
        calmer = replace(question, tare=steady, notes=(*question.notes, ALLOWED))
        other = _account(steadied(recording), replace(arm, gear_loss=LINK_LOSS), calmer)
        if not other.doubts and other.left <= EXPLAINS * max(account.left, 1.0):
            account = other
            if tare is None or profile is not None:
                account = other._replace(answer=_doubted_throughout(other.answer, UNCHECKED))
    answer, own = account.answer, None
    if answer.interval == "approximate" and answer.gravity is None and recording.channel == "measured":
        way = likelier_gravity(recording, arm, partial(torque_scale, recording, arm))
        if way is not None:
            answer = _doubted_throughout(answer, mounted_otherwise(way, arm))
    if profile is not None:
        own = profile.learned_from(recording) or (None if tare is None else profile.learned_from(tare))
    return answer if own is None else _doubted_throughout(answer, learned_from(own))


class _Account(NamedTuple):
    """An answer, and what speaks against one payload on the same arm.

    doubts: how many there are, changes within the log counted. left: of what the log leaves unexplained of either, the
    most, over what raises a doubt.
    """

    answer: Identification
    doubts: int
    left: float


def _of_all_poses(
    recording: Recording, arm: Arm, question: Question, say: Callable[[str], None]
) -> tuple[_Account, Question]:
    """The account of a log, with more functions of the pose where fewer raise a doubt as there are very many poses."""
    account, asked = _account(recording, arm, question), question.asked
    features = more_features(recording, arm) if account.doubts and asked.profile is None else None
    if features is None:
        return account, question
    say("asking whether more functions of the pose would explain it, as the log is of very many poses")
    finer = replace(question, asked=replace(asked, features=features), notes=(*question.notes, MANY_POSES))
    other = _account(recording, arm, finer)
    return (other, finer) if other.doubts < account.doubts else (account, question)


def _account(recording: Recording, arm: Arm, question: Question) -> _Account:
    """The answer for a log, part by part where the payload changes within it."""
    whole = answer_of_one_payload(recording, arm, question)
    of_arm = (None, None) if whole.another else (question.tare, question.asked.profile)
    # a base that leans looks like a payload that changes
    level = arm if whole.gravity is None else replace(arm, gravity=whole.gravity)
    changes = changes_of_payload(recording, level, *of_arm, whole.kappa, whole.mass, question.asked.features)
    times = changes.times
    edges, answers = [recording.t[0], *times, recording.t[-1]], [whole]
    if times:
        parts = [recording.between(a + SETTLED * (k > 0), b) for k, (a, b) in enumerate(pairwise(edges))]
        since = [t - recording.t[0] for t in times]
        of_parts = [
            replace(question, notes=(*question.notes, changed_within(since, k, len(parts))))
            for k in range(1, len(parts) + 1)
        ]
        unknown = replace(question.asked, known=None)  # what is known is what is held at the end
        of_parts[:-1] = [replace(of_part, asked=unknown) for of_part in of_parts[:-1]]
        answers = [answer_of_one_payload(part, arm, of_part) for part, of_part in zip(parts, of_parts, strict=True)]
        if _moves_in_parts(whole, answers):
            edges, answers = [edges[0], edges[-1]], [whole]  # there is no rigid body in the parts either: it swings
        else:
            answers = _doubted_where_it_shifts(answers, changes.added)
    if changes.drift is not None:
        answers = [
            _doubted(answer, torques_drift(arm, changes.drift.joint, changes.drift.torque, len(answers)))
            for answer in answers
        ]
    elif changes.doubted and not times:
        answers = [_doubted(whole, MAY_CHANGE)]
    segments = tuple(
        Segment(float(a - recording.t[0]), float(b - recording.t[0]), answer)
        for (a, b), answer in zip(pairwise(edges), answers, strict=True)
    )
    answer = replace(answers[-1], segments=segments)
    misfit = 0.0 if whole.health is None else whole.health.misfit or 0.0
    doubts = len(times) + changes.doubted + sum(answer.doubts for answer in answers)
    return _Account(answer, doubts, max(changes.left, misfit / CHANGED))


def _moves_in_parts(whole: Identification, parts: Sequence[Identification]) -> bool:
    """Whether one payload moves by itself: no rigid body is in most of the parts either, and none weighs otherwise."""
    if not whole.moves or 2 * sum(part.moves for part in parts) <= len(parts):
        return False
    return not any(_weigh_otherwise(before, after) for before, after in pairwise(parts))


def _weigh_otherwise(before: Identification, after: Identification) -> bool:
    apart = max(before.phi_low[0] - after.phi_high[0], after.phi_low[0] - before.phi_high[0])
    return apart > SWAYS * max(abs(before.mass), abs(after.mass))


def _doubted_where_it_shifts(
    parts: Sequence[Identification], added: Sequence[tuple[float, float] | None]
) -> list[Identification]:
    """The answers of the parts, doubted on both sides of a change that took nothing up and put nothing down.

    A cut takes it for a step between two rigid bodies. What shifts may do so all the time. `added`: of each change, the
    mass that it adds and the standard deviation of that, in which the arm's own errors cancel. Where something else is
    doubted, as a joint's sign, that may be what looks like a shift.
    """
    shifts = [
        mass is not None and before.held and after.held and abs(mass[0]) <= Z95 * mass[1]
        for (before, after), mass in zip(pairwise(parts), added, strict=True)
    ]
    return [
        _doubted(part, SHIFTS) if (before or after) and not part.doubts else part
        for part, before, after in zip(parts, [False, *shifts], [*shifts, False], strict=True)
    ]


def _doubted(answer: Identification, note: str) -> Identification:
    """An answer that something speaks against."""
    return replace(answer, interval="approximate", notes=(note, *answer.notes))


def _doubted_throughout(answer: Identification, note: str) -> Identification:
    """An answer that something speaks against in all parts of the log, which surveys and programs read."""
    parts = tuple(replace(part, answer=_doubted(part.answer, note)) for part in answer.segments)
    return replace(_doubted(answer, note), segments=parts)


def _check_same_mounted(tare: Recording, arm: Arm, asked: Asked) -> None:
    """See that a tare carries what the profile's logs do.

    Raises:
        IdentificationError: it carries something else.
    """
    seen = found_in(tare, arm, None, replace(asked, known=None, drift=0.0)).estimate
    mass, std = float(seen.phi[0]), float(seen.std[0])
    if abs(mass) > HELD * std:
        raise IdentificationError(
            f"the tare carries {mass:+.3g} ± {Z95 * std:.2g} kg beside what was mounted in the profile's logs: "
            "expected the same; leave out the tare or the profile, or record a tare with the same mounted"
        )


def check_usable(log: Recording, arm: Arm) -> None:
    """See that a log is plausible for an arm, and of a torque and a rate that something can be found from.

    Raises:
        ArmloadError: it is not; the message says what was found and what to do.
    """
    check_plausible(log, arm)
    if log.channel != "measured":
        raise IdentificationError(
            f"{log.source} holds {log.channel} torque: expected measured joint torque with gravity in it"
        )
    if round(log.rate) < LOWEST_RATE:  # in whole numbers: times since 1970 are rounded, and clocks run slow
        raise IdentificationError(
            f"{log.source} is sampled at {log.rate:.3g} Hz: expected at least {LOWEST_RATE:g} Hz; record faster, as "
            "what lies between two samples is not to be had afterwards"
        )
