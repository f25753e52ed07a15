"""What commands about motions are asked: poses, floor and boxes, joints, accuracies, limits."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable

from armload.app.cli.arguments import add_arm_arguments, add_column_arguments, at_least, file_name, output_file

FLOOR = 0.0  # [m] its height in the base's frame, where nothing else is said


def numbers(text: str) -> tuple[float, ...]:
    """Numbers separated by commas.

    >>> numbers("0,-0.5,1")
    (0.0, -0.5, 1.0)
    """
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not possible: expected numbers separated by commas") from None


def box(text: str) -> tuple[float, ...]:
    """Six numbers: where a box is, and its edges."""
    found = numbers(text)
    if len(found) != 6:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a box: expected its centre and its edges x,y,z,sx,sy,sz in m, in the base's frame"
        )
    return found


def held(text: str) -> float | tuple[float, float, float]:
    """The radius of a ball, or the edges of a box."""
    found = numbers(text)
    if len(found) not in (1, 3):
        raise argparse.ArgumentTypeError(f"{text!r} is not a body: expected a radius, or three edges sx,sy,sz, in m")
    return found[0] if len(found) == 1 else (found[0], found[1], found[2])


def floor(text: str) -> float | None:
    """A height [m], or none.

    >>> floor("-0.5"), floor("none")
    (-0.5, None)
    """
    try:
        return None if text == "none" else at_least(-1e3, float, 1e3)(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a height: expected metres, or none") from None


def joints(text: str) -> tuple[int, ...]:
    """Joints by number, from 1.

    >>> joints("1,5-7")
    (1, 5, 6, 7)
    """
    out: list[int] = []
    for part in text.split(","):
        found = re.fullmatch(r"(\d{1,3})(?:-(\d{1,3}))?", part.strip())
        named = range(0) if found is None else range(int(found[1]), int(found[2] or found[1]) + 1)
        if not named:
            raise argparse.ArgumentTypeError(
                f"{text!r} names no joints: expected numbers from 1, such as 5-7 (the lower one first) or 1,3"
            )
        out += named
    return tuple(sorted(set(out)))


def add_constraint_arguments(
    parser: argparse.ArgumentParser, share: str = "0.8", travel: str = "1", speed: str = "1.5"
) -> None:
    """What a motion must keep to: `--share` to `--held`.

    Args:
        share, travel, speed: what the help says of them where they are left out.
    """
    add = parser.add_argument_group("limits").add_argument
    add(
        "--share",
        type=at_least(0.01, float, 1.0),
        metavar="S",
        help=f"of every limit that may be used (default: {share})",
    )
    add(
        "--travel",
        type=at_least(0.01, float),
        metavar="RAD",
        help=f"farthest of a joint from the start (default: {travel})",
    )
    add(
        "--speed",
        type=at_least(0.01, float),
        metavar="V",
        help=f"of the payload frame at most [m/s] (default: {speed})",
    )
    add("--payload", type=at_least(0.0, float), metavar="KG", help="the heaviest there may be (default: as rated)")
    add(
        "--centre",
        type=numbers,
        metavar="X,Y,Z",
        help="of payloads in the payload frame, to 5 cm along each axis [m] (default: 0,0,0.1)",
    )
    add_obstacle_arguments(add)
    add(
        "--held",
        type=held,
        metavar="R|SX,SY,SZ",
        help="what is held: radius of a ball 0.1 m beyond the payload frame, or edges of a box that begins at it [m] "
        "(default: 0.15)",
    )


def add_obstacle_arguments(add: Callable[..., object]) -> None:
    """`--floor` and `--box`, by the `add_argument` of a parser or of a group."""
    add(
        "--floor",
        type=floor,
        default=FLOOR,
        metavar="Z|none",
        help=f"height of the floor in the base's frame [m], or none (default: {FLOOR:g})",
    )
    add(
        "--box",
        type=box,
        action="append",
        default=[],
        metavar="X,Y,Z,SX,SY,SZ",
        help="an obstacle in the base's frame [m]; repeat for more",
    )


def add_knowledge_arguments(parser: argparse.ArgumentParser) -> None:
    """What is known besides the run: `--tare` and `--profile`."""
    parser.add_argument(
        "--tare",
        metavar="LOG|MOTION|none",
        help="an earlier run of the arm that is at hand, or none (default: the same motion is run empty before)",
    )
    parser.add_argument("--profile", type=file_name, metavar="P", help="what was learned of this arm from many logs")
    add_column_arguments(parser)


def add_design_arguments(parser: argparse.ArgumentParser) -> None:
    """All of `armload motion design`."""
    add_arm_arguments(parser)
    parser.add_argument(
        "--from", dest="start", required=True, type=numbers, metavar="Q1,…,QN", help="start and end pose [rad]"
    )
    parser.add_argument("--time", type=at_least(0.2, float, 60.0), metavar="S", help="of the motion (default: 3)")
    parser.add_argument(
        "--until",
        metavar="ACCURACY",
        help="in place of --time: the shortest motion that promises these 95 %% half-widths, "
        "such as mass=10g,moment=1.5g.m,inertia=1e-3",
    )
    parser.add_argument("--joints", type=joints, metavar="5-7", help="that may move (default: all)")
    add_knowledge_arguments(parser)
    parser.add_argument(
        "--tare-time",
        type=at_least(0.2, float, 60.0),
        metavar="S",
        help="design an empty run of its own of so many seconds with it, written beside it as …-empty.json",
    )
    add_constraint_arguments(parser)
    parser.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="same seed, same motion (default: 0)")
    parser.add_argument("--out", required=True, type=output_file, metavar="FILE", help="JSON file to write")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
