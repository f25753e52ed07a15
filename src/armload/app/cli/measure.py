"""`armload measure`: the arm is moved, without and with the payload, and the answer is given, in one command."""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import (
    Parser,
    add_arm_arguments,
    add_column_arguments,
    add_tare_and_mass_arguments,
    at_least,
    file_name,
)
from armload.app.cli.motion_arguments import box
from armload.app.cli.named import arm_of, motion_of, payload_of, read_logs, robot_of, world_of
from armload.app.cli.printing import print_json, print_note, working, write_json
from armload.errors import SafetyError, SinkError, UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armload.arms import Arm
    from armload.devices import Mover
    from armload.excitation import Obstacle
    from armload.inertia import InertialParameters
    from armload.measuring import Measurement, Plan
    from armload.motion import Motion
    from armload.posterior import Profile

_EXAMPLES = """\
examples:
  armload measure sim --dry-run
  armload measure sim --motion taie2024 --dry-run
  armload measure sim --motion taie2024 --move --speed max
  armload measure fr3://172.16.0.2 --motion excite.json --until mass=10g,moment=1.5g.m
  armload measure ur://192.168.0.10 --robot ur10e --motion random:1 --mass 1.200±0.002 --out payload.json
  armload measure ros2:///joint_states --robot ur5e --motion excite.json --tare empty.csv

What will move, how far and how fast is said first, and nothing moves until you type yes (or give --move). Ctrl-C stops
the arm on its path. Keep the emergency stop at hand: nothing here knows what stands around the arm but the floor and
the boxes that --box names.
"""


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
        help="taie2024, a JSON or CSV file, or random:SEED (default: designed about the present pose)",
    )
    add("--time", type=at_least(0.2, float, 60.0), default=2.0, metavar="S", help="of a motion that is designed (2)")
    add(
        "--tool-speed",
        type=at_least(0.01, float),
        default=0.5,
        metavar="V",
        help="of the payload frame in a motion that is designed, at most [m/s] (0.5)",
    )
    add("--dry-run", action="store_true", help="connect, say what would move and check it; move nothing")
    add("--move", action="store_true", help="move without asking: for who has seen the dry run")
    add("--until", metavar="WIDTHS", help="stop when 95%% half-widths are mass=10g,moment=1.5g.m,inertia=1e-3")
    add("--dir", type=file_name, metavar="DIR", help="folder of the logs (default: measurement-DATE-TIME)")
    add(
        "--tare", type=file_name, metavar="LOG0", help="a log of the empty arm: no empty run, the payload is on already"
    )
    add_tare_and_mass_arguments(parser)
    add("--profile", type=file_name, metavar="P", help="what many logs said of this arm (armload profile)")
    add(
        "--tool",
        type=file_name,
        metavar="FILE",
        help="a known tool that is on in both runs (JSON, or franka-hand); the answer is what it carries",
    )
    add("--method", type=file_name, metavar="M", help="a name `armload methods` lists, or a trained model's path")
    add("--grip", metavar="COMMAND", help="a command that mounts the payload; else you are asked to")
    add_column_arguments(parser)
    safety = parser.add_argument_group("what is allowed").add_argument
    safety(
        "--floor", type=_floor, default=0.0, metavar="Z|none", help="height of the floor in the base's frame [m] (0)"
    )
    safety(
        "--box",
        type=box,
        action="append",
        default=[],
        metavar="X,Y,Z,SX,SY,SZ",
        help="an obstacle in the base's frame [m]; repeat for more",
    )
    safety("--approach", type=at_least(0.0, float), metavar="RAD", help="how far a joint may be from the start (1)")
    safety("--off-path", type=at_least(1e-3, float), default=0.05, metavar="RAD", help="more stops the arm (0.05)")
    safety(
        "--push",
        type=at_least(0.01, float),
        metavar="SHARE",
        help="of a joint's rated torque, beside a rated payload's; more stops the arm (0.15; motor currents: 0.5)",
    )
    answer = parser.add_argument_group("the answer").add_argument
    answer("--json", action="store_true", help="print one JSON object and nothing else")
    answer("--out", type=file_name, metavar="FILE", help="write the answer as JSON, whole or not at all")
    answer("--apply", action="store_true", help="write it to the controller, too (UR, Franka)")
    answer("--mounted", metavar="FILE", help="what was on at the empty run: JSON, franka-hand, or nothing; for --apply")
    answer(
        "--undetermined-inertia",
        action="store_true",
        help="--apply writes inertia that the runs did not determine, too",
    )
    sim = parser.add_argument_group("the simulator (sim)").add_argument
    sim("--payload", default="test", metavar="FILE", help="what is mounted: JSON, franka-hand, or test (test)")
    sim(
        "--world", default="real-like:0", metavar="W", help="the arm as it is: nominal, or real-like:SEED (real-like:0)"
    )
    sim(
        "--at",
        type=_pose,
        metavar="Q1,…",
        help="where it stands [rad] (default: where the motion begins, else the middle of the joints)",
    )
    sim("--speed", type=_speed, default=1.0, metavar="X|max", help="1: real time")
    sim("--seed", type=at_least(0), default=0, metavar="N", help="of the sensors' noise (0)")
    return parser


