"""`armload identify`: one log in, one payload out."""

from __future__ import annotations

import argparse

from armload.app.cli.arguments import (
    add_arm_arguments,
    add_column_arguments,
    add_identifier_arguments,
    add_known_arguments,
    add_tare_age_argument,
    add_tool_and_topic_arguments,
    check_tare_age,
    file_name,
    output_file,
)
from armload.app.cli.export import FORMS, write
from armload.app.cli.named import arm_of, payload_named
from armload.app.cli.named_logs import read_logs, with_gravity_put_back
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_json, print_note, working, write_json

_EXAMPLES = """\
examples:
  armload identify run.csv --robot panda
  armload identify run.mcap --robot panda --tool franka-hand
  armload identify loaded.csv --robot my_arm.urdf --frame tool0 --tare unloaded.csv
  armload identify run.csv --robot ur10e --gravity=-9.81,0,0        (on a wall)
  armload identify run.csv --robot panda --tare yesterday.csv --tare-age 1d
  armload identify run.csv --robot panda --profile arm.profile       (what armload profile learned of the arm)
  armload identify run.csv --robot panda --mass 1.200±0.002         (weighed: what is left is found better)
  armload identify run.csv --robot panda --com 0,0,0.06±0.003       (the centre of mass of a drawing, [m])
  armload identify run.csv --robot panda --body gear.json           (a drawing, and how far it can be trusted)
  armload identify run.csv --robot panda --family wide              (a tray, a bar or a ring)
  armload identify bag/ --robot ur10e --tare empty/ --compensated set.json   (torque without gravity)
  armload identify run.csv --robot panda --out payload.json         (the answer as JSON, usable as --tool later)
  armload identify run.csv --robot panda --tool franka-hand --to franka    (what the controller reads)

  armload identify flight.csv --robot my_arm.urdf --columns "t=clock,q=enc_{i},dq=rate_{i},tau=load_{i},t_unit=ms"

A log is a table (CSV, Parquet, NPZ, HDF5, MATLAB) with time, position, velocity and torque of each joint under the
names that tools give them (docs/recordings.md), in seconds, radians, rad/s and N·m, or a ROS 1 or ROS 2 bag of
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
    add_tare_age_argument(parser)
    add_known_arguments(parser)
    add_tool_and_topic_arguments(parser)
    parser.add_argument("--tare-topic", metavar="T", help="that of the tare's bag, where it is another one")
    parser.add_argument(
        "--compensated",
        type=file_name,
        metavar="PAYLOAD",
        help="the torque has gravity taken out (UR's ROS 2 driver): that of the arm is put back, and that of what the "
        "controller was set to carry (JSON, franka-hand, or nothing)",
    )
    add_column_arguments(parser)
    parser.add_argument("--all", action="store_true", help="print the ten parameters about the frame's origin, too")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument(
        "--to",
        choices=FORMS,
        metavar="FORM",
        help=f"print it as a controller or simulator reads it, as `armload export` does: {', '.join(FORMS)}",
    )
    parser.add_argument(
        "--out", type=output_file, metavar="FILE", help="write a file, whole or not at all: JSON, or the form of --to"
    )
    return parser


def run(options: argparse.Namespace) -> None:
    """Identify and print."""
    from armload.errors import UsageError
    from armload.identification import identify
    from armload.identification.text import summary

    with working("reading") as say:
        arm = arm_of(options)
        tool = None if options.tool is None else payload_named(options.tool, arm)
        if options.to is not None and (options.json or options.all):
            raise UsageError("--to prints a controller's form alone: leave out --json and --all")
        if options.tare_topic is not None and options.tare is None:
            raise UsageError("--tare-topic names a topic of the tare's bag, but there is no --tare")
        check_tare_age(options)
        topics = (options.topic, options.tare_topic or options.topic)
        log, tare = read_logs(options, arm, options.log, options.tare, topics=topics)
        assert log is not None
        if options.compensated is not None:
            log, tare = with_gravity_put_back(log, tare, arm, options.compensated)
        result = identify(
            log,
            arm,
            tare=tare,
            tare_age=options.tare_age,
            tool=tool,
            mass=options.mass,
            com=options.com,
            body=options.body,
            family=options.family,
            profile=options.profile,
            method=options.method,
            progress=say,
        )
    if options.to is not None:
        from armload.devices import Load

        write(Load.of(result), options.to, options.out, arm, options.frame, earlier=result.notes)
        return
    if options.out is not None:
        write_json(options.out, result.to_dict())
    for note in result.notes:
        print_note(note)
    if options.json:
        print_json(result.to_dict())
    else:
        print(summary(result, options.all))
