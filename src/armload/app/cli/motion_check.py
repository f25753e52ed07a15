"""What `armload motion check` says: may the arm run it, and what does it tell about a payload."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import add_arm_arguments, add_column_arguments
from armload.app.cli.named import arm_of, motion_of, names_motion, payload_of
from armload.app.cli.named_logs import check_columns, read_logs
from armload.app.cli.printing import console, print_json, table, working
from armload.errors import UsageError
from armload.runtime.finite import finite

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.motion import Motion, MotionCheck
    from armload.posterior import Advice, Bound
    from armload.recording import Recording

NOT_ALLOWED = 3  # exit code of a check that says no


def add_check_arguments(parser: argparse.ArgumentParser) -> None:
    """All of `armload motion check`."""
    add = parser.add_argument
    add("motion", metavar="LOG|MOTION", help="a log, or taie2024, a JSON, CSV or YAML file, or random:SEED")
    add_arm_arguments(parser)
    add(
        "--payload",
        metavar="FILE",
        help="what the arm carries: a JSON file, franka-hand, none, or rated (default: the maker's rated payload); "
        "for motions only",
    )
    add(
        "--tare",
        metavar="LOG|MOTION",
        help="an earlier run of the arm, with anything mounted (default: shows both none and the same again)",
    )
    add_column_arguments(parser)
    add("--json", action="store_true", help="print one JSON object and nothing else")


def run_check(options: argparse.Namespace) -> int:
    """Check, print; `NOT_ALLOWED` where a limit is passed."""
    from armload.inertia import NAMES, UNITS
    from armload.posterior import advise, bound
    from armload.recording import Recording

    check_columns(options, options.motion, options.tare)
    arm = arm_of(options)
    run = run_of(options, options.motion, arm)
    tare = run if options.tare is None else run_of(options, options.tare, arm, is_tare=True)
    result, carried = None, ""
    with working("checking"):
        if isinstance(run, Recording):
            if options.payload is not None:
                raise UsageError("--payload is for motions: a log was made with whatever the arm carried; leave it out")
            problems = passed(run, arm)
        else:
            result, carried = _limits(options.payload or "rated", arm, run)
            problems = result.problems
        without_tare, tared = bound(arm, run), bound(arm, run, tare=tare)
        advice = advise(arm, run, tare) if options.tare else advise(arm, run)
    if options.json:
        print_json(
            {
                **check_fields(run, result, problems),
                "robot": arm.name,
                "frame": str(arm.frame),
                "parameters": NAMES,
                "units": UNITS,
                "prior_half_width": without_tare.prior_half_width.tolist(),
                "without_tare": bound_fields(without_tare),
                "with_tare": bound_fields(tared),
                "advice": None if advice is None else str(advice),
            }
        )
        return NOT_ALLOWED if problems else 0
    if isinstance(run, Recording):
        print_passed(run, arm, problems)
    else:
        print(f"{result}\ntorque with {carried}")
    for found in (tared, without_tare) if options.tare else (without_tare, tared):
        print()
        print_bound(found)
    print_advice(tared if options.tare else without_tare, advice)
    return NOT_ALLOWED if problems else 0


def _limits(payload_name: str, arm: Arm, motion: Motion) -> tuple[MotionCheck, str]:
    """The check with a payload by name, and in words what is carried."""
    from armload.motion import check_motion, rated_load

    if payload_name == "rated":
        payload = rated_load(arm)
        carried = "the rated payload" if payload is not None else "nothing (its rated payload is not known)"
    else:
        payload = None if payload_name == "none" else arm.in_frame(payload_of(payload_name, arm))
        carried = "nothing" if payload is None else payload_name
    return check_motion(arm, motion, payload), carried


def run_of(options: argparse.Namespace, name: str, arm: Arm, is_tare: bool = False) -> Recording | Motion:
    """A log by the suffix of its file (or the folder of one), else a motion; a motion's own table is one, too."""
    from armload.identification import check_plausible

    if names_motion(name):
        return motion_of(name, arm)
    log = read_logs(options, arm, None, name)[1] if is_tare else read_logs(options, arm, name)[0]
    assert log is not None
    check_plausible(log, arm)
    return log


