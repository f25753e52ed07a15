"""What the commands share: a parser with one-sentence errors, and the arguments that name an arm, a tool and so on."""

from __future__ import annotations

import argparse
from importlib import resources
from typing import TYPE_CHECKING, NoReturn

from armload.app.cli.printing import print_note
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.inertia import InertialParameters
    from armload.lab.dataset import Dataset
    from armload.motion import Motion
    from armload.payloads import Payload
    from armload.simulation import World

# options whose value may begin with a minus sign: argparse would take "-1,0,-9.7" for an option
_SIGNED = ("--gravity",)


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one sentence without usage, and whose help keeps its line breaks."""

    def __init__(self, **settings) -> None:
        super().__init__(allow_abbrev=False, formatter_class=_Help, **settings)

    def print_help(self, file=None) -> None:
        """Print the help; unlike argparse, do not hide that it cannot be written."""
        print(self.format_help(), end="", file=file)

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(f"{message.replace('argument ', '', 1)}; see '{self.prog} --help'")


class _Help(argparse.RawDescriptionHelpFormatter):
    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=28, width=110)


def attach_values(arguments: list[str]) -> list[str]:
    """Write `--gravity VALUE` as `--gravity=VALUE`, so that the value may begin with a minus sign.

    >>> attach_values(["log.csv", "--gravity", "-1,0,-9.7", "--json"])
    ['log.csv', '--gravity=-1,0,-9.7', '--json']
    """
    out: list[str] = []
    for argument in arguments:
        if out and out[-1] in _SIGNED and not argument.startswith("--"):
            out[-1] += f"={argument}"
        else:
            out.append(argument)
    return out


def gravity(text: str) -> tuple[float, float, float]:
    """Three numbers separated by commas; whether they make sense is for the arm to say.

    >>> gravity("0,0,-9.81")
    (0.0, 0.0, -9.81)
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a gravity: expected three numbers x,y,z in m/s², such as 0,0,-9.81"
        ) from None
    return x, y, z


def file_name(text: str) -> str:
    """The name of a file; an empty one would be the current folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty: expected a file")
    return text


def at_least(least: float, kind: type = int, most: float = float("inf")):
    """An argument type: a number of at least `least`, and at most `most` where memory or time would run out."""

    def read(text: str) -> float:
        what = "a whole number" if kind is int else "a number"
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not least <= value <= most or value == float("inf"):
            bounds = f"of at least {least}" if most == float("inf") else f"from {least:g} to {most:g}"
            raise argparse.ArgumentTypeError(f"{text!r} is not possible: expected {what} {bounds}")
        return value

    return read


def add_arm_arguments(parser: argparse.ArgumentParser, default: str | None = None, required: bool = True) -> None:
    """`--robot`, `--frame` and `--gravity`; with a default, `--robot` is not required."""
    parser.add_argument(
        "--robot",
        required=required and default is None,
        default=default,
        metavar="NAME|FILE.urdf",
        help=f"{', '.join(_arms())}, or the path of a URDF file" + (f" (default: {default})" if default else ""),
    )
    parser.add_argument(
        "--frame", metavar="F", help="link whose frame the payload is about (default: the flange; a URDF's last link)"
    )
    parser.add_argument(
        "--gravity",
        type=gravity,
        metavar="X,Y,Z",
        help="gravity in the axes of the robot's base [m/s²], for a tilted base (default: 0,0,-9.81)",
    )


def _arms() -> list[str]:
    """The built-in arms, by their sheets: --help must not wait for what `armload.arms` imports."""
    sheets = resources.files("armload").joinpath("arms", "descriptions").iterdir()
    return sorted(sheet.name.removesuffix(".toml") for sheet in sheets if sheet.name.endswith(".toml"))


def add_identifier_arguments(parser: argparse.ArgumentParser) -> None:
    """`--tare` and `--method`."""
    parser.add_argument(
        "--tare",
        type=file_name,
        metavar="LOG0",
        help="an earlier log of the same arm, on any motion; the answer is what was added since",
    )
    parser.add_argument(
        "--method",
        type=file_name,
        metavar="M",
        help="a name `armload methods` lists, or the path of a trained model (default: the most trustworthy)",
    )


def add_tool_and_topic_arguments(parser: argparse.ArgumentParser) -> None:
    """`--tool` and `--topic`."""
    parser.add_argument(
        "--tool",
        type=file_name,
        metavar="FILE",
        help="a mounted tool that is known (JSON, or franka-hand); the answer is what it carries",
    )
    parser.add_argument("--topic", metavar="T", help="JointState topic of a bag, where it has several")


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


def motion_of(name: str, arm: Arm) -> Motion:
    """A motion by name (`taie2024`), from a JSON file, or drawn for the arm (`random:SEED`)."""
    from armload.motion import load_motion, random_motion, taie2024

    if name == "taie2024":
        return taie2024()
    if name.startswith("random:"):
        return random_motion(arm, whole_number(name, "motion"))
    return load_motion(name)


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
