"""`armload motion design`: the motion that tells most of a payload, within the limits given, about a pose."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import add_arm_arguments, add_column_arguments, at_least, file_name
from armload.app.cli.named import arm_of
from armload.app.cli.printing import console, print_json, print_note, table, working
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.excitation import Constraints, Criterion, Design, Obstacle, Surroundings
    from armload.motion import Motion
    from armload.recording import Recording

_UNITS = {
    "mass": {"g": 1e-3, "kg": 1.0, "": 1.0},
    "moment": {"g.m": 1e-3, "kg.m": 1.0, "": 1.0},
    "inertia": {"g.m2": 1e-3, "kg.m2": 1.0, "": 1.0},
}


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
    """A height, or none."""
    return None if text == "none" else at_least(-1e3, float, 1e3)(text)


def joints(text: str) -> tuple[int, ...]:
    """Joints by number, from 1.

    >>> joints("1,5-7")
    (1, 5, 6, 7)
    """
    out: list[int] = []
    for part in text.split(","):
        found = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip())
        if found is None:
            raise argparse.ArgumentTypeError(f"{text!r} names no joints: expected numbers from 1, such as 5-7 or 1,3")
        out += range(int(found[1]), int(found[2] or found[1]) + 1)
    return tuple(sorted(set(out)))


def accuracy(text: str) -> dict[str, float]:
    """95 % half-widths that are to be reached.

    >>> accuracy("mass=10g,moment=1.5g.m,inertia=1e-3")
    {'mass': 0.01, 'moment': 0.0015, 'inertia': 0.001}
    """
    out = {}
    for part in text.replace("·", ".").replace("²", "2").split(","):
        found = re.fullmatch(r"\s*(mass|moment|inertia)=([0-9.eE+-]+?)((?:k?g)?(?:\.m2?)?)\s*", part)
        unit = None if found is None else _UNITS[found[1]].get(found[3])
        try:
            value = float(found[2]) if found is not None else 0.0
        except ValueError:
            value = 0.0
        if found is None or unit is None or value <= 0.0:
            raise argparse.ArgumentTypeError(
                f"{text!r} is not an accuracy: expected 95 % half-widths such as mass=10g,moment=1.5g.m,inertia=1e-3"
            )
        out[found[1]] = value * unit
    return out


def add_constraint_arguments(parser: argparse.ArgumentParser) -> None:
    """What a motion must keep to: `--share` to `--speed`."""
    add = parser.add_argument_group("limits").add_argument
    add("--share", type=at_least(0.01, float, 1.0), metavar="S", help="of every limit that may be used (default: 0.8)")
    add("--travel", type=at_least(0.01, float), metavar="RAD", help="farthest of a joint from the start (default: 1)")
    add("--speed", type=at_least(0.01, float), metavar="V", help="of the payload frame at most [m/s] (default: 1.5)")
    add("--payload", type=at_least(0.0, float), metavar="KG", help="the heaviest there may be (default: as rated)")
    add(
        "--centre",
        type=numbers,
        metavar="X,Y,Z",
        help="of payloads in the payload frame, to 5 cm along each axis [m] (default: 0,0,0.1)",
    )
    add("--floor", type=floor, metavar="Z", help="height of the floor in the base's frame [m], or none (default: 0)")
    add("--box", type=box, action="append", default=[], metavar="X,Y,Z,SX,SY,SZ", help="an obstacle; repeat for more")
    add(
        "--held",
        type=held,
        metavar="R|SX,SY,SZ",
        help="what is held: radius of a ball 0.1 m beyond the payload frame, or edges of a box that begins at it [m] "
        "(default: 0.15)",
    )


def add_knowledge_arguments(parser: argparse.ArgumentParser) -> None:
    """What is known besides the run: `--tare` and `--profile`."""
    parser.add_argument(
        "--tare",
        metavar="LOG|MOTION|none",
        help="an earlier run of the arm that is at hand, or none (default: the same motion is run empty before)",
    )
    parser.add_argument("--profile", type=file_name, metavar="P", help="what many logs said of this arm")
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
        type=accuracy,
        metavar="ACCURACY",
        help="in place of --time: the shortest motion whose bound is within these 95 %% half-widths, such as "
        "mass=10g,moment=1.5g.m,inertia=1e-3",
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
    parser.add_argument("--out", required=True, type=file_name, metavar="FILE", help="JSON file to write")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def constraints_of(options: argparse.Namespace, arm: Arm, start: Any, moving: tuple[int, ...] | None) -> Constraints:
    """What the options allow."""
    import numpy as np

    from armload.excitation import Constraints, PayloadRange
    from armload.excitation.constraints import SHARE, TOOL_SPEED, TRAVEL

    payload = PayloadRange.rated(arm)
    mass = payload.mass if options.payload is None else options.payload
    centre = payload.centre if options.centre is None else options.centre
    if len(centre) != 3:
        raise UsageError(f"--centre has {len(centre)} numbers: expected x,y,z in m")
    allowed = None
    if moving is not None:
        if max(moving) > arm.n or min(moving) < 1:
            raise UsageError(f"--joints names joint {max(moving)}: {arm.name} has joints 1 to {arm.n}")
        allowed = np.isin(np.arange(1, arm.n + 1), moving)
    return Constraints(
        arm,
        start,
        share=SHARE if options.share is None else options.share,
        payload=PayloadRange(mass, centre),
        surroundings=_surroundings(options, arm),
        travel=TRAVEL if options.travel is None else options.travel,
        speed=TOOL_SPEED if options.speed is None else options.speed,
        joints=allowed,
    )


def criterion_of(options: argparse.Namespace, arm: Arm, own_tare: bool = False) -> tuple[Criterion, str]:
    """What is wanted, and in words what is known besides the run."""
    from armload.app.cli.motion_check import run_of
    from armload.excitation import Criterion
    from armload.posterior import load_profile

    profile = None if options.profile is None else load_profile(options.profile)
    if profile is not None:
        profile.check(arm)
    tare: str | Recording | Motion | None
    if own_tare:
        if options.tare is not None:
            raise UsageError("--tare-time designs an empty run of its own: leave --tare out")
        tare, words = "own", "after its own empty run"
    elif options.tare is None:
        tare, words = "same", "after an empty run of the same motion"
    elif options.tare == "none":
        tare, words = None, "without a tare"
    else:
        tare = run_of(options, options.tare, arm, is_tare=True)
        words = f"after the tare {options.tare}"
    return Criterion(arm, tare, profile), words + ("" if profile is None else f", with the profile {options.profile}")


def run_design(options: argparse.Namespace) -> int:
    """Design, write, and say what was found."""
    from armload.excitation import Accuracy, design_motion, design_until
    from armload.motion import save_motion

    if options.until is not None and options.time is not None:
        raise UsageError("--time and --until exclude each other: give one of them")
    arm = arm_of(options)
    constraints = constraints_of(options, arm, options.start, options.joints)
    criterion, words = criterion_of(options, arm, options.tare_time is not None)
    out = Path(options.out)
    settings: dict[str, Any] = {"tare_time": options.tare_time, "seed": options.seed, "name": out.stem or "designed"}
    with working("designing a motion"):
        if options.until is None:
            found = design_motion(constraints, criterion, 3.0 if options.time is None else options.time, **settings)
        else:
            found = design_until(constraints, criterion, Accuracy(**options.until), **settings)
    save_motion(out, found.motion)
    written = [str(out)]
    if found.empty is not None:
        written.append(str(out.with_name(f"{out.stem}-empty{out.suffix}")))
        save_motion(written[1], found.empty)
    if options.json:
        print_json(_fields(found, constraints, criterion, written, words))
        return 0
    _print(found, constraints, criterion, words)
    print_note(f"wrote {' and '.join(written)}; run it slowly first")
    return 0


def _surroundings(options: argparse.Namespace, arm: Arm) -> Surroundings:
    from armload.excitation import Obstacle, Surroundings
    from armload.motion.collision import PAYLOAD_RADIUS

    boxes: tuple[Obstacle, ...] = tuple(Obstacle((b[0], b[1], b[2]), (b[3], b[4], b[5])) for b in options.box)
    return Surroundings(arm, options.floor, boxes, PAYLOAD_RADIUS if options.held is None else options.held)


def _largest(found: Design) -> dict[str, Any]:
    """Of each quantity, what is used most."""
    out: dict[str, Any] = {}
    for one in found.used:
        if one.what != "rest":
            out.setdefault(one.what, one)
    return out


def _fields(
    found: Design, constraints: Constraints, criterion: Criterion, written: list[str], words: str
) -> dict[str, Any]:
    from armload.inertia import NAMES, UNITS

    arm = constraints.arm
    return {
        "robot": arm.name,
        "frame": str(arm.frame),
        "motion": written[0],
        "empty_motion": written[1] if len(written) > 1 else None,
        "duration": found.motion.duration,
        "empty_duration": None if found.empty is None else found.empty.duration,
        "share": constraints.share,
        "tare": words,
        "parameters": NAMES,
        "units": UNITS,
        "prior_half_width": criterion.prior_half_width.tolist(),
        "half_width": found.half_width.tolist(),
        "used": {what: one.share for what, one in _largest(found).items()},
        "nearest_limit": found.used[0].text,
    }


def _print(found: Design, constraints: Constraints, criterion: Criterion, words: str) -> None:
    motion = found.motion
    print(f"{motion.name}: {motion.duration:g} s on {constraints.arm.name}, {words}")
    print_widths(["before", f"{motion.duration:g} s"], [criterion.prior_half_width, found.half_width])
    rows = table(f"what it uses of the limits, at most {constraints.share:g} of each", "limit", "share of it", "where")
    for what, one in _largest(found).items():
        rows.add_row(what, f"{one.share:.3f}", one.text)
    console().print(rows)
    print("shares are of what is allowed, looked at 1000 times a second")


def print_widths(titles: list[str], widths: list[Any]) -> None:
    """A row for each parameter: 95 % half-widths at best."""
    from armload.inertia import NAMES, UNITS

    rows = table("95 % half-widths at best", "parameter", "unit", *titles, left=2)
    for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        rows.add_row(name, unit, *(f"{width[k]:.5f}" for width in widths))
    console().print(rows)
