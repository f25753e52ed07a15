"""What `armload measure` is asked."""

from __future__ import annotations

import argparse
import shlex
import shutil

from armload.app.cli.arguments import (
    add_arm_arguments,
    add_column_arguments,
    add_known_arguments,
    add_tare_age_argument,
    at_least,
    file_name,
    output_file,
    output_folder,
    pace,
)
from armload.app.cli.motion_arguments import add_obstacle_arguments, numbers
from armload.app.cli.parser import Parser

_EXAMPLES = """\
examples:
  armload measure sim --dry-run
  armload measure sim --motion taie2024 --dry-run
  armload measure sim --motion taie2024 --move --speed max
  armload measure fr3://172.16.0.2 --motion excite.json --until mass=10g,moment=1.5g.m
  armload measure ur://192.168.0.10 --robot ur10e --motion random:1 --mass 1.200±0.002 --out payload.json
  armload measure fr3://172.16.0.2 --body gear.json                       (a drawing, and how far it can be trusted)
  armload measure ros2:///joint_states --robot ur5e --motion excite.json --tare empty.csv

What will move, how far and how fast is said first, and nothing moves until you type yes (or give --move). Ctrl-C stops
the arm on its path. Keep the emergency stop at hand: nothing here knows what stands around the arm but the floor and
the boxes that --box names.
"""


def command(text: str) -> tuple[str, ...]:
    """The words of a command that this machine has: that there is none is said before an arm has moved for it.

    >>> command("true 'a b'")
    ('true', 'a b')
    """
    try:
        words = tuple(shlex.split(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no command: {str(error).lower()}") from None
    if not words or shutil.which(words[0]) is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no command: expected a program of this machine, by name or path")
    return words


def parser() -> Parser:
    """The arguments of `armload measure`."""
    parser = Parser(
        prog="armload measure",
        description="Move the arm without and with the payload, and identify it: the whole procedure in one command.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add(
        "source",
        type=file_name,
        metavar="SOURCE",
        help="sim, fr3://ADDRESS, panda://ADDRESS, ur://ADDRESS or ros2:///TOPIC",
    )
    add_arm_arguments(parser, required=False)
    add(
        "--motion",
        metavar="MOTION",
        help="taie2024, a JSON, CSV or YAML file, or random:SEED (default: designed about the present pose)",
    )
    add(
        "--time",
        type=at_least(0.2, float, 60.0),
        default=2.0,
        metavar="S",
        help="of a motion that is designed (default: 2)",
    )
    add(
        "--tool-speed",
        type=at_least(0.01, float),
        default=0.5,
        metavar="V",
        help="of the payload frame in a motion that is designed, at most [m/s] (default: 0.5)",
    )
    add("--dry-run", action="store_true", help="connect, say what would move and check it; move nothing")
    add("--move", action="store_true", help="move without asking: for who has seen the dry run")
    add("--until", metavar="WIDTHS", help="stop when 95%% half-widths are mass=10g,moment=1.5g.m,inertia=1e-3")
    add("--dir", type=output_folder, metavar="DIR", help="folder of the logs (default: measurement-TIME, in UTC)")
    add(
        "--tare", type=file_name, metavar="LOG0", help="a log of the empty arm: no empty run, the payload is on already"
    )
    add_tare_age_argument(parser)
    add_known_arguments(parser)
    add("--profile", type=file_name, metavar="P", help="what was learned of this arm from many logs (armload profile)")
    add(
        "--tool",
        type=file_name,
        metavar="FILE",
        help="a known tool that is on in both runs (JSON, or franka-hand); the answer is what it carries",
    )
    add("--method", type=file_name, metavar="M", help="a name `armload methods` lists, or a trained model's path")
    add("--grip", type=command, metavar="COMMAND", help="a command that mounts the payload; else you are asked to")
    add_column_arguments(parser)
    safety = parser.add_argument_group("what is allowed").add_argument
    add_obstacle_arguments(safety)
    safety(
        "--approach",
        type=at_least(0.0, float),
        metavar="RAD",
        help="how far a joint may be from the start (default: 1)",
    )
    safety(
        "--off-path", type=at_least(1e-3, float), default=0.05, metavar="RAD", help="more stops the arm (default: 0.05)"
    )
    safety(
        "--push",
        type=at_least(0.01, float),
        metavar="SHARE",
        help="of a joint's rated torque, beside a rated payload's; more stops the arm (0.15; motor currents: 0.5)",
    )
    answer = parser.add_argument_group("the answer").add_argument
    answer("--json", action="store_true", help="print one JSON object and nothing else")
    answer("--out", type=output_file, metavar="FILE", help="write the answer as JSON, whole or not at all")
    answer("--apply", action="store_true", help="write it to the controller, too (UR, Franka)")
    answer("--mounted", metavar="FILE", help="what was on at the empty run: JSON, franka-hand, or nothing; for --apply")
    answer(
        "--undetermined-inertia",
        action="store_true",
        help="--apply writes inertia that the runs did not determine, too",
    )
    sim = parser.add_argument_group("the simulator (sim)").add_argument
    sim("--payload", default="test", metavar="FILE", help="what is mounted: JSON, franka-hand, or test (default: test)")
    sim(
        "--world",
        default="real-like:0",
        metavar="W",
        help="the arm as it is: nominal, or real-like:SEED (default: real-like:0)",
    )
    sim(
        "--at",
        type=numbers,
        metavar="Q1,…",
        help="where it stands [rad] (default: where the motion begins, else near the middle of the joints)",
    )
    sim("--speed", type=pace, default=1.0, metavar="X|max", help="of the simulated arm (default: 1, real time)")
    sim("--seed", type=at_least(0), default=0, metavar="N", help="of the sensors' noise (default: 0)")
    return parser
