"""`armload motion`: excitation motions designed, shown, checked against an arm, exported for a robot, or drawn."""

from __future__ import annotations

import argparse

from armload.app.cli import (
    motion_arguments,
    motion_check,
    motion_design,
    motion_enrich,
    motion_export,
    motion_show,
)
from armload.app.cli.arguments import add_arm_arguments, at_least, output_file
from armload.app.cli.named import arm_of
from armload.app.cli.outputs import check_motion_file
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note, working

_EXAMPLES = """\
examples:
  armload motion show taie2024 --figure taie2024.png
  armload motion show mine.json --robot panda --page
  armload motion check mine.json --robot panda --payload tool.json
  armload motion check run.csv --robot ur10e --tare empty.csv
  armload motion design --robot panda --from 0,-0.5,0,-2,0,1.6,0.8 --time 3 --out mine.json
  armload motion enrich pick.yaml --robot panda --mm 5 --deg 2 --out pick-enriched.yaml
  armload motion random --robot ur10e --seed 3 --out excite.json
  armload motion export excite.json --format ur --out excite.script
  armload motion export taie2024 --format ros2 --robot panda --out excite.yaml
  armload motion export mine.json --format csv --robot panda --from 0,-0.4,0,-2,0,1.6,0.8 --out mine.csv

MOTION is taie2024, a JSON file, the table (CSV) that `export` wrote, or random:SEED. `check` says whether the arm may
run a motion, exits with 3 if not, and says which parameters of a payload it can tell, and how well; it takes a log
(CSV, Parquet, NPZ, HDF5, MATLAB, ROS bag) as well.
"""


def parser() -> Parser:
    """The arguments of `armload motion`."""
    parser = Parser(
        prog="armload motion",
        description="Design, draw, show, check or export an excitation motion; enrich a path.",
        epilog=_EXAMPLES,
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")

    design = actions.add_parser(
        "design",
        help="the motion that tells most of a payload, about a pose, within limits",
        description="Design the motion that tells most of a payload in a given time: from rest at a pose, and back to "
        "it, within a share of every limit with the worst payload there may be, clear of floor, boxes and the arm "
        "itself. It is checked 1000 times a second by other code before it is written.",
    )
    motion_arguments.add_design_arguments(design)

    enrich = actions.add_parser(
        "enrich",
        help="a task's own path, with the smallest change that lets it tell a payload",
        description="Change a task's own path by so many millimetres and degrees at most, so that it tells more of a "
        "payload: its ends, its stops and its times stay as they are.",
    )
    motion_enrich.add_enrich_arguments(enrich)

    show = actions.add_parser(
        "show",
        help="what each joint does",
        description="Show what each joint does: in numbers, as a picture, "
        "or on a page on which the arm runs the motion.",
    )
    motion_show.add_show_arguments(show)

    check = actions.add_parser(
        "check",
        help="limits, torque with a payload, the floor, the arm itself; what it tells about a payload",
        description="Check a motion against the arm's limits, the torque with a payload, the floor and the arm itself, "
        "or a log against the limits; say which parameters of a payload it can tell, and how well: the Bayesian "
        "Cramér-Rao bound.",
    )
    motion_check.add_check_arguments(check)

    export = actions.add_parser(
        "export",
        help="a table (csv), a ROS 2 trajectory (ros2) or a program for UR robots (ur)",
        description="Write a motion as a file that a robot's own tools read. Check it first, and run it slowly first. "
        "With --from the file begins at the present pose, with a slow straight way to the start.",
    )
    motion_export.add_export_arguments(export)

    random = actions.add_parser(
        "random",
        help="draw a motion the arm may run, from rest to rest",
        description="Draw a random motion, from rest to rest, that the arm may run with its rated payload.",
    )
    add_arm_arguments(random)
    random.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="same seed, same motion (default: 0)")
    random.add_argument("--duration", type=_duration, default=6.0, metavar="S", help="in seconds (default: 6)")
    random.add_argument("--harmonics", type=at_least(2), default=5, metavar="K", help="(default: 5)")
    random.add_argument("--out", required=True, type=output_file, metavar="FILE", help="JSON file to write")
    return parser


def _duration(text: str) -> float:
    from armload.motion.as_written import LONGEST

    return at_least(0.1, float, LONGEST)(text)


def run(options: argparse.Namespace) -> int:
    """Do the action."""
    return {
        "design": motion_design.run_design,
        "enrich": motion_enrich.run_enrich,
        "show": motion_show.run_show,
        "check": motion_check.run_check,
        "export": motion_export.run_export,
        "random": _random,
    }[options.action](options)


def _random(options: argparse.Namespace) -> int:
    from armload.motion import random_motion, save_motion

    check_motion_file(options.out)
    arm = arm_of(options)
    with working("looking for a motion"):
        motion = random_motion(arm, options.seed, duration=options.duration, harmonics=options.harmonics)
    save_motion(options.out, motion)
    print_note(f"wrote {motion.name} to {options.out}")
    return 0
