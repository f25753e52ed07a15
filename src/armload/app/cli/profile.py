"""`armload profile`: learn an arm from its logs, go on with further ones, or show what is known of it."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import (
    COLUMN_OPTIONS,
    add_arm_arguments,
    add_column_arguments,
    file_name,
    output_file,
    weighed,
)
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.named import arm_of, payload_named
from armload.app.cli.named_logs import read_logs
from armload.app.cli.outputs import contents_of, replacing_unchanged
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_json, print_note, working
from armload.app.cli.profile_text import fields_of, in_time, of_motors, print_profile
from armload.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from armload.arms import Arm
    from armload.posterior import Profile

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
    if options.update and not Path(options.out).exists():
        raise UsageError(
            f"there is no {options.out} to add to: leave --update out to begin it, or name one that exists"
        )
    from armload.identification import check_usable
    from armload.identification.notes import of_readers
    from armload.posterior import check_new, learn_profile, load_profile, save_profile, with_known_weight
    from armload.posterior.profile_session import check_fits

    with working("reading") as say:
        arm = arm_of(options)
        before = contents_of(options.out)
        known = load_profile(options.out) if options.update else None
        if known is not None:
            _check_frame(known, arm, options.frame)
        tool, off = (None, 0.0) if options.tool is None else _tool(options.tool, arm)
        read = [read_logs(options, arm, path)[0] for path in options.logs]
        logs = [log for log in read if log is not None]
        for log in logs:
            check_usable(log, arm)
        say("learning")
        if known is not None and options.mass is not None:
            mass, std = options.mass
            mass += 0.0 if tool is None else float(tool[0])
            profile = with_known_weight(known, arm, logs[0], mass, math.hypot(std, off))
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
    with replacing_unchanged("--out", options.out, before):
        save_profile(profile, options.out)
    for note in of_readers(*logs):
        print_note(note)
    profile = in_time(profile)
    if options.json:
        print_json(fields_of(profile, arm) | {"out": options.out})
        return
    print_profile(profile, arm.motor_torque, arm)
    size = Path(options.out).stat().st_size / 1e6
    same = "" if options.frame is None else f" --frame {options.frame}"
    if options.gravity is not None:
        same += f" --gravity {','.join(f'{x:g}' for x in options.gravity)}"
    use = f"armload identify LOG --robot {options.robot}{same} --profile {options.out}"
    print(f"wrote {options.out} ({size:.1f} MB); use it with: {use}")


def _tool(name: str, arm: Arm) -> tuple[NDArray[np.float64], float]:
    """A tool's parameters (10,) about the arm's frame, and the standard deviation of its mass [kg]."""
    from armload.payloads import INERTIA_ASSUMED

    tool = payload_named(name, arm)
    if not tool.inertia_known:
        print_note(f"{name}: {INERTIA_ASSUMED}")
    return arm.in_frame(tool.parameters).phi, math.sqrt(tool.covariance[0, 0])


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
    from armload.arms import ARMS
    from armload.posterior import load_profile

    if len(options.logs) != 2:
        raise UsageError("armload profile show takes one profile: armload profile show arm.profile")
    of_logs = ("out", "update", "one_session", "tool", "mass", "topic", *COLUMN_OPTIONS)
    refuse_idle(given(options, *of_logs, parser=parser()), "of learning, not of armload profile show")
    if options.robot is None:
        refuse_idle(given(options, "frame", "gravity"), "of --robot, which is not given")
    profile = in_time(load_profile(options.logs[1]))
    arm = None
    if options.robot is not None:
        options.gravity = profile.gravity if options.gravity is None else options.gravity
        if options.frame is None and options.robot not in ARMS:
            options.frame = profile.frame
        arm = arm_of(options)
        profile.check(arm)
    if options.figure is not None:
        from armload.lab.report.profile_figure import write_profile_figure

        write_profile_figure(profile, _arm_of(profile) if arm is None else arm, options.figure)
    if options.json:
        print_json(fields_of(profile, arm))
        return
    print_profile(profile, of_motors(profile) if arm is None else arm.motor_torque, arm)
    if options.figure is not None:
        print_note(f"wrote {options.figure}")


def _arm_of(profile: Profile) -> Any:
    from armload.arms import ARMS, arm

    if profile.arm_name not in ARMS:
        raise UsageError(f"the profile is of {profile.arm_name}: name its URDF with --robot")
    x, y, z = (float(part) for part in profile.gravity)
    return arm(profile.arm_name, profile.frame, (x, y, z))