def run(options: argparse.Namespace) -> int | None:
    """Measure; 2 after an error, 130 after Ctrl-C, and the arm is at rest in any case."""
    from datetime import datetime

    from armload.devices import Thresholds, open_mover
    from armload.excitation import Accuracy
    from armload.measuring import Procedure
    from armload.measuring.plan import APPROACH
    from armload.posterior import KnownMass, load_profile

    options.robot = options.robot or robot_of(options.source)
    bare = arm_of(options)
    tool = None if options.tool is None else _tool(options, bare)
    arm = bare if tool is None else bare.with_payload(tool)
    profile = None if options.profile is None else load_profile(options.profile)
    if profile is not None:
        profile.check(arm)
    motion = None if options.motion is None else _motion(options.motion, arm)
    accuracy = None if options.until is None else Accuracy.read(options.until)
    mass = None if options.mass is None else KnownMass(*options.mass)
    mounted = tool if options.mounted in (None, "nothing") else payload_of(options.mounted, arm)
    if tool is not None and options.mounted is not None:
        raise UsageError("--tool is what is on at the empty run, and so is --mounted: give one of them")
    if options.tare_age is not None and options.tare is None:
        raise UsageError("--tare-age says how old a tare is, but there is no --tare")
    _, tare = read_logs(options, arm, None, options.tare)
    folder = options.dir or f"measurement-{datetime.now():%Y%m%d-%H%M%S}"
    simulated = {} if options.source != "sim" else _simulated(options, arm, motion, loaded=tare is not None)
    with open_mover(options.source, arm, **simulated) as mover:
        if motion is None:
            motion = _designed(arm, mover.commanded(), profile, options)
        if options.apply and not mover.writes:
            raise UsageError(f"{mover.name} takes no payload: leave out --apply, and export the answer")
        procedure = Procedure(
            mover,
            arm,
            motion,
            folder,
            tare=tare,
            tare_age=options.tare_age,
            profile=profile,
            mass=mass,
            method=options.method,
            accuracy=accuracy,
            floor=options.floor,
            boxes=_boxes(options),
            approach=APPROACH if options.approach is None else options.approach,
            thresholds=Thresholds(options.off_path, options.push),
            say=print_note,
        )
        if options.dry_run:
            procedure.plan.check()
            print_json(procedure.plan.to_dict()) if options.json else print(procedure.plan)
            return None
        found = procedure.run(_consent(options), _mount(options, mover))
        if options.out is not None:
            write_json(options.out, found.to_dict())
        for note in found.answer.notes:
            print_note(note)
        if options.apply:
            _apply(found, mover, mounted, options)
        _print(found, options)
    return None


def _motion(name: str, arm: Arm) -> Motion:
    from armload.motion import PathMotion

    return PathMotion.read(name) if name.lower().endswith(".csv") else motion_of(name, arm)


def _tool(options: argparse.Namespace, arm: Arm) -> InertialParameters:
    """The tool that is on in both runs.

    Raises:
        UsageError: there is a tare, of which nobody knows whether it was on.
    """
    from armload.identification import plausible_tool

    if options.tare is not None:
        raise UsageError(
            "--tool and --tare together are for a log (armload identify), which finds out whether the tool was mounted "
            "at the tare: give one of them; with a tare, the answer is what was added since"
        )
    return plausible_tool(arm.in_frame(payload_of(options.tool, arm)), arm)


