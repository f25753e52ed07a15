"""`armload identify`: one log in, one payload out."""

from __future__ import annotations

import argparse

from armload.app.cli.arguments import (
    Parser,
    add_arm_arguments,
    add_identifier_arguments,
    add_tool_and_topic_arguments,
    arm_of,
    file_name,
    payload_named,
)
from armload.app.cli.export import FORMS, write
from armload.app.cli.printing import print_json, print_note, working, write_json

_EXAMPLES = """\
examples:
  armload identify run.csv --robot panda
  armload identify run.mcap --robot panda --tool franka-hand
  armload identify loaded.csv --robot my_arm.urdf --frame tool0 --tare unloaded.csv
  armload identify run.csv --robot ur10e --gravity=-9.81,0,0        (on a wall)
  armload identify run.csv --robot panda --out payload.json         (the answer as JSON, usable as --tool later)
  armload identify run.csv --robot panda --tool franka-hand --to franka    (what the controller reads)

A log has the columns t, q1…qn, dq1…dqn, tau1…taun in seconds, radians, rad/s and N·m (CSV, Parquet, NPZ), or is a ROS 1
or ROS 2 bag of sensor_msgs/JointState. tau is the measured joint torque, with gravity in it.
"""


def parser() -> Parser:
    """The arguments of `armload identify`."""
    parser = Parser(
        prog="armload identify",
        description="Identify what the robot holds: mass, centre of mass and inertia, with 95 % intervals.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("log", type=file_name, metavar="LOG", help="log of a motion with the payload")
    add_arm_arguments(parser)
    add_identifier_arguments(parser)
    add_tool_and_topic_arguments(parser)
    parser.add_argument("--tare-topic", metavar="T", help="that of the tare's bag, where it is another one")
    parser.add_argument("--all", action="store_true", help="print the ten parameters about the frame's origin, too")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument(
        "--to",
        choices=FORMS,
        metavar="FORM",
        help=f"print it as a controller or simulator reads it, as `armload export` does: {', '.join(FORMS)}",
    )
    parser.add_argument(
        "--out", type=file_name, metavar="FILE", help="write a file, whole or not at all: JSON, or the form of --to"
    )
    return parser


def run(options: argparse.Namespace) -> None:
    """Identify and print."""
    from armload.devices import Load
    from armload.errors import UsageError
    from armload.identification import identify
    from armload.identification.text import summary
    from armload.recording import Recording, has_topics, read_recording

    with working("reading") as say:
        arm = arm_of(options)
        tool = None if options.tool is None else payload_named(options.tool, arm)
        if options.to is not None and (options.json or options.all):
            raise UsageError("--to prints a controller's form alone: leave out --json and --all")
        if options.tare_topic is not None and options.tare is None:
            raise UsageError("--tare-topic names a topic of the tare's bag, but there is no --tare")
        bags = [path for path in (options.log, options.tare) if path is not None and has_topics(path)]

        def read(path: str, topic: str | None) -> Recording:
            return read_recording(path, arm, topic=topic if path in bags or not bags else None)

        log = read(options.log, options.topic)
        tare = None if options.tare is None else read(options.tare, options.tare_topic or options.topic)
        result = identify(log, arm, tare=tare, tool=tool, method=options.method, progress=say)
    if options.to is not None:
        write(Load.of(result), options.to, options.out, arm, options.frame, told=result.notes)
        return
    if options.out is not None:
        write_json(options.out, result.to_dict())
    for note in result.notes:
        print_note(note)
    if options.json:
        print_json(result.to_dict())
    else:
        print(summary(result, options.all))
