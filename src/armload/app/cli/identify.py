"""`armload identify`: one log in, one payload out."""

from __future__ import annotations

import argparse

from armload.app.cli.arguments import (
    Parser,
    add_arm_arguments,
    add_column_arguments,
    add_identifier_arguments,
    add_tool_and_topic_arguments,
    arm_of,
    file_name,
    payload_of,
    read_logs,
)
from armload.app.cli.printing import print_identification, print_json, print_note, working

_EXAMPLES = """\
examples:
  armload identify run.csv --robot panda
  armload identify run.mcap --robot panda --tool franka-hand
  armload identify loaded.csv --robot my_arm.urdf --frame tool0 --tare unloaded.csv
  armload identify run.csv --robot ur10e --gravity=-9.81,0,0        (on a wall)
  armload identify run.csv --robot panda --json > payload.json      (usable as --tool later)

  armload identify flight.csv --robot my_arm.urdf --columns "t=clock,q=enc_{i},dq=rate_{i},tau=load_{i},t_unit=ms"

A log is a table (CSV, Parquet, NPZ, HDF5) with time, position, velocity and torque of each joint under the names that
tools give them (docs/recordings.md), in seconds, radians, rad/s and N·m, or a ROS 1 or ROS 2 bag of
sensor_msgs/JointState. Torque is the measured joint torque, with gravity in it.
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
    add_column_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return parser


def run(options: argparse.Namespace) -> None:
    """Identify and print."""
    from armload.errors import UsageError
    from armload.identification import identify

    with working("reading") as say:
        arm = arm_of(options)
        tool = None if options.tool is None else payload_of(options.tool, arm)
        if options.tare_topic is not None and options.tare is None:
            raise UsageError("--tare-topic names a topic of the tare's bag, but there is no --tare")
        topics = (options.topic, options.tare_topic or options.topic)
        log, tare = read_logs(options, arm, options.log, options.tare, topics=topics)
        assert log is not None
        result = identify(log, arm, tare=tare, tool=tool, method=options.method, progress=say)
    for note in (*log.notes, *(tare.notes if tare else ()), *result.notes):
        print_note(note)
    if options.json:
        print_json(result.to_dict())
        print_note(f"method {result.method}: {result.why}")
    else:
        print_identification(result)
