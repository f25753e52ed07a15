"""The options that several commands have, and what their values are read as."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import resources
from typing import TypeVar

from armload.errors import IdentificationError, UsageError

T = TypeVar("T")
COLUMNS = 'names and units of columns, such as "t=time,q=joint_pos_{i},t_unit=ms", or a TOML file'
AS_NAMED = "none"  # as SPEC: nothing is said of the columns
# of a log that is a table: what `add_column_arguments` adds, those of the tare last
COLUMN_OPTIONS = ("columns", "effort_key", "log_rate", "episode", "tare_episode", "tare_columns")


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


class OutputFile(str):
    """The name of a file that a command writes; `outputs.check_outputs` looks at all of them before it begins."""


class OutputFolder(str):
    """The name of a folder that a command writes into, likewise; it is made where there is none."""


def output_file(text: str) -> OutputFile:
    """The name of a file to write."""
    return OutputFile(file_name(text))


def output_folder(text: str) -> OutputFolder:
    """The name of a folder to write into."""
    return OutputFolder(file_name(text))


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


def pace(text: str) -> float | None:
    """Times real time, or max: as fast as possible, which is None."""
    return None if text == "max" else at_least(0.01, float)(text)


def add_arm_arguments(parser: argparse.ArgumentParser, default: str | None = None, required: bool = True) -> None:
    """`--robot`, `--frame` and `--gravity`; with a default, `--robot` is not required."""
    parser.add_argument(
        "--robot",
        required=required and default is None,
        default=default,
        metavar="NAME|FILE.urdf",
        help=f"{', '.join(built_in_arms())}, or the path of a URDF file"
        + (f" (default: {default})" if default else ""),
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


def built_in_arms() -> list[str]:
    """The arms that need no file, by their sheets: --help must not wait for what `armload.arms` imports."""
    sheets = resources.files("armload").joinpath("arms", "descriptions").iterdir()
    return sorted(sheet.name.removesuffix(".toml") for sheet in sheets if sheet.name.endswith(".toml"))


def duration(text: str) -> float:
    """A time with its unit, in seconds.

    >>> duration("1d"), duration("90min")
    (86400.0, 5400.0)
    """
    from armload.identification.tare_age import seconds_of

    try:
        return seconds_of(text)
    except IdentificationError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def weighed(text: str) -> tuple[float, float]:
    """See `armload.identification.known_options.weighed`."""
    from armload.identification import known_options

    return _understood(known_options.weighed, text)


def centre(text: str) -> tuple[tuple[float, ...], float]:
    """See `armload.identification.known_options.centre`."""
    from armload.identification import known_options

    return _understood(known_options.centre, text)


def _families(text: str) -> tuple[str, ...]:
    from armload.identification import known_options

    return _understood(known_options.families, text)


def _understood(read: Callable[[str], T], text: str) -> T:
    """What a reader of texts makes of an argument."""
    try:
        return read(text)
    except IdentificationError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_tare_age_argument(parser: argparse.ArgumentParser) -> None:
    """`--tare-age`."""
    parser.add_argument(
        "--tare-age",
        type=duration,
        metavar="TIME",
        help="how old the tare is, such as 1d or 8h: the arm may have changed (default: by the logs' clocks)",
    )


def check_tare_age(options: argparse.Namespace) -> None:
    """Refuse the age of a tare that there is none of.

    Raises:
        UsageError: there is `--tare-age`, but no `--tare`.
    """
    if options.tare_age is not None and options.tare is None:
        raise UsageError("--tare-age says how old a tare is, but there is no --tare")


def add_known_arguments(parser: argparse.ArgumentParser) -> None:
    """`--mass`, `--com`, `--body` and `--family`."""
    parser.add_argument(
        "--mass", type=weighed, metavar="M±S", help="of the payload, where it was weighed [kg], with its 1 sigma"
    )
    parser.add_argument(
        "--com",
        type=centre,
        metavar="X,Y,Z±S",
        help="its centre of mass, where that is known [m], about the payload frame, with the 1 sigma of each axis",
    )
    parser.add_argument(
        "--body",
        type=file_name,
        metavar="FILE",
        help="all of it, where that is known, as of a CAD drawing: a payload file (docs/payloads.md) with its std",
    )
    parser.add_argument(
        "--family",
        type=_families,
        default=(),
        metavar="NAME,...",
        help="what kind it is of: boxes, shapes, tools, container, wide (trays, bars, rings), light, or several",
    )


def add_identifier_arguments(parser: argparse.ArgumentParser) -> None:
    """`--tare` and `--method`."""
    parser.add_argument(
        "--tare",
        type=file_name,
        metavar="LOG0",
        help="an earlier log of the same arm, on any motion; the answer is what was added since",
    )
    parser.add_argument(
        "--profile",
        type=file_name,
        metavar="P",
        help="what was learned of this arm from many logs (armload profile); the answer is what was added since",
    )
    parser.add_argument(
        "--method",
        type=file_name,
        metavar="M",
        help="a name `armload methods` lists, or the path of a trained model (default: the most trustworthy)",
    )


def add_cluster_argument(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """`--cluster`."""
    parser.add_argument(
        "--cluster",
        metavar="C",
        help="Dask workers in place of processes: local, or the address of a scheduler, tcp://HOST:8786; same numbers",
    )


def add_tool_argument(parser: argparse.ArgumentParser) -> None:
    """`--tool`."""
    parser.add_argument(
        "--tool",
        type=file_name,
        metavar="FILE",
        help="a mounted tool that is known (JSON, or franka-hand); the answer is what it carries",
    )


def add_tool_and_topic_arguments(parser: argparse.ArgumentParser) -> None:
    """`--tool` and `--topic`."""
    add_tool_argument(parser)
    parser.add_argument("--topic", metavar="T", help="JointState topic of a bag, where it has several")


def add_column_arguments(parser: argparse.ArgumentParser, tare: bool = True) -> None:
    """`--columns`, `--effort-key`, `--rate`, `--episode`, and for the tare: what the header of a log leaves open."""
    add = parser.add_argument_group("logs that are tables (CSV, Parquet, NPZ, HDF5, MATLAB, LeRobot)").add_argument
    add("--columns", type=file_name, metavar="SPEC", help=COLUMNS)
    add("--effort-key", type=file_name, metavar="K", help="list-valued column of the joint torques (--columns tau=K)")
    add("--rate", dest="log_rate", type=at_least(1e-3, float), metavar="HZ", help="of a log without times")
    add("--episode", type=at_least(0), metavar="K", help="which one of a file or data set that holds several")
    if not tare:
        return
    add("--tare-episode", type=at_least(0), metavar="K", help="that of the tare (default: as --episode)")
    add(
        "--tare-columns",
        type=file_name,
        metavar="SPEC",
        help=f"of a tare from another tool, in place of --columns to --episode; {AS_NAMED}: its header says all",
    )
