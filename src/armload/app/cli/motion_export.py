"""`armload motion export`: a motion as a file that a robot's own tools read, from where the arm stands, if asked."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from armload.app.cli.arguments import add_arm_arguments, at_least, output_file
from armload.app.cli.motion_arguments import FLOOR, add_obstacle_arguments, numbers
from armload.app.cli.named import arm_of, boxes_of, motion_of
from armload.app.cli.printing import print_note
from armload.errors import MotionError, UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.motion import Motion

_DEFAULT = "panda"
_LEAD = 0.5  # [s] until the first point of a ros2 trajectory from the present pose, where the arm is already


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """All of `armload motion export`."""
    add = parser.add_argument
    add("motion", metavar="MOTION", help="taie2024, a JSON, CSV or YAML file, or random:SEED")
    add_arm_arguments(parser, default=_DEFAULT)
    parser.set_defaults(robot=None)  # a table names no joints: only an arm that is named must fit
    add(
        "--format",
        required=True,
        choices=("csv", "ros2", "ur"),
        help="a table, a ROS 2 trajectory, or a program for UR robots",
    )
    add(
        "--rate",
        type=at_least(1e-3, float, 1e4),
        metavar="HZ",
        help="samples per second (default: 1000 for csv, 100 for ros2, 500 for ur)",
    )
    add("--out", type=output_file, metavar="FILE", help="file to write (default: standard output)")
    add = parser.add_argument_group("from the present pose").add_argument
    add(
        "--from",
        dest="start",
        type=numbers,
        metavar="Q1,…,QN",
        help="where the arm stands [rad]: the file begins there, with a slow straight way to the motion's start, and "
        "both are checked",
    )
    add(
        "--approach", type=at_least(0.0, float, 10.0), metavar="RAD", help="farthest of a joint from there (default: 1)"
    )
    add("--payload", type=at_least(0.0, float), metavar="KG", help="heaviest on the way (default: as rated)")
    add_obstacle_arguments(add)


def run_export(options: argparse.Namespace) -> int:
    """Write the file, or print it."""
    from armload.motion import export_motion
    from armload.motion.export import motion_text

    named, options.robot = options.robot is not None, options.robot or _DEFAULT
    arm = arm_of(options)
    needed = named or options.format == "ros2" or options.start is not None
    motion, lead = motion_of(options.motion, arm, needed), {}
    if options.start is not None:
        motion, lead = _led(motion, arm, options), {"lead": _LEAD}
    elif options.approach is not None or options.payload is not None or options.box or options.floor != FLOOR:
        raise UsageError(
            "--approach, --payload, --floor and --box are of the way from the present pose: give it with --from"
        )
    if options.out is None:
        print(motion_text(motion, options.format, options.rate, joint_names=arm.joint_names, **lead), end="")
        return 0
    export_motion(motion, options.out, options.format, options.rate, joint_names=arm.joint_names, **lead)
    checked = "run it slowly first" if lead else "check the motion before a robot runs it (armload motion check)"
    print_note(f"wrote {options.out}; {checked}")
    return 0


def _led(motion: Motion, arm: Arm, options: argparse.Namespace) -> Motion:
    """The motion with the way to its start before it, both checked.

    Raises:
        MotionError: another number of joints, or one of both is not allowed.
    """
    from armload.arms.units import unit_of
    from armload.measuring.plan import APPROACH, Room, plan_of
    from armload.motion import JoinedMotion

    if len(options.start) != arm.n:
        raise MotionError(f"--from has {len(options.start)} joint positions: {arm.name} has {arm.n}")
    for j, at in enumerate(options.start):
        low, high = arm.limits.position_low[j], arm.limits.position_high[j]
        if not low <= at <= high:
            unit = unit_of("position", arm.limits.slides[j])
            raise MotionError(
                f"--from has {arm.joint_names[j]} at {at:.4g} {unit}: expected a position from {low:.4g} to "
                f"{high:.4g} {unit}"
                f"{arm.limits.as_degrees(options.start)}"
            )
    approach = APPROACH if options.approach is None else options.approach
    room = Room(options.floor, boxes_of(options), approach)
    plan = plan_of(arm, motion, options.start, empty_run=False, room=room, heaviest=options.payload)
    for leg in plan.legs:
        if leg.check.problems:
            which = motion.name if leg is plan.legs[-1] else f"the way {leg.purpose}"
            raise MotionError(f"nothing was written, because of {which}: {'; '.join(leg.check.problems)}")
    return JoinedMotion([leg.motion for leg in plan.legs], motion.name)
