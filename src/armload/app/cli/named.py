"""What the options of a command name: an arm and what stands around it, a payload, a motion, a world."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from armload.app.cli.printing import print_note
from armload.errors import ArmError, UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.devices import Load
    from armload.excitation import Obstacle, Surroundings
    from armload.inertia import InertialParameters
    from armload.lab.dataset import Dataset
    from armload.motion import Motion
    from armload.payloads import Payload
    from armload.simulation import World

_SIMULATED = "panda"
BUILT_IN = ("franka-hand", "test")  # payloads that need no file


def arm_of(options: argparse.Namespace) -> Arm:
    """The arm that `--robot`, `--frame` and `--gravity` name."""
    from armload.arms import arm

    settings = {} if options.gravity is None else {"gravity": options.gravity}
    return arm(options.robot, options.frame, **settings)


def arm_of_dataset(dataset: Dataset, robot: str | None) -> Arm:
    """The arm a data set was made with; `robot` names it where it is not a built-in one.

    Raises:
        UsageError: what is named, or built in under the data set's name, is another arm, or there is none.
    """
    from armload.arms import arm

    about = dataset.provenance["arm"]
    made_with = f"{dataset.path} was made with the arm {about['name']} about {about['frame']}"
    try:
        found = arm(robot or about["name"], about["frame"], tuple(about["gravity"]))
    except ArmError as error:
        raise UsageError(f"{made_with}, which --robot has to name ({error})") from None
    if found.fingerprint != about["fingerprint"]:
        another = f"--robot {robot}" if robot else f"the built-in {about['name']}"
        raise UsageError(f"{made_with}, and {another} is another one: name its own description with --robot")
    return found


def payload_named(name: str, arm: Arm | None = None) -> Payload:
    """A payload file, or a built-in payload by name; the hand is about the arm's own flange."""
    from armload.payloads import franka_hand, hand_on, read_payload, test_payload

    if name == "franka-hand":
        return franka_hand() if arm is None else hand_on(arm)
    return test_payload() if name == "test" else read_payload(name)


def payload_of(name: str, arm: Arm | None = None) -> InertialParameters:
    """Its parameters; a note says so where the inertia among them is an assumption."""
    from armload.payloads import INERTIA_ASSUMED

    payload = payload_named(name, arm)
    if not payload.inertia_known:
        print_note(f"{name}: {INERTIA_ASSUMED}")
    return payload.parameters


def load_of(name: str, arm: Arm | None = None) -> Load:
    """What is told to a controller: a payload file, a saved result or a built-in payload, with how well it is known."""
    from armload.devices import Load, read_load

    return Load(payload_of(name, arm)) if name in BUILT_IN else read_load(name)


def part_of(name: str, frame: str | None, arm: Arm | None) -> Load:
    """The same about a frame, to be added to a load or taken off it; a note says where its inertia is an assumption.

    Raises:
        IdentificationError: the arm cannot carry it: it is given in grams, say.
    """
    from armload.identification import plausible_tool
    from armload.payloads import INERTIA_ASSUMED

    part = load_of(name, arm)
    if INERTIA_ASSUMED in part.remarks:
        print_note(f"{name}: {INERTIA_ASSUMED}")
    part = part.about(frame, arm)
    if arm is not None:
        plausible_tool(part.parameters, arm)
    return part


def robot_of(source: str) -> str:
    """The robot of a source where --robot does not name one."""
    from armload.arms import ARMS

    if source == "sim":
        return _SIMULATED
    scheme = source.partition("://")[0].lower() if "://" in source else None
    known = [name for name, facts in ARMS.items() if scheme is not None and facts.scheme == scheme]
    if len(known) != 1:
        raise UsageError(f"{source}: name the robot with --robot, such as --robot {_SIMULATED}")
    return known[0]


def names_motion(name: str) -> bool:
    """Whether a run is a motion: no folder and no log by its suffix, or a table that a motion was exported to."""
    from armload.motion import PathMotion
    from armload.recording import is_log

    path = Path(name)
    return not path.is_dir() and (not is_log(path) or PathMotion.is_table(path))


def motion_of(name: str, arm: Arm, of_arm: bool = True) -> Motion:
    """A motion by name (`taie2024`), from a file, or drawn for the arm (`random:SEED`).

    A file is a motion's JSON, an exported table (CSV) or a JointTrajectory (YAML or JSON), whose joints are named and
    so are always the arm's.

    of_arm: whether it must be one of the arm's; else the arm is what a random one is drawn for.

    Raises:
        MotionError: it cannot be read, or moves another number of joints than the arm has.
    """
    from armload.devices.ros2.trajectory_file import is_trajectory, read_path
    from armload.motion import PathMotion, check_joints, load_motion, random_motion, taie2024

    if name.startswith("random:"):
        return random_motion(arm, whole_number(name, "motion"))
    if name == "taie2024":
        motion: Motion = taie2024()
    elif name.lower().endswith(".csv"):
        motion = PathMotion.read(name)
    elif is_trajectory(name):
        motion = read_path(name, arm)
    else:
        motion = load_motion(name)
    if of_arm:
        check_joints(motion, arm)
    return motion


def boxes_of(options: argparse.Namespace) -> tuple[Obstacle, ...]:
    """The obstacles that `--box` names."""
    from armload.excitation import Obstacle

    return tuple(Obstacle((x, y, z), (sx, sy, sz)) for x, y, z, sx, sy, sz in options.box)


def surroundings_of(options: argparse.Namespace, arm: Arm) -> Surroundings:
    """What `--floor`, `--box` and, of the commands that have it, `--held` say: what the arm stays clear of."""
    from armload.excitation import Surroundings
    from armload.motion.collision import PAYLOAD_RADIUS

    held = getattr(options, "held", None)
    return Surroundings(arm, options.floor, boxes_of(options), PAYLOAD_RADIUS if held is None else held)


def world_of(name: str, arm: Arm) -> World:
    """A world by name: `nominal`, or `real-like:SEED`."""
    from armload.simulation import World

    if name == "nominal":
        return World.nominal(arm)
    if name.startswith("real-like:"):
        return World.real_like(arm, whole_number(name, "world"))
    raise UsageError(f"unknown world {name!r}: expected nominal or real-like:SEED")


def whole_number(text: str, what: str) -> int:
    """The number behind the colon of `random:3`.

    >>> whole_number("random:3", "motion")
    3
    """
    kind, _, number = text.partition(":")
    if not number.isdecimal():
        raise UsageError(f"{what} {text!r} has no whole number behind the colon: expected one, such as {kind}:3")
    return int(number)
