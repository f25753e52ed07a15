"""`armload motion enrich`: a task's own path with the smallest change that lets it tell a payload."""

from __future__ import annotations

import argparse
from pathlib import Path

from armload.app.cli.arguments import add_arm_arguments, at_least, output_file
from armload.app.cli.motion_arguments import add_constraint_arguments, add_knowledge_arguments
from armload.app.cli.motion_design import constraints_of, criterion_of, print_widths
from armload.app.cli.named import arm_of
from armload.app.cli.printing import print_json, print_note, working
from armload.errors import UsageError

_FORMATS = {".json": None, ".csv": "csv", ".yaml": "ros2", ".yml": "ros2", ".script": "ur"}


def add_enrich_arguments(parser: argparse.ArgumentParser) -> None:
    """All of `armload motion enrich`."""
    parser.add_argument(
        "path",
        metavar="PATH",
        help="JointTrajectory (YAML or JSON), CSV with t, q1 … qn (and dq1 …, ddq1 …), or a motion's JSON file",
    )
    add_arm_arguments(parser)
    parser.add_argument(
        "--mm", type=at_least(0.0, float, 1e3), default=5.0, metavar="D", help="off the path at most (default: 5)"
    )
    parser.add_argument(
        "--deg", type=at_least(0.0, float, 90.0), default=2.0, metavar="A", help="turned at most (default: 2)"
    )
    add_knowledge_arguments(parser)
    add_constraint_arguments(parser, share="1", travel="any", speed="any")
    parser.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="same seed, same path (default: 0)")
    parser.add_argument(
        "--out",
        required=True,
        type=output_file,
        metavar="FILE",
        help="file to write: .json (motion), .csv, .yaml (JointTrajectory) or .script (URScript)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def run_enrich(options: argparse.Namespace) -> int:
    """Enrich, write, and say what that is worth."""
    import numpy as np

    from armload.devices.ros2.trajectory_file import read_path
    from armload.excitation import enrich, touched_by
    from armload.inertia import NAMES, UNITS
    from armload.motion import export_motion, save_motion
    from armload.motion.export import LEAD

    out = Path(options.out)
    if out.suffix.lower() not in _FORMATS:
        raise UsageError(f"{out} has the ending {out.suffix!r}: expected one of {', '.join(_FORMATS)}")
    arm = arm_of(options)
    if _FORMATS[out.suffix.lower()] == "ur" and arm.n != 6:
        raise UsageError(f"{out} would be a program for UR robots, which have 6 joints: {arm.name} has {arm.n}")
    path = read_path(options.path, arm)
    # a task's path keeps to the limits themselves, not to a share of them, unless one is asked for
    options.share = 1.0 if options.share is None else options.share
    options.travel = 1e3 if options.travel is None else options.travel
    options.speed = 1e3 if options.speed is None else options.speed
    constraints = constraints_of(options, arm, path(np.zeros(1))[0][0], None)
    criterion, words = criterion_of(options, arm)
    with working("enriching the path"):
        found = enrich(
            path, constraints, criterion, distance=1e-3 * options.mm, angle=np.deg2rad(options.deg), seed=options.seed
        )
    touched = touched_by(path, constraints.around)
    if touched is not None:
        print_note(
            f"on the path itself {touched}, and the enriched one comes no nearer: if that is not meant, say what is "
            "there (--floor, --box, --held)"
        )
    form = _FORMATS[out.suffix.lower()]
    if form is None:
        save_motion(out, found.motion)
    else:
        lead = getattr(path, "begins", None)  # a trajectory's own time; of another path nobody said any
        export_motion(found.motion, out, form, joint_names=arm.joint_names, lead=LEAD if lead is None else lead)
        if form == "ros2" and lead is None:
            print_note(f"in {out} the first point is due after {LEAD:g} s, in which the arm gets to the path's start")
    if options.json:
        print_json(
            {
                "robot": arm.name,
                "frame": str(arm.frame),
                "motion": str(out),
                "duration": found.motion.duration,
                "tare": words,
                "distance": found.distance,
                "angle": found.angle,
                "parameters": NAMES,
                "units": UNITS,
                "half_width_before": found.before.tolist(),
                "half_width": found.after.tolist(),
                "nearest_limit": found.used[0].text,
            }
        )
        return 0
    print(
        f"{found.motion.name}: {found.motion.duration:g} s on {arm.name}, {words}; at most "
        f"{1e3 * found.distance:.2g} mm and {np.rad2deg(found.angle):.2g}° off the path"
    )
    print_widths(["as it was, at best", "enriched, at best"], [found.before, found.after])
    print_note(f"wrote {out}; run it slowly first")
    return 0
