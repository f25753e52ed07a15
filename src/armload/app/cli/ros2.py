"""`armload ros2`: armload among ROS 2 nodes, as the one that identifies or as a simulated robot."""

from __future__ import annotations

import argparse
import time

from armload.app.cli.arguments import (
    COLUMNS,
    add_arm_arguments,
    add_identifier_arguments,
    add_tare_age_argument,
    at_least,
    check_tare_age,
    file_name,
)
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.named import arm_of, motion_of, payload_of, world_of
from armload.app.cli.named_logs import read_logs
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note

_EXAMPLES = """\
examples:
  armload ros2 simulate --robot panda --payload test --motion taie2024
  armload ros2 node --robot panda
  armload ros2 node --robot panda --topic /franka/joint_states --tare empty.csv
  armload motion export taie2024 --format ros2 --robot panda --out excite.yaml
  ros2 topic pub --once /joint_trajectory_controller/joint_trajectory \\
      trajectory_msgs/msg/JointTrajectory "$(cat excite.yaml)"

Both need a Python with ROS 2 (rclpy), see docs/ros2.md, and run until Ctrl-C. Effort is joint torque in N·m, gravity
in it; UR's driver may publish another: see there.
"""


def parser() -> Parser:
    """The arguments of `armload ros2`."""
    parser = Parser(
        prog="armload ros2",
        description="Identify the payload from joint states on ROS 2, or be a simulated robot there.",
        epilog=_EXAMPLES,
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")

    node = actions.add_parser(
        "node",
        help="joint states in, the payload out",
        description="Subscribe to sensor_msgs/JointState and publish the payload as geometry_msgs/InertiaStamped.",
    )
    add_arm_arguments(node)
    node.add_argument(
        "--topic",
        type=file_name,
        default="/joint_states",
        metavar="T",
        help="of the joint states (default: /joint_states); with ?torque_constants=… or ?compensated=PAYLOAD, "
        "where effort is no joint torque",
    )
    node.add_argument(
        "--publish",
        type=file_name,
        default="/payload/inertia",
        metavar="T",
        help="of the payload (default: /payload/inertia)",
    )
    add_identifier_arguments(node)
    add_tare_age_argument(node)
    node.add_argument("--columns", type=file_name, metavar="SPEC", help=f"of the tare: {COLUMNS}")
    node.add_argument(
        "--rate",
        type=at_least(0.01, float, 1000.0),
        default=10.0,
        metavar="HZ",
        help="messages per second (default: 10)",
    )
    node.add_argument(
        "--timeout",
        type=at_least(0.1, float),
        metavar="S",
        help="end with an error after so many seconds without joint states (default: wait)",
    )

    simulate = actions.add_parser(
        "simulate",
        help="a simulated robot: joint states out, trajectories in",
        description="Publish the joint states of a simulated arm with a payload that its controller does not know, and "
        "obey trajectory_msgs/JointTrajectory.",
    )
    add_arm_arguments(simulate)
    simulate.add_argument(
        "--payload",
        type=file_name,
        metavar="FILE",
        help="what it holds: a JSON file, franka-hand, or test (default: nothing)",
    )
    simulate.add_argument(
        "--motion",
        metavar="MOTION",
        help="taie2024, a JSON file, or random:SEED, repeated until a trajectory comes (default: stand)",
    )
    simulate.add_argument(
        "--world",
        default="nominal",
        metavar="W",
        help="the arm as it is: nominal, or real-like:SEED (default: nominal)",
    )
    simulate.add_argument(
        "--noise",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="sensors as measured on real robots, or ideal ones (default: --noise)",
    )
    simulate.add_argument(
        "--rate",
        type=at_least(20.0, float, 1000.0),
        default=200.0,
        metavar="HZ",
        help="joint states per second (default: 200)",
    )
    simulate.add_argument(
        "--topic",
        type=file_name,
        default="/joint_states",
        metavar="T",
        help="of the joint states (default: /joint_states)",
    )
    simulate.add_argument(
        "--command",
        type=file_name,
        default="/joint_trajectory_controller/joint_trajectory",
        metavar="T",
        help="of the trajectories (default: /joint_trajectory_controller/joint_trajectory)",
    )
    simulate.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="of the sensors' noise (default: 0)")
    return parser


def run(options: argparse.Namespace) -> None:
    """Run the node until somebody interrupts."""
    {"node": _node, "simulate": _simulate}[options.action](options)


def _node(options: argparse.Namespace) -> None:
    from armload.devices import Ros2Source
    from armload.devices.opening import address_of
    from armload.devices.ros2 import PayloadNode
    from armload.identification.tare_age import age_of
    from armload.inertia import InertialParameters
    from armload.online import OnlineIdentifier
    from armload.posterior import load_profile

    check_tare_age(options)
    if options.tare is None:
        refuse_idle(given(options, "columns"), "of the log of --tare, which is not given")
    arm = arm_of(options)
    address = address_of(options.topic if "://" in options.topic else f"ros2://{options.topic}")
    effort = address.effort(arm)
    _, tare = read_logs(options, arm, None, options.tare, topics=(None, None))
    profile = None if options.profile is None else load_profile(options.profile)
    age, aged = age_of(tare, time.time(), options.tare_age)
    for note in aged:
        print_note(note)
    identifier = OnlineIdentifier(arm, tare, options.method, profile, tare_age=age)
    begun = False

    def tell(body: InertialParameters) -> None:
        nonlocal begun
        if not begun:
            print_note(f"publishing {options.publish}: {body.mass:.3f} kg about {body.frame} to begin with")
            begun = True

    print_note(f"waiting for {address.host}; method {identifier.method}")
    try:
        named = {"timeout": options.timeout, "node": "armload_payload", "effort": effort}
        with Ros2Source(address.host, arm, **named) as source:
            print_note(f"{address.host}: {arm.n} joints of {arm.name} at {source.rate:.0f} Hz")
            for note in source.notes:
                print_note(note)
            node = PayloadNode(source, lambda sample: identifier.update(*sample), options.publish, rate=options.rate)
            node.run(tell)
    finally:
        identifier.close()


def _simulate(options: argparse.Namespace) -> None:
    from armload.devices import Ros2Connection
    from armload.devices.ros2 import RobotNode
    from armload.simulation import Sensors

    arm = arm_of(options)
    world = world_of(options.world, arm)
    payload = None if options.payload is None else payload_of(options.payload, arm)
    first = arm.limits.middle if options.motion is None else motion_of(options.motion, arm)
    connection = Ros2Connection("armload_robot")
    try:
        node = RobotNode(
            arm,
            connection,
            first,
            payload,
            world=world,
            sensors=Sensors.of(arm) if options.noise else None,
            rate=options.rate,
            seed=options.seed,
            states=options.topic,
            commands=options.command,
            say=print_note,
        )
        print_note(f"{arm.name} on {options.topic}, {options.rate:g} Hz; trajectories on {options.command}")
        node.run()
    finally:
        connection.close()
