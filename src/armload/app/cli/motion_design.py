"""`armload motion design`: the motion that tells most of a payload, within the limits given, about a pose."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import OutputFile
from armload.app.cli.named import arm_of, surroundings_of
from armload.app.cli.named_logs import check_columns
from armload.app.cli.outputs import check_motion_file, check_outputs
from armload.app.cli.printing import console, print_json, print_note, table, working
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.excitation import Constraints, Criterion, Design
    from armload.motion import Motion
    from armload.recording import Recording


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
        if unknown := [joint for joint in moving if not 1 <= joint <= arm.n]:
            raise UsageError(f"--joints names joint {unknown[-1]}: {arm.name} has joints 1 to {arm.n}")
        allowed = np.isin(np.arange(1, arm.n + 1), moving)
    return Constraints(
        arm,
        start,
        share=SHARE if options.share is None else options.share,
        payload=PayloadRange(mass, centre),
        surroundings=surroundings_of(options, arm),
        travel=TRAVEL if options.travel is None else options.travel,
        speed=TOOL_SPEED if options.speed is None else options.speed,
        joints=allowed,
    )


def criterion_of(options: argparse.Namespace, arm: Arm, own_tare: bool = False) -> tuple[Criterion, str]:
    """What is wanted, and in words what is known besides the run."""
    from armload.app.cli.motion_check import run_of
    from armload.excitation import Criterion
    from armload.posterior import load_profile

    check_columns(options, None if options.tare == "none" else options.tare)
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
    from armload.motion.motion_file import save_motions

    if options.until is not None and options.time is not None:
        raise UsageError("--time and --until exclude each other: give one of them")
    check_motion_file(options.out)
    out = Path(options.out)
    empty = out.with_name(f"{out.stem}-empty{out.suffix}")
    if options.tare_time is not None:
        check_outputs(options, ("--tare-time", OutputFile(empty)))
    arm = arm_of(options)
    constraints = constraints_of(options, arm, options.start, options.joints)
    criterion, words = criterion_of(options, arm, options.tare_time is not None)
    settings: dict[str, Any] = {"tare_time": options.tare_time, "seed": options.seed, "name": out.stem or "designed"}
    with working("designing a motion"):
        if options.until is None:
            found = design_motion(constraints, criterion, 3.0 if options.time is None else options.time, **settings)
        else:
            found = design_until(constraints, criterion, Accuracy.read(options.until), **settings)
    written = {str(out): found.motion} | ({} if found.empty is None else {str(empty): found.empty})
    save_motions(written.items())
    if options.json:
        print_json(_fields(found, constraints, criterion, list(written), words))
        return 0
    _print(found, constraints, criterion, words)
    print_note(f"wrote {' and '.join(written)}; run it slowly first")
    return 0


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
        "promised_half_width": found.promised.tolist(),
        "used": {what: one.share for what, one in _largest(found).items()},
        "nearest_limit": found.used[0].text,
    }


def _print(found: Design, constraints: Constraints, criterion: Criterion, words: str) -> None:
    motion = found.motion
    print(f"{motion.name}: {motion.duration:g} s on {constraints.arm.name}, {words}")
    titles = ["before", f"{motion.duration:g} s at best", "promised"]
    print_widths(titles, [criterion.prior_half_width, found.half_width, found.promised])
    rows = table(f"what it uses of the limits, at most {constraints.share:g} of each", "limit", "share of it", "where")
    for what, one in _largest(found).items():
        rows.add_row(what, f"{one.share:.3f}", one.text)
    console().print(rows)
    print("shares are of what is allowed, looked at 1000 times a second")


def print_widths(titles: list[str], widths: list[Any]) -> None:
    """A row for each parameter: 95 % half-widths."""
    from armload.inertia import NAMES, UNITS

    rows = table("95 % half-widths", "parameter", "unit", *titles, left=2)
    for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        rows.add_row(name, unit, *(f"{width[k]:.5f}" for width in widths))
    console().print(rows)
