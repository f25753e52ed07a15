"""What `armload profile` says of a profile: its sessions, its drift, what does not fit, and what to record next."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.app.cli.printing import console, print_note, table

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.posterior import Profile
    from armload.posterior.profile import SessionRecord

_OF_MOTORS = (
    "answers with a profile of motor currents are called approximate, as their intervals were not checked: record a "
    "tare of the same day for those that are to be calibrated, and leave the profile out"
)
# share of sound profiles in which a session is asked about. T of a session like the others is chi-squared: an offset
# and two friction terms of each joint; of simulated arms that drift as assumed it is about half of that
_ASKED = 0.01


def of_motors(profile: Profile) -> bool:
    """Whether its arm is a built-in one whose torque is measured at the motors."""
    from armload.arms import ARMS

    return profile.arm_name in ARMS and ARMS[profile.arm_name].torque_side == "motor"


def in_time(profile: Profile) -> Profile:
    """The same with its sessions in the order of their dates, for people; one without a date stays in its place."""
    from dataclasses import replace

    dated = [session for session in profile.sessions if session.date is not None]
    dated.sort(key=lambda session: session.date or 0.0)
    rest = iter(dated)
    return replace(profile, sessions=tuple(one if one.date is None else next(rest) for one in profile.sessions))


def fields_of(profile: Profile, arm: Arm | None = None) -> dict[str, Any]:
    """The profile as one JSON object; arm: whose it is, where that is at hand."""
    from dataclasses import asdict

    n = profile.n
    drift = profile.drift.reshape(-1, n) ** 0.5
    return {
        "robot": profile.arm_name,
        "frame": profile.frame,
        "duration": profile.duration,
        "pose_features": profile.features.pose,
        "repeated": profile.repeated,
        "torque_gain": None if profile.gain is None else (1.0 + profile.gain).tolist(),
        "torque_gain_std": profile.gain_std,
        "torque_gain_joint_std": None if profile.gain_joint_std is None else profile.gain_joint_std.tolist(),
        "drift_offset": drift[0].tolist(),
        "drift_coulomb": drift[1].tolist(),
        "sessions": [asdict(session) for session in profile.sessions],
        "next": list(next_steps(profile, arm)),
    }


def print_profile(profile: Profile, motors: bool, arm: Arm | None = None) -> None:
    """Print the profile on stdout and what to do about it on stderr.

    motors: its torque is measured at the motors. arm: whose it is, where that is at hand.
    """
    from armload.arms.units import heading
    from armload.inertia import Z95
    from armload.posterior.drift import CHANGED

    n, drift = profile.n, profile.drift.reshape(-1, profile.n) ** 0.5
    count = "1 session" if len(profile.sessions) == 1 else f"{len(profile.sessions)} sessions"
    print(
        f"{profile.arm_name} about {profile.frame}: {count}, {profile.duration:.0f} s, "
        f"{profile.features.pose} features of the pose, noise counted {profile.repeated:g} times"
    )
    slides = [False] * n if arm is None else arm.limits.slides
    torque = heading("torque", slides).removeprefix("torque ")
    rows = table(f"from session to session, 1 sigma {torque}", "", *(f"joint {j + 1}" for j in range(n)))
    for name, values in (("offset", drift[0]), ("Coulomb friction", drift[1])):
        rows.add_row(name, *(f"{x:.{_decimals(values, 3)}f}" for x in values))
    if profile.gain is not None and profile.gain_std is not None:
        rows.add_row("torque sensor's gain", *(f"{1.0 + x:.3f}" for x in profile.gain))
        if profile.gain_joint_std is not None:
            rows.add_row("± (95 %)", *(f"{Z95 * x:.3f}" for x in profile.gain_joint_std))
        print(f"a known weight was hung on: the torque is known to {100 * profile.gain_std:.1f} %")
    console().print(rows)
    rows = table("sessions", "log", "time [s]", f"offsets {torque}", "misfit", "noise")
    digits = _decimals([x for session in profile.sessions for x in session.offset], 2)
    for session in profile.sessions:
        offsets = " ".join(f"{x:+.{digits}f}" for x in session.offset)
        name, time = _name(session), f"{session.duration:.0f}"
        rows.add_row(name, time, offsets, f"{session.statistic:.0f}", f"{max(session.noise):.1f}")
    console().print(rows)
    others = (
        "of motor currents another arm of the type stays below, too"
        if motors
        else (f"above {CHANGED:.0f} it is another arm's")
    )
    print_note(
        f"misfit is T of how the session's offsets and friction differ from the others': about {3 * n} or less, "
        f"{others}; noise is over what is expected, the largest joint's"
    )
    if motors:
        print_note(_OF_MOTORS)
    for line in next_steps(profile, arm):
        print_note(line)


def _decimals(values: Iterable[float], least: int) -> int:
    """How many show two digits of the largest value, as of an arm of small servos; at least so many.

    >>> _decimals([-0.0042, 0.0006], 2), _decimals([3.0, 0.1], 2)
    (4, 2)
    """
    from armload.inertia import decimals

    largest = max(map(abs, values), default=0.0)
    return least if largest == 0.0 else max(least, decimals(largest))


def _name(session: SessionRecord) -> str:
    """The names of a session's logs, without their folders."""
    return ", ".join(Path(log).name for log in session.name.split(", "))


def _seldom(session: SessionRecord, profile: Profile) -> bool:
    """Whether its T is one that the sessions of one arm seldom reach, however many there are."""
    from armload.posterior.chi_squared import beyond
    from armload.posterior.drift import CHANGED

    return session.statistic > CHANGED or beyond(session.statistic, 3 * profile.n) < _ASKED / len(profile.sessions)


def next_steps(profile: Profile, arm: Arm | None = None) -> tuple[str, ...]:
    """What to record next, and what does not fit."""
    from armload.posterior.drift import CHANGED
    from armload.posterior.torque_gain import common_gain

    advice = [
        f"{_name(session)} does not fit the other sessions (misfit {session.statistic:.0f}): another arm, "
        "another base, or something was mounted; learn the profile without it"
        if session.statistic > CHANGED
        else f"{_name(session)} fits less well than an arm's own logs do (misfit {session.statistic:.0f}): was it made "
        "by this arm?"
        for session in profile.sessions
        if _seldom(session, profile)
    ]
    common = common_gain(profile)
    if common is not None:
        advice.append(
            f"by the known weight the torque of all joints is off by {100 * common:+.0f} %, more than an arm's is: "
            "weigh it again; every answer by this profile rests on it"
        )
    if len(profile.sessions) < 4:
        count = len(profile.sessions)
        few = "one session does not tell" if count == 1 else f"{count} sessions do not tell"
        advice.append(
            f"{few} how the arm drifts, nor how far a log can be trusted: record it on four days or more, and learn a "
            "new profile of all these logs, as --update keeps what was chosen for the first"
        )
    moved = profile.poses.max(axis=0) - profile.poses.min(axis=0)
    turns = [arm is None or not arm.limits.slides[j] for j in range(profile.n)]  # in rad: a joint that slides has m
    still = [str(j + 1) for j in range(profile.n) if turns[j] and moved[j] < 0.5]
    if still:
        joints = f"joint{'s' if len(still) > 1 else ''} {', '.join(still)}"
        advice.append(
            f"{joints} moved by less than half a radian in all logs: move {'them' if len(still) > 1 else 'it'} further"
        )
    return tuple(advice)
