"""`armload export`: an identified payload in a controller's or simulator's own form."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from armload.app.cli.arguments import file_name, output_file
from armload.app.cli.export_frame import frame_for, no_flange, on_flange
from armload.app.cli.named import BUILT_IN, load_of, part_of
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note
from armload.errors import ArmError, UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.devices import Load

# when what is not in a load was mounted, by what it is relative to
_SINCE = {"tare": "at the tare", "before": "at the tare", "profile": "in the profile's logs"}
# the names of armload.devices.FORMS, so that --help need not import them; a test compares
FORMS = ("franka", "franka-desk", "ur", "ur-payload", "kuka", "kinova", "xarm", "urdf", "mjcf", "sdf", "ros2")
_WITH_NAME = ("urdf", "mjcf", "sdf")  # those that name what they describe
_NAME = "payload"
_EXAMPLES = """\
examples:
  armload identify run.csv --robot panda --json > held.json
  armload export held.json --to franka --minus franka-hand    (Desk counts the hand already)
  armload export held.json --to urdf --out payload.urdf
  armload export held.json --to ur --robot my_ur.urdf         (moved to the file's tool0, whatever is behind it)
  armload export franka-hand --to mjcf

forms:
  franka       Python for libfranka's setLoad, on top of Desk's end effector
  franka-desk  end effector for Franka's Desk (JSON)
  ur           URScript set_target_payload, everything on the flange
  ur-payload   URScript set_payload (before software 5.10), without inertia
  kuka         Java and object template for an LBR iiwa's Sunrise
  kinova       Python for a Gen3's Kortex: everything on the interface module, without inertia
  xarm         Python for UFACTORY's set_tcp_load: everything on the flange, without inertia
  urdf, mjcf, sdf   a link, body or model
  ros2         geometry_msgs/msg/InertiaStamped as YAML

Nothing is sent to a robot.
"""


def parser() -> Parser:
    """The arguments of `armload export`."""
    parser = Parser(
        prog="armload export",
        description="Write an identified payload in a controller's or simulator's own form.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add(
        "result",
        type=file_name,
        metavar="RESULT",
        help="what `armload identify --json` printed, a payload file, or franka-hand",
    )
    add("--to", required=True, choices=FORMS, metavar="FORM", help=", ".join(FORMS))
    add("--out", type=output_file, metavar="FILE", help="write a file instead of printing")
    add(
        "--minus",
        type=file_name,
        metavar="FILE",
        action="append",
        default=[],
        help="a known part to take off first (JSON, or franka-hand); may be given several times",
    )
    add(
        "--plus",
        type=file_name,
        metavar="FILE",
        action="append",
        default=[],
        help="a known part to add first, likewise; `nothing`: nothing else was mounted",
    )
    add("--frame", metavar="F", help="link to write it about (default: a controller's flange, else that of RESULT)")
    add("--robot", metavar="NAME|FILE.urdf", help="the arm, where frames differ (default: that of RESULT)")
    add("--name", default=_NAME, metavar="N", help=f"name of the link, body or model (default: {_NAME})")
    return parser


def run(options: argparse.Namespace) -> None:
    """Read, combine, move, write."""
    from armload.arms import ARMS
    from armload.payloads import NOTHING

    saved = None if options.result in BUILT_IN else load_of(options.result)
    arm = None if options.robot is None else _arm(options.robot, options.frame, saved and saved.frame)
    load = saved or load_of(options.result, arm)
    facts = ARMS.get(load.robot or "")
    if arm is None and facts is not None and _moves(options, load.frame, facts.flange):
        arm = _arm(facts.name)
    if NOTHING in options.minus:
        raise UsageError(f"--minus {NOTHING} takes nothing off: leave it out")
    doubts = _doubts(options.minus, load)
    if load.frame is None and arm is not None:  # before parts, which name theirs
        load = load.about(options.frame or frame_for(load, options.to, arm), arm)
        doubts.append(f"{options.result} names no frame: it is taken to be about {load.frame}")
    added = bool(options.plus) and load.relative_to in _SINCE
    if added and set(options.plus) != {NOTHING}:
        doubts.append(
            f"see that --plus names all that was mounted {_SINCE[str(load.relative_to)]}, and nothing that is in the "
            "answer already"
        )
    for part in options.plus:  # first: what is taken off may be in it
        load = load + _part(part, load, arm)
    for part in options.minus:
        load = load - _part(part, load, arm)
    if options.name != _NAME and options.to not in _WITH_NAME:
        doubts.append(f"--name is of a link, body or model, and {options.to} names none: it changes nothing")
    write(load, options.to, options.out, arm, options.frame, options.name, doubts, added=added)


def write(
    load: Load,
    to: str,
    out: str | None = None,
    arm: Arm | None = None,
    frame: str | None = None,
    name: str = _NAME,
    doubts: Sequence[str] = (),
    earlier: Sequence[str] = (),
    added: bool = False,
) -> None:
    """Write a load in a form, to a file or to stdout, about the frame asked for, else the one the form wants.

    doubts: notes to print with those on the load. earlier: notes of its identification, which say already what was
    not determined and what rests on the prior, but not which moments are hardly known. added: whether parts were added
    to what is relative to a tare.

    Raises:
        SinkError: the form's frame is not known, or no body has the load's parameters and a mass above 0.
    """
    from armload.devices import CONTROLLERS, export_load
    from armload.devices import FORMS as FORMS_OF
    from armload.devices.load_remarks import HARDLY_KNOWN, NOTHING_HELD

    whole = load.as_body()  # about its own frame, where its error bars are
    nothing, body = load.seems_nothing, whole.about(frame_for(load, to, arm) if frame is None else frame, arm)
    elsewhere = to in CONTROLLERS and body.frame is not None and not on_flange(body.frame, to, arm)
    if elsewhere and frame is None:
        raise no_flange(load, arm)
    if whole is not load:
        print_note(
            "no body has the parameters that are left: the nearest one is written, with a mass of "
            f"{body.parameters.mass:.4f} kg instead of {load.parameters.mass:.4f} kg"
        )
    text = export_load(body, to, out, name)
    if nothing:
        print_note(NOTHING_HELD)
    if elsewhere:
        print_note(f"a controller counts from its flange; these numbers are about {body.frame}, as was asked for")
    numbers = [note for note in _on_numbers(FORMS_OF[to].held_of(body)) if not earlier or note.startswith(HARDLY_KNOWN)]
    for note in (*earlier, *doubts, *numbers, *_on_use(body, to, added)):
        print_note(note)
    if out is None:
        print(text, end="")
    else:
        print_note(f"{out}: {body.description()[0]}")  # what else is said of it, the notes have said


def _arm(robot: str, frame: str | None = None, held: str | None = None) -> Arm:
    """An arm about a frame; of a description with several ends, where none is asked for, about what is held."""
    from armload.arms import arm  # with Pinocchio: only for who needs it

    try:
        return arm(robot, frame)
    except ArmError:
        if frame is not None or held is None:
            raise
        return arm(robot, held)


def _moves(options: argparse.Namespace, frame: str | None, flange: str) -> bool:
    """Whether something may have to be told of another frame: what is about the flange and stays there needs no arm."""
    return frame != flange or options.frame not in (None, flange) or bool(options.minus or options.plus)


def _part(name: str, load: Load, arm: Arm | None) -> Load:
    """A part about the load's own frame; the Franka Hand sits on the flange, whatever that is called."""
    from armload.devices import Load
    from armload.inertia import InertialParameters
    from armload.payloads import NOTHING, franka_hand
    from armload.payloads.hand import HAND, fits

    if name == NOTHING:
        return Load(InertialParameters.zero(load.frame))
    if name == HAND and load.frame is not None and fits(load.frame):
        return Load(franka_hand(load.frame).parameters)
    return part_of(name, load.frame, arm)


def _doubts(parts: list[str], load: Load) -> list[str]:
    """Questions on parts that are taken off a load: whether they are in it, and only once."""
    doubts = [
        f"{part} is taken off {parts.count(part)} times" for part in dict.fromkeys(parts) if parts.count(part) > 1
    ]
    if parts and load.lacks is not None:
        asked = "is {} mounted beside it?" if load.relative_to == "tool" else "was {} mounted after it?"
        doubts += [f"{load.lacks}; {asked.format(part)}" for part in dict.fromkeys(parts)]
    return doubts


def _on_numbers(load: Load) -> list[str]:
    """What the numbers that are written rest on."""
    missing = ", ".join(load.undetermined)
    return [*([f"not determined by the log: {missing}; written as known beforehand"] if missing else []), *load.remarks]


def _on_use(load: Load, to: str, added: bool) -> list[str]:
    """What to see to where they are used."""
    from armload.arms import ARMS
    from armload.devices import FORMS as FORMS_OF

    notes = []
    facts, form = ARMS.get(load.robot or ""), FORMS_OF[to]
    if facts is None and form.maker and load.frame in {each.flange for each in ARMS.values()}:
        makers = {each.controller for each in ARMS.values() if each.flange == load.frame}
        if form.maker not in makers:
            notes.append(f"it is about {load.frame}: another maker's flange may have other axes")
    if facts is not None and form.maker and form.maker != facts.controller:
        notes.append(f"it was identified on {load.robot}: another maker's flange may have other axes")
    if to == "franka" and load.relative_to == "arm" and not added:
        notes.append("this contains any hand that is mounted: take off what Desk counts already with --minus")
    if to == "kuka" and load.relative_to == "arm" and not added:
        notes.append("this contains any tool that is mounted: take off what has load data already with --minus")
    if form.counts_all and load.relative_to == "tool":
        notes.append(f"{form.counts_all} is everything on the flange: add the tool with --plus")
    if form.counts_all and load.relative_to in _SINCE:
        then = _SINCE[load.relative_to]
        notes.append(f"{form.counts_all} is everything on the flange: add what was mounted {then}, if any, with --plus")
    if form.maker and load.frame is None:
        notes.append("the payload names no frame: it is taken to be about the flange")
    return notes
