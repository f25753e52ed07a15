"""What the options of a command name: an arm, its logs and what stands around it, a payload, a motion, a world."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from armload.app.cli.arguments import AS_NAMED, COLUMN_OPTIONS
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.printing import print_note
from armload.errors import NoEpisodesError, RecordingError, UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.devices import Load
    from armload.excitation import Obstacle, Surroundings
    from armload.inertia import InertialParameters
    from armload.lab.dataset import Dataset
    from armload.motion import Motion
    from armload.payloads import Payload
    from armload.recording import ColumnSpec, Recording
    from armload.simulation import World

_SIMULATED = "panda"
BUILT_IN = ("franka-hand", "test")  # payloads that need no file


def columns_of(options: argparse.Namespace, of_tare: bool = False) -> ColumnSpec:
    """What `--columns` and its companions say of the log, or of the tare: the same unless `--tare-columns` differs."""
    from armload.recording import ColumnSpec

    if of_tare and (given := getattr(options, "tare_columns", None)) is not None:
        spec = ColumnSpec() if given == AS_NAMED else ColumnSpec.of(given)
    else:
        companions = {"tau": "effort_key", "rate": "log_rate", "episode": "episode"}
        more = {key: getattr(options, name, None) for key, name in companions.items()}
        spec = ColumnSpec.of(options.columns).over(**more)
    episode = getattr(options, "tare_episode", None) if of_tare else None
    return spec if episode is None else replace(spec, episode=episode)


def columns_for(options: argparse.Namespace, log: str | None, tare: str | None, of_tare: bool) -> ColumnSpec | None:
    """What `--columns` says of a log, or of its tare: nothing of a bag where the other is a table, which it is of.

    Raises:
        UsageError: it says units, which a bag has, too, and not of which of the two.
    """
    from armload.recording import ColumnSpec, has_topics

    path, other = (tare, log) if of_tare else (log, tare)
    own = getattr(options, "tare_columns", None) or (of_tare and getattr(options, "tare_episode", None) is not None)
    if not own and path is not None and other is not None and has_topics(path) and not has_topics(other):
        spec = columns_of(options)
        if spec.of_values != ColumnSpec():
            raise UsageError(
                "--columns says units, and of log and tare one is a bag, the other a table: say those of the tare with "
                f"--tare-columns ({AS_NAMED}, if its own header says all)"
            )
        return None
    return columns_of(options, of_tare)


def read_logs(
    options: argparse.Namespace,
    arm: Arm,
    log: str | None,
    tare: str | None = None,
    topics: tuple[str | None, str | None] | None = None,
) -> tuple[Recording | None, Recording | None]:
    """A log and its tare, by their paths; None stays None.

    Topics are for bags, columns for tables. Where there is none of the kind, reading says that they were named in vain.

    Args:
        options: of the command.
        arm: whose logs they are.
        log, tare: paths.
        topics: of each (default: `--topic`).
    """
    from armload.recording import has_topics

    of_tare = [getattr(options, name, None) for name in ("tare_columns", "tare_episode")]
    if of_tare != [None, None] and options.tare is None:
        raise UsageError("--tare-columns and --tare-episode are for a tare, but there is no --tare")
    bags = [path is not None and has_topics(path) for path in (log, tare)]
    read: list[Recording | None] = [None, None]
    for k, path in enumerate((log, tare)):
        if path is None:
            continue
        own = k == 1 and of_tare != [None, None]
        columns = columns_for(options, log, tare, of_tare=k == 1)
        topic = (topics or (getattr(options, "topic", None),) * 2)[k]
        topic = topic if bags[k] or not any(bags) else None
        try:
            read[k] = _read(path, arm, topic, columns, of_the_other=k == 1 and not own)
        except RecordingError as error:
            if k == 1 and not own and columns is not None and _reads(path, arm):
                raise RecordingError(
                    f"{error}; if the tare's own header says all, add --tare-columns {AS_NAMED}"
                ) from None
            raise
    return read[0], read[1]


def _read(path: str, arm: Arm, topic: str | None, columns: ColumnSpec | None, of_the_other: bool) -> Recording:
    """A log; one without episodes is read whole if the episode that is named is `of_the_other`."""
    from armload.recording import read_recording

    try:
        return read_recording(path, arm, topic=topic, columns=columns)
    except NoEpisodesError:
        if columns is None or not of_the_other:
            raise
        return read_recording(path, arm, topic=topic, columns=replace(columns, episode=None))


def _reads(path: str, arm: Arm) -> bool:
    """Whether a log can be read by what its header says alone."""
    from armload.recording import read_recording

    try:
        read_recording(path, arm)
    except RecordingError:
        return False
    return True


def with_gravity_put_back(
    log: Recording, tare: Recording | None, arm: Arm, payload: str
) -> tuple[Recording, Recording | None]:
    """Logs with the gravity that their controller took out of the torque: the arm's, and a payload's or `nothing`'s."""
    from armload.payloads import NOTHING
    from armload.recording import with_gravity

    held = None if payload == NOTHING else payload_of(payload, arm)  # once: it may be a pipe
    return with_gravity(log, arm, held), None if tare is None else with_gravity(tare, arm, held)


def arm_of(options: argparse.Namespace) -> Arm:
    """The arm that `--robot`, `--frame` and `--gravity` name."""
    from armload.arms import arm

    settings = {} if options.gravity is None else {"gravity": options.gravity}
    return arm(options.robot, options.frame, **settings)


def arm_of_dataset(dataset: Dataset, robot: str | None) -> Arm:
    """The arm a data set was made with; `robot` names it where it is not a built-in one."""
    from armload.arms import arm

    about = dataset.provenance["arm"]
    made_with = arm(robot or about["name"], about["frame"], tuple(about["gravity"]))
    if made_with.fingerprint != about["fingerprint"]:
        raise UsageError(f"{dataset.path} was made with another {about['name']}: name its URDF with --robot")
    return made_with


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


def check_columns(options: argparse.Namespace, *names: str | None) -> None:
    """Refuse what `--columns` and its companions say where none of the runs that are named is a log.

    Raises:
        UsageError: all of them are motions.
    """
    if all(name is None or names_motion(name) for name in names):
        refuse_idle(given(options, *COLUMN_OPTIONS), "of a log, and none is named")


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
