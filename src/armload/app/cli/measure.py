"""`armload measure`: the arm is moved, without and with the payload, and the answer is given, in one command."""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import COLUMN_OPTIONS, check_tare_age
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.measure_arguments import parser
from armload.app.cli.named import arm_of, boxes_of, motion_of, part_of, payload_of, robot_of, surroundings_of, world_of
from armload.app.cli.named_logs import read_logs
from armload.app.cli.printing import print_json, print_note, working, write_json
from armload.errors import MotionError, SafetyError, SentError, SinkError, UsageError
from armload.runtime.interruption import held_back

__all__ = ["parser", "run"]

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armload.arms import Arm
    from armload.devices import Mover
    from armload.excitation import Constraints
    from armload.inertia import InertialParameters
    from armload.measuring import Measurement, Plan
    from armload.motion import Motion
    from armload.posterior import Profile


def run(options: argparse.Namespace) -> int | None:
    """Measure; 2 after an error, 130 after Ctrl-C, and the arm is at rest in any case."""
    from datetime import UTC, datetime

    from armload.devices import Thresholds, open_mover
    from armload.excitation import Accuracy
    from armload.measuring import Basis, Procedure, Room
    from armload.measuring.plan import APPROACH
    from armload.payloads import read_payload
    from armload.posterior import KnownCentre, KnownMass, load_profile

    _check_idle(options)
    options.robot = options.robot or robot_of(options.source)
    bare = arm_of(options)
    tool = None if options.tool is None else _tool(options, bare)
    arm = bare if tool is None else bare.with_payload(tool)
    profile = None if options.profile is None else load_profile(options.profile)
    if profile is not None:
        profile.check(arm)
    motion = None if options.motion is None else motion_of(options.motion, arm)
    accuracy = None if options.until is None else Accuracy.read(options.until)
    mass = None if options.mass is None else KnownMass(*options.mass)
    com = None if options.com is None else KnownCentre(*options.com)
    body = None if options.body is None else read_payload(options.body)
    known = {"mass": mass, "com": com, "body": body, "family": options.family, "method": options.method}
    Basis(**known).known(arm)  # before a motion is designed for it
    mounted = tool if options.mounted in (None, "nothing") else part_of(options.mounted, arm.frame, arm)
    check_tare_age(options)
    _, tare = read_logs(options, arm, None, options.tare)
    folder = options.dir or f"measurement-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    if options.out is not None and (log := _log_called(options.out, folder)):
        raise UsageError(f"--out {options.out} would replace the measurement's own {log}: name another file")
    heaviest = Basis(**known).heaviest
    simulated = {} if options.source != "sim" else _simulated(options, arm, motion, heaviest, loaded=tare is not None)
    with open_mover(options.source, arm, **simulated) as mover:
        if motion is None:
            motion = _designed(arm, mover.commanded(), profile, heaviest, options)
        if options.apply and not mover.writes:
            raise UsageError(f"{mover.name} takes no payload: leave out --apply, and export the answer")
        procedure = Procedure(
            mover,
            arm,
            motion,
            folder,
            basis=Basis(tare, options.tare_age, profile, **known),
            room=Room(options.floor, boxes_of(options), APPROACH if options.approach is None else options.approach),
            accuracy=accuracy,
            thresholds=Thresholds(options.off_path, options.push),
            say=print_note,
        )
        if options.dry_run:
            procedure.check()
            print_json(procedure.plan.to_dict()) if options.json else print(procedure.plan)
            return None
        found = procedure.run(_consent(options), _mount(options, mover))
        for note in found.answer.notes:
            print_note(note)
        if options.out is not None:
            try:
                write_json(options.out, found.to_dict())
            except UsageError:  # its folder is gone, say: the arm need not move for the answer once more
                _print(found, options)
                raise
        if options.apply:
            _apply(found, mover, mounted, options)
        _print(found, options)
    return None


def _check_idle(options: argparse.Namespace) -> None:
    """Refuse options that would change nothing, or say a thing twice, before an arm moves faster than is expected.

    Raises:
        UsageError: there is one.
    """
    defaults = parser()
    if options.motion is not None:
        designed = given(options, "time", "tool_speed", parser=defaults)
        refuse_idle(designed, f"of a motion that is designed, and --motion names {options.motion}")
    if options.source != "sim":
        simulated = given(options, "payload", "world", "at", "speed", "seed", parser=defaults)
        refuse_idle(simulated, f"of the simulator, and the source is {options.source}")
    if options.tool is not None and options.mounted is not None:
        raise UsageError("--tool is what is on at the empty run, and so is --mounted: give one of them")
    if not options.apply:
        refuse_idle(
            given(options, "mounted", "undetermined_inertia", parser=defaults), "of --apply, which is not given"
        )
    if options.tare is None:
        refuse_idle(given(options, *COLUMN_OPTIONS), "of the log of --tare, which is not given")
    else:
        refuse_idle(given(options, "grip"), "of mounting the payload, and with --tare it is on already")


def _log_called(out: str, folder: str) -> str | None:
    """Which of the measurement's own logs has the name of the answer's file; None: neither."""
    from armload.measuring.procedure import LOGS

    return next((log for log in LOGS if os.path.realpath(os.path.join(folder, log)) == os.path.realpath(out)), None)


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