def _boxes(options: argparse.Namespace) -> tuple[Obstacle, ...]:
    from armload.excitation import Obstacle

    return tuple(Obstacle((b[0], b[1], b[2]), (b[3], b[4], b[5])) for b in options.box)


def _designed(arm: Arm, pose: NDArray, profile: Profile | None, options: argparse.Namespace) -> Motion:
    """The motion about the present pose that tells most, for who named none: after an empty run of it, or a tare."""
    from armload.excitation import Constraints, Criterion, PayloadRange, Surroundings, design_motion

    heaviest = None if options.mass is None else PayloadRange(options.mass[0] + 3.0 * options.mass[1])
    around = Surroundings(arm, options.floor, _boxes(options))
    limits = Constraints(arm, pose, payload=heaviest, surroundings=around, speed=options.tool_speed)
    with working("designing a motion about the present pose"):
        return design_motion(limits, Criterion(arm, "same", profile), options.time, name="designed").motion


def _consent(options: argparse.Namespace) -> Callable[[Plan], bool]:
    def ask(plan: Plan) -> bool:
        print(plan, file=sys.stderr, flush=True)
        return options.move or _typed_yes("type yes to let the arm move: ")

    return ask


def _typed_yes(question: str) -> bool:
    if not sys.stdin.isatty():
        raise SafetyError("nothing was moved: nobody is at a terminal to agree; look at --dry-run, then give --move")
    print(question, end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip() == "yes"


def _mount(options: argparse.Namespace, mover: Mover) -> Callable[[], None]:
    def mount() -> None:
        if options.grip is not None:
            print_note(f"mounting: {options.grip}")
            code = subprocess.run(shlex.split(options.grip), stdout=sys.stderr, check=False).returncode
            if code:
                raise SafetyError(f"{options.grip} ended with exit code {code}: the payload may not be on")
        elif not mover.mount():
            print("mount the payload, step back, and press Enter: the arm then moves: ", end="", file=sys.stderr)
            sys.stderr.flush()
            if not sys.stdin.readline():
                raise SafetyError(
                    "nobody says that the payload is on: give --grip COMMAND, or its log with --tare; the empty run is "
                    "recorded"
                )

    return mount


def _print(found: Measurement, options: argparse.Namespace) -> None:
    from armload.identification.text import summary

    logs = " and ".join(str(path) for path in (found.empty, found.loaded) if path is not None)
    print_note(f"{found.seconds:.2f} s with the payload; logs: {logs}")
    if found.reached is False:
        print_note("the accuracy asked for was not reached: run a longer motion, or one that moves more joints")
    if options.json:
        print_json(found.to_dict())
    else:
        print(summary(found.answer, False))


def _apply(found: Measurement, mover: Mover, mounted: Any, options: argparse.Namespace) -> None:
    from armload.devices import Load
    from armload.inertia import InertialParameters

    load = Load.of(found.answer)
    if mounted is not None:
        load = load + mounted
    elif options.mounted == "nothing":
        load = load + InertialParameters.zero(found.answer.frame)
    if not options.move and not _typed_yes("type yes to write it to the controller: "):
        raise SafetyError("nothing was written: there was no consent")
    try:
        sent = mover.write(load, allow_undetermined_inertia=options.undetermined_inertia)
    except SinkError as error:
        again = f"armload identify {found.loaded} --robot {options.robot} --tare {found.empty or options.tare}"
        raise SinkError(f"nothing was written: {error}; `{again}` tells the answer") from None
    print_note(f"written to {mover.name}: {sent}")


def _simulated(options: argparse.Namespace, arm: Arm, motion: Motion | None, loaded: bool) -> dict[str, Any]:
    import numpy as np

    payload = payload_of(options.payload, arm)
    middle = 0.5 * (arm.limits.position_low + arm.limits.position_high)
    stands = np.where(np.isfinite(middle), middle, 0.0) if motion is None else motion.position([0.0])[0]
    return {
        "at": stands if options.at is None else options.at,
        "payload": payload,
        "mounted": payload if loaded else None,
        "world": world_of(options.world, arm),
        "speed": options.speed,
        "seed": options.seed,
    }


def _floor(text: str) -> float | None:
    if text == "none":
        return None
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a height: expected metres, or none") from None


def _pose(text: str) -> list[float]:
    try:
        return [float(x) for x in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a pose: expected radians, separated by commas") from None


def _speed(text: str) -> float | None:
    return None if text == "max" else at_least(0.01, float)(text)
