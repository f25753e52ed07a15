"""`armload profile`: learn an arm from its logs, go on with further ones, or show what is known of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import (
    COLUMN_OPTIONS,
    Parser,
    add_arm_arguments,
    add_column_arguments,
    file_name,
    output_file,
    weighed,
)
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.named import arm_of, payload_of, read_logs
from armload.app.cli.outputs import check_unchanged, contents_of
from armload.app.cli.printing import console, print_json, print_note, table, working
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.posterior import Profile
    from armload.posterior.profile import SessionRecord
    from armload.recording import Recording

_OF_MOTORS = (
    "answers with a profile of motor currents are called approximate, as their intervals were not checked: record a "
    "tare of the same day for those that are to be calibrated, and leave the profile out"
)
_USAGE = """armload profile LOG… --robot R --out P [--update] …
       armload profile show P [--figure F.png] [--json]"""
_EXAMPLES = """\
examples:
  armload profile monday.csv tuesday.csv friday.csv --robot panda --out arm.profile
  armload profile today.csv --robot panda --out arm.profile --update
  armload profile empty*.csv --robot panda --tool franka-hand --out arm.profile
  armload profile weight.csv --robot panda --out arm.profile --update --mass 2.000±0.002
  armload profile show arm.profile --figure arm.png

Every log is of the arm without a payload, on any motion, and a session of its own: offsets and friction may differ from
log to log (logs within an hour, by clocks that show the time of day, are one session). Whatever is mounted must be the
same in all of them. With --mass, the log is of a known weight, which tells how far the torque sensors are off.
Use it with: armload identify LOG --profile arm.profile
"""

# share of sound profiles in which a session is asked about. T of a session like the others is chi-squared: an offset
# and two friction terms of each joint; of simulated arms that drift as assumed it is about half of that
_ASKED = 0.01


def parser() -> Parser:
    """The arguments of `armload profile`."""
    parser = Parser(
        prog="armload profile",
        usage=_USAGE,
        description="Learn an arm from its logs: what it does unlike its model, and how that drifts from day to day.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("logs", nargs="+", type=file_name, metavar="LOG", help="logs of the arm, or: show PROFILE")
    add_arm_arguments(parser, required=False)
    parser.add_argument("--out", type=output_file, metavar="P", help="the profile's file")
    parser.add_argument("--update", action="store_true", help="add the logs to the profile that --out names")
    parser.add_argument(
        "--one-session", action="store_true", help="all logs are of one session, without a switching-off between them"
    )
    parser.add_argument(
        "--tool", type=file_name, metavar="FILE", help="a known tool that was mounted (JSON, or franka-hand)"
    )
    parser.add_argument(
        "--mass", type=weighed, metavar="M±S", help="the log is of a known weight [kg], with its 1 sigma; with --update"
    )
    parser.add_argument("--topic", metavar="T", help="JointState topic of a bag, where it has several")
    add_column_arguments(parser, tare=False)
    parser.add_argument("--figure", type=output_file, metavar="F.png", help="with show: draw where the arm is known")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return parser


def run(options: argparse.Namespace) -> None:
    """Learn and save, or show."""
    if options.logs[0] == "show":
        _show(options)
        return
    refuse_idle(given(options, "figure"), "of armload profile show")
    if options.mass is not None and options.one_session:
        raise UsageError("--one-session is of several logs, --mass of one: leave --one-session out")
    if options.mass is not None and (not options.update or len(options.logs) != 1):
        raise UsageError("--mass is of the one log of a known weight that --update adds to the profile --out")
    if options.robot is None or options.out is None:
        raise UsageError("a profile needs --robot, whose arm it is, and --out, its file; or: armload profile show P")
    if not options.update and Path(options.out).exists():
        raise UsageError(
            f"{options.out} exists: give --update to add the logs to it, or another name, or remove it to begin anew"
        )
    from armload.identification import check_usable
    from armload.posterior import check_new, learn_profile, load_profile, save_profile, with_known_weight
    from armload.posterior.profile_session import check_fits

    with working("reading") as say:
        arm = arm_of(options)
        before = contents_of(options.out)
        known = load_profile(options.out) if options.update else None
        if known is not None:
            _check_frame(known, arm, options.frame)
        tool = None if options.tool is None else arm.in_frame(payload_of(options.tool, arm)).phi
        read = [read_logs(options, arm, path)[0] for path in options.logs]
        logs = [log for log in read if log is not None]
        for log in logs:
            check_usable(log, arm)
        say("learning")
        if known is not None and options.mass is not None:
            mass, std = options.mass
            profile = with_known_weight(known, arm, logs[0], mass if tool is None else mass + float(tool[0]), std)
        else:
            if known is not None:
                check_new(logs, known)
                for log in logs:
                    check_fits(known, arm, log, tool)
            profile = learn_profile(
                arm,
                logs,
                None if tool is None else [tool] * len(logs),
                sessions=[0] * len(logs) if options.one_session else None,
                known=known,
                progress=lambda done, total: say(f"learning: {done} of {total} logs"),
            )
    check_unchanged("--out", options.out, before)
    save_profile(profile, options.out)
    for note in _notes(logs):
        print_note(note)
    if options.json:
        print_json(_fields(profile) | {"out": options.out})
        return
    _print(profile, arm.motor_torque)
    size = Path(options.out).stat().st_size / 1e6
    use = f"armload identify LOG --robot {options.robot} --profile {options.out}"
    print(f"wrote {options.out} ({size:.1f} MB); use it with: {use}")


def _check_frame(known: Profile, arm: Any, frame: str | None) -> None:
    """See that a frame that is named is the profile's own, which its logs are added about.

    Raises:
        ModelError: the profile is of another arm. UsageError: it is another frame.
    """
    from armload.arms.matching import prefixed_frame

    known.check(arm)
    if frame is not None and str(arm.frame) != prefixed_frame(arm, known.frame):
        raise UsageError(
            f"--frame {frame} is not the profile's, which is about {known.frame}: leave --frame out, or learn a new "
            "profile about it"
        )


def _show(options: argparse.Namespace) -> None:
    from armload.posterior import load_profile

    if len(options.logs) != 2:
        raise UsageError("armload profile show takes one profile: armload profile show arm.profile")
    of_logs = ("out", "update", "one_session", "tool", "mass", "topic", *COLUMN_OPTIONS)
    refuse_idle(given(options, *of_logs, parser=parser()), "of learning, not of armload profile show")
    if options.robot is None:
        refuse_idle(given(options, "frame", "gravity"), "of --robot, which is not given")
    profile = load_profile(options.logs[1])
    arm = None
    if options.robot is not None:
        options.gravity = profile.gravity if options.gravity is None else options.gravity
        arm = arm_of(options)
        profile.check(arm)
    if options.figure is not None:
        from armload.lab.report.profile_figure import write_profile_figure

        write_profile_figure(profile, _arm_of(profile) if arm is None else arm, options.figure)
    if options.json:
        print_json(_fields(profile))
        return
    _print(profile, _of_motors(profile) if arm is None else arm.motor_torque)
    if options.figure is not None:
        print_note(f"wrote {options.figure}")


def _of_motors(profile: Profile) -> bool:
    from armload.arms import ARMS

    return profile.arm_name in ARMS and ARMS[profile.arm_name].torque_side == "motor"


def _arm_of(profile: Profile) -> Any:
    from armload.arms import ARMS, arm

    if profile.arm_name not in ARMS:
        raise UsageError(f"the profile is of {profile.arm_name}: name its URDF with --robot")
    x, y, z = (float(part) for part in profile.gravity)
    return arm(profile.arm_name, profile.frame, (x, y, z))


def _fields(profile: Profile) -> dict[str, Any]:
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
        "next": list(_next(profile)),
    }


def _print(profile: Profile, of_motors: bool) -> None:
    from armload.inertia import Z95
    from armload.posterior.drift import CHANGED

    n, drift = profile.n, profile.drift.reshape(-1, profile.n) ** 0.5
    count = "1 session" if len(profile.sessions) == 1 else f"{len(profile.sessions)} sessions"
    print(
        f"{profile.arm_name} about {profile.frame}: {count}, {profile.duration:.0f} s, "
        f"{profile.features.pose} features of the pose, noise counted {profile.repeated:g} times"
    )
    rows = table("from session to session, 1 sigma [N·m]", "", *(f"joint {j + 1}" for j in range(n)))
    for name, values in (("offset", drift[0]), ("Coulomb friction", drift[1])):
        rows.add_row(name, *(f"{x:.3f}" for x in values))
    if profile.gain is not None and profile.gain_std is not None:
        rows.add_row("torque sensor's gain", *(f"{1.0 + x:.3f}" for x in profile.gain))
        if profile.gain_joint_std is not None:
            rows.add_row("± (95 %)", *(f"{Z95 * x:.3f}" for x in profile.gain_joint_std))
        print(f"a known weight was hung on: the torque is known to {100 * profile.gain_std:.1f} %")
    console().print(rows)
    rows = table("sessions", "log", "time [s]", "offsets [N·m]", "misfit", "noise")
    for session in profile.sessions:
        offsets = " ".join(f"{x:+.2f}" for x in session.offset)
        name, time = _name(session), f"{session.duration:.0f}"
        rows.add_row(name, time, offsets, f"{session.statistic:.0f}", f"{max(session.noise):.1f}")
    console().print(rows)
    others = (
        "of motor currents another arm of the type stays below, too"
        if of_motors
        else (f"above {CHANGED:.0f} it is another arm's")
    )
    print_note(
        f"misfit is T of how the session's offsets and friction differ from the others': about {3 * n} or less, "
        f"{others}; noise is over what is expected, the largest joint's"
    )
    if of_motors:
        print_note(_OF_MOTORS)
    for line in _next(profile):
        print_note(line)


def _notes(logs: list[Recording]) -> list[str]:
    """What the readers did to the logs; what they did to several alike is said once."""
    of: dict[str, list[str]] = {}
    for log in logs:
        for note in log.notes:
            alike = note.removeprefix(log.source)
            of.setdefault(alike, []).append(log.source if alike != note else "")
    return [
        sources[0]
        + (f" and {len(sources) - 1} other log{'s' * (len(sources) > 2)}" if sources[0] and len(sources) > 1 else "")
        + note
        for note, sources in of.items()
    ]


def _name(session: SessionRecord) -> str:
    """The names of a session's logs, without their folders."""
    return ", ".join(Path(log).name for log in session.name.split(", "))


def _most(profile: Profile) -> float:
    """T that the sessions of one arm seldom reach, however many there are."""
    from scipy.stats import chi2

    from armload.posterior.drift import CHANGED

    return min(CHANGED, float(chi2.isf(_ASKED / len(profile.sessions), 3 * profile.n)))


def _next(profile: Profile) -> tuple[str, ...]:
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
        if session.statistic > _most(profile)
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
        advice.append(f"{few} how the arm drifts: record it on four days or more")
    moved = profile.poses.max(axis=0) - profile.poses.min(axis=0)
    still = [str(j + 1) for j in range(profile.n) if moved[j] < 0.5]
    if still:
        joints = f"joint{'s' if len(still) > 1 else ''} {', '.join(still)}"
        advice.append(
            f"{joints} moved by less than half a radian in all logs: move {'them' if len(still) > 1 else 'it'} further"
        )
    return tuple(advice)