def passed(log: Recording, arm: Arm) -> list[str]:
    """One sentence for each limit of position or velocity that the measured motion passes."""
    import numpy as np

    from armload.arms.units import unit_of

    limits = arm.limits
    beyond = {
        "position": (np.maximum(limits.position_low - log.q, log.q - limits.position_high), log.q),
        "velocity": (np.abs(log.dq) - limits.velocity_at(log.q, log.dq), log.dq),
    }
    return [
        f"{arm.joint_names[j]} passes its {name} limit by {over[k, j]:.3g} {unit_of(name, limits.slides[j])} at "
        f"t = {log.t[k]:.2f} s ({value[k, j]:.4g} {unit_of(name, limits.slides[j])})"
        for name, (over, value) in beyond.items()
        for j, k in enumerate(over.argmax(axis=0))
        if over[k, j] > 0.0
    ]


def print_passed(log: Recording, arm: Arm, problems: list[str]) -> None:
    """What a log leaves of the limits, as measured."""
    import numpy as np

    from armload.arms.units import heading, marked

    room = np.minimum(log.q - arm.limits.position_low, arm.limits.position_high - log.q).min(axis=0)
    speed = (arm.limits.velocity_at(log.q, log.dq) - np.abs(log.dq)).min(axis=0)
    rows = table(
        f"{log.source} on {arm.name}, {log.duration:.2f} s: what was left to each limit, as measured",
        "joint",
        heading("position", arm.limits.slides),
        heading("velocity", arm.limits.slides),
    )
    joints = [marked(name, arm.limits.slides, j) for j, name in enumerate(arm.joint_names)]
    for name, left, slower in zip(joints, room, speed, strict=True):
        rows.add_row(name, *("no limit" if np.isinf(x) else f"{x:.2f}" for x in (left, slower)))
    console().print(rows)
    print("the arm stayed within its limits" if not problems else "the arm passed its limits:")
    for problem in problems:
        print(f"- {problem}")


def print_bound(found: Bound) -> None:
    """A row per parameter: what was known before, what the run leaves of it, and whether that determines it."""
    from armload.inertia import NAMES, UNITS

    tare = "a tare on the same motion" if found.tare == found.name else f"the tare {found.tare}"
    after = "without a tare" if found.tare is None else f"after {tare}"
    rows = table(
        f"what it tells about a payload, {after}: 95 % half-width at best",
        "parameter",
        "unit",
        "before",
        *(f"{t:.3g} s" for t in found.times),
        "determined",
        left=2,
    )
    for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        widths = [f"{width:.5f}" for width in (found.prior_half_width[k], *found.half_width[:, k])]
        rows.add_row(name, unit, *widths, _since(found, k))
    console().print(rows)
    condition = found.condition[-1]
    shown = f"{condition:.3g}" if math.isfinite(condition) else "infinite: some combinations leave no trace"
    print(f"condition number of the payload's regressor (columns scaled by 1, L, L², L = 0.15 m): {shown}")


def print_advice(found: Bound, advice: Advice | None) -> None:
    """What the figures rest on; one line on what the run does not determine, and what would change that."""
    from armload.inertia import NAMES

    print(
        "at best: an arm and a noise as expected (a milder arm is known better), a torque whose scale is right (if it "
        "is off by 1 %, the mass is, too)"
    )
    missing = [name for name, known in zip(NAMES, found.determined[-1], strict=True) if not known]
    if not missing:
        return
    more = advice or "no single joint, moved more, would change that"
    which = "without a tare" if found.tare is None else "after this tare"
    print(f"{which} not determined: {', '.join(missing)}; {more}")


def _since(found: Bound, k: int) -> str:
    """From which of the times on a parameter is determined."""
    if not found.determined[-1, k]:
        return "no"
    return f"yes, after {found.times[found.determined[:, k].argmax()]:.3g} s"


def check_fields(run: Recording | Motion, result: MotionCheck | None, problems: list[str]) -> dict[str, Any]:
    """Name, duration, limits of the JSON; a margin of null: there is no such limit."""
    from armload.recording import Recording

    if isinstance(run, Recording):
        return {
            "kind": "log",
            "name": run.source,
            "duration": run.duration,
            "within_limits": not problems,
            "problems": problems,
        }
    assert result is not None
    return {
        "kind": "motion",
        "name": run.name,
        "duration": run.duration,
        "within_limits": result.ok,
        "problems": problems,
        "peak": {name: value.tolist() for name, value in result.peak.items()},
        "margin": {name: finite(value.tolist()) for name, value in result.margin.items()},
        "floor_clearance": finite(result.floor_clearance),
        "self_clearance": finite(result.self_clearance),
    }


def bound_fields(found: Bound) -> dict[str, Any]:
    """What a run leaves, as JSON; half-widths in the order of `parameters`, a row per time."""
    return {
        "tare": found.tare,
        "times": found.times.tolist(),
        "half_width": found.half_width.tolist(),
        "determined": found.determined.tolist(),
        "condition": finite(found.condition.tolist()),
    }