def _designed(
    arm: Arm, pose: NDArray, profile: Profile | None, mass: float | None, options: argparse.Namespace
) -> Motion:
    """The motion about the present pose that tells most, for who named none: after an empty run of it, or a tare."""
    from armload.excitation import Criterion, design_motion

    try:
        limits = _allowed(arm, pose, mass, options)
        with working("designing a motion about the present pose"):
            return design_motion(limits, Criterion(arm, "same", profile), options.time, name="designed").motion
    except MotionError as error:
        if "larger share" not in str(error):
            raise
        raise MotionError(f"{error}; one with a larger share `armload motion design` makes, for --motion") from None


def _allowed(arm: Arm, pose: NDArray, mass: float | None, options: argparse.Namespace) -> Constraints:
    """What a motion about a pose is to keep to, with up to so much [kg] held; None: what the arm is rated for."""
    from armload.excitation import Constraints, PayloadRange

    heaviest, around = None if mass is None else PayloadRange(mass), surroundings_of(options, arm)
    return Constraints(arm, pose, payload=heaviest, surroundings=around, speed=options.tool_speed)


def _consent(options: argparse.Namespace) -> Callable[[Plan], bool]:
    def ask(plan: Plan) -> bool:
        print(plan, file=sys.stderr, flush=True)
        return options.move or _typed_yes("type yes to let the arm move: ", "nothing was moved")

    return ask


def _typed_yes(question: str, otherwise: str) -> bool:
    if not sys.stdin.isatty():
        raise SafetyError(f"{otherwise}: nobody is at a terminal to agree; look at --dry-run, then give --move")
    return _typed(question).strip() == "yes"


def _typed(question: str) -> str:
    """The line that is typed; "" at the end of standard input. What is printed next has a line of its own."""
    print(question, end="", file=sys.stderr, flush=True)
    line = ""
    try:
        line = sys.stdin.readline()
    finally:
        if not line.endswith("\n"):
            print(file=sys.stderr, flush=True)
    return line


def _mount(options: argparse.Namespace, mover: Mover) -> Callable[[], None]:
    def mount() -> None:
        if options.grip is not None:
            grip = shlex.join(options.grip)
            print_note(f"mounting: {grip}")
            code = subprocess.run(options.grip, stdout=sys.stderr, check=False).returncode
            if code:
                raise SafetyError(
                    f"{grip} ended with exit code {code}: the payload may not be on; mount it, and measure again"
                )
        elif not mover.mount() and not _typed("mount the payload, step back, and press Enter: the arm then moves: "):
            raise SafetyError(
                "nobody says that the payload is on: press Enter once it is, or give --grip COMMAND that mounts it"
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
    if not options.move and not _typed_yes("type yes to write it to the controller: ", "nothing was written"):
        raise SafetyError("nothing was written: there was no consent")
    failed = None
    with held_back() as interruption:  # whoever interrupts is told all the same what the controller counts
        try:
            sent = mover.write(load, allow_undetermined_inertia=options.undetermined_inertia)
            print_note(f"written to {mover.name}, which counts it: {sent}")
        except SinkError as error:
            again = f"armload identify {found.loaded} --robot {options.robot} --tare {found.empty or options.tare}"
            begun = "" if isinstance(error, SentError) else "nothing was written: "
            failed = f"{begun}{error}; `{again}`, with what else this line says of arm and payload, tells the answer"
            if interruption.name is not None:
                print_note(failed)
    if failed is not None:
        raise SinkError(failed)


def _simulated(
    options: argparse.Namespace, arm: Arm, motion: Motion | None, mass: float | None, loaded: bool
) -> dict[str, Any]:
    from armload.excitation.start import pose_to_begin_at

    if options.at is not None and len(options.at) != arm.n:
        raise UsageError(f"--at has {len(options.at)} joint positions: {arm.name} has {arm.n}; give {arm.n}, in rad")
    payload, at = payload_of(options.payload, arm), options.at
    if at is None and motion is not None:
        at = motion.position([0.0])[0]
    if at is not None:
        _check_stands(arm, at)
    else:
        at = pose_to_begin_at(arm, lambda pose: _allowed(arm, pose, mass, options), options.floor)
    return {
        "at": at,
        "payload": payload,
        "mounted": payload if loaded else None,
        "world": world_of(options.world, arm),
        "speed": options.speed,
        "seed": options.seed,
    }


def _check_stands(arm: Arm, at: Any) -> None:
    """See that a simulated arm can be where it is to stand.

    Raises:
        UsageError: a joint is beyond its range.
    """
    from armload.arms.units import unit_of

    ranges = zip(arm.joint_names, at, arm.limits.position_low, arm.limits.position_high, arm.limits.slides, strict=True)
    for joint, q, low, high, slides in ranges:
        if not low <= q <= high:
            raise UsageError(
                f"the simulated arm cannot stand with {joint} at {q:g} {unit_of('position', slides)}: expected {low:g} "
                f"to {high:g}; see --at, or where the motion begins"
            )
