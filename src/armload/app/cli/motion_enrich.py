"""`armload motion enrich`: a task's own path with the smallest change that lets it tell a payload."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import add_arm_arguments, at_least, output_file
from armload.app.cli.motion_arguments import add_constraint_arguments, add_knowledge_arguments
from armload.app.cli.motion_design import constraints_of, criterion_of, print_widths
from armload.app.cli.named import arm_of
from armload.app.cli.printing import print_json, print_note, working
from armload.errors import MotionError, UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.motion import Motion

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

    from armload.excitation import enrich, touched_by
    from armload.inertia import NAMES, UNITS
    from armload.motion import export_motion, save_motion

    out = Path(options.out)
    if out.suffix.lower() not in _FORMATS:
        raise UsageError(f"{out} has the ending {out.suffix!r}: expected one of {', '.join(_FORMATS)}")
    arm = arm_of(options)
    path = path_of(options.path, arm)
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
        export_motion(found.motion, out, form, joint_names=arm.joint_names)
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


def path_of(name: str, arm: Arm) -> Motion:
    """A task's path from a file.

    Raises:
        MotionError: it cannot be read, or it is none of the forms that are known.
    """
    from armload.motion import check_joints, load_motion

    file = Path(name)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise MotionError(f"the path {name} cannot be read: {reason}; give a YAML, JSON or CSV file") from None
    if file.suffix.lower() == ".csv":
        return _table(text, name, arm)
    content = _content(text, name)
    if "format" in content:
        motion = load_motion(file)
        check_joints(motion, arm)
        return motion
    content = content.get("trajectory", content)  # of a FollowJointTrajectory goal
    if not isinstance(content, dict) or "points" not in content:
        raise MotionError(f"{name} is no path: expected a JointTrajectory with joint_names and points, or a motion")
    return _trajectory(content, name, arm)


def _content(text: str, name: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except ValueError:
        found = _yaml(text, name)
    if not isinstance(found, dict):
        raise MotionError(f"{name} is no path: expected a JointTrajectory with joint_names and points, or a motion")
    return found


def _yaml(text: str, name: str) -> Any:
    """YAML by the reader that comes with rosbags (`armload[bags]`)."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        raise MotionError(f"{name} is neither JSON nor YAML: {' '.join(str(error).split())}") from None


def _trajectory(content: dict[str, Any], name: str, arm: Arm) -> Motion:
    """Its points from the first one on, whatever time it takes to get there."""
    import numpy as np

    from armload.devices.ros2.trajectory import read_trajectory

    def seconds(point: dict[str, Any]) -> float:
        at = point.get("time_from_start", {})
        return float(at.get("sec", at.get("secs", 0))) + 1e-9 * float(at.get("nanosec", at.get("nsecs", 0)))

    try:
        points = content["points"]
        first = seconds(points[0])
        made = []
        for point in points:
            whole, rest = divmod(round((seconds(point) - first) * 1e9), 10**9)
            columns = {key: list(point.get(key) or []) for key in ("positions", "velocities", "accelerations")}
            made.append(SimpleNamespace(time_from_start=SimpleNamespace(sec=whole, nanosec=rest), **columns))
        header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))  # a file begins when it is run
        message = SimpleNamespace(header=header, joint_names=list(content["joint_names"]), points=made)
        order = [message.joint_names.index(joint) for joint in arm.joint_names]
        start = np.array(made[0].positions, dtype=float)[order]
    except (KeyError, IndexError, TypeError, AttributeError, ValueError):
        raise MotionError(
            f"{name} is no JointTrajectory of {arm.name}: expected joint_names with {', '.join(arm.joint_names)}, and "
            "points with positions and time_from_start"
        ) from None
    rest = np.zeros(arm.n)
    return read_trajectory(message, arm, (start, rest, rest))


def _table(text: str, name: str, arm: Arm) -> Motion:
    import numpy as np

    from armload.devices.ros2.trajectory import TrajectoryMotion

    header, *lines = [line for line in text.splitlines() if line.strip()] or [""]
    names = [cell.strip() for cell in header.split(",")]
    wanted = {kind: [f"{kind}{k + 1}" for k in range(arm.n)] for kind in ("q", "dq", "ddq")}
    if "t" not in names or any(column not in names for column in wanted["q"]) or f"q{arm.n + 1}" in names:
        raise MotionError(f"{name} has the columns {', '.join(names)}: expected t, q1 … q{arm.n} in s and rad")
    try:
        rows = np.array([[float(cell) for cell in line.split(",")] for line in lines]).reshape(-1, len(names))
        t = rows[:, names.index("t")]
    except ValueError:
        raise MotionError(f"{name} has a row that is not {len(names)} numbers") from None
    found: dict[str, Any] = {
        kind: rows[:, [names.index(column) for column in columns]]
        for kind, columns in wanted.items()
        if all(column in names for column in columns)
    }
    velocities = found.get("dq")
    return TrajectoryMotion(
        t - t[0],
        found["q"],
        velocities,
        None if velocities is None else found.get("ddq"),
        name=Path(name).stem,
    )
