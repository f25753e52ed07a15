"""A task's path from a file: what planners and recorders of ROS write, or a plain table."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.devices.ros2.trajectory import TrajectoryMotion, read_trajectory
from armload.errors import MotionError, one_line
from armload.motion import Motion, check_joints, load_motion
from armload.motion.as_written import not_too_long, numbers


def is_trajectory(name: str) -> bool:
    """Whether a file holds a JointTrajectory by what it names; one that cannot be read does not."""
    try:
        return "joint_names" in Path(name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False


def read_path(name: str, arm: Arm) -> Motion:
    """A task's path from a file: a JointTrajectory (YAML or JSON), a table (CSV), or a motion's own JSON.

    Raises:
        MotionError: it cannot be read, or it is none of the forms that are known.
    """
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
    except (ValueError, RecursionError):
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
    except (YAMLError, ValueError, RecursionError) as error:  # a date that is none is a ValueError
        raise MotionError(f"{name} is neither JSON nor YAML: {one_line(error)}") from None


def _trajectory(content: dict[str, Any], name: str, arm: Arm) -> Motion:
    """The motion through the points of a message as a file has it, from the first one on, whenever that is due."""

    def seconds(point: dict[str, Any]) -> float:
        at = point.get("time_from_start", {})
        whole, rest = at.get("sec", at.get("secs", 0)), at.get("nanosec", at.get("nsecs", 0))
        return float(numbers(whole, "time_from_start")) + 1e-9 * float(numbers(rest, "time_from_start"))

    try:
        points = content["points"]
        first = seconds(points[0])
        made = []
        for point in points:
            whole, rest = divmod(round((seconds(point) - first) * 1e9), 10**9)
            columns = {
                key: list(numbers(point.get(key) or [], key)) for key in ("positions", "velocities", "accelerations")
            }
            made.append(SimpleNamespace(time_from_start=SimpleNamespace(sec=whole, nanosec=rest), **columns))
        header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))  # a file begins when it is run
        message = SimpleNamespace(header=header, joint_names=list(content["joint_names"]), points=made)
        order = [message.joint_names.index(joint) for joint in arm.joint_names]
        start = np.array(made[0].positions, dtype=float)[order]
    except MotionError as error:
        raise MotionError(f"{name}: {error}") from None
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError):
        raise MotionError(
            f"{name} is no JointTrajectory of {arm.name}: expected joint_names with {', '.join(arm.joint_names)}, and "
            "points with positions and time_from_start"
        ) from None
    rest = np.zeros(arm.n)
    return replace(read_trajectory(message, arm, (start, rest, rest)), begins=first)


def _table(text: str, name: str, arm: Arm) -> Motion:
    """The motion through the rows t, q1 … qn, and dq1 …, ddq1 … where they are there."""
    header, *lines = [line for line in text.splitlines() if line.strip()] or [""]
    names = [cell.strip() for cell in header.split(",")]
    wanted = {kind: [f"{kind}{k + 1}" for k in range(arm.n)] for kind in ("q", "dq", "ddq")}
    for column in ("t", *wanted["q"], *wanted["dq"], *wanted["ddq"]):
        if names.count(column) > 1:
            raise MotionError(f"{name} has {names.count(column)} columns {column!r}: expected one of each")
    if "t" not in names or any(column not in names for column in wanted["q"]) or f"q{arm.n + 1}" in names:
        raise MotionError(
            f"{name} has the columns {', '.join(names)}: expected t, q1 … q{arm.n} in s and rad, parted by commas"
        )
    try:
        rows = np.array([[float(cell) for cell in line.split(",")] for line in lines]).reshape(-1, len(names))
        t = rows[:, names.index("t")]
        t = t - t[0]
    except (ValueError, IndexError):
        raise MotionError(f"{name} has a row that is not {len(names)} numbers") from None
    found: dict[str, Any] = {
        kind: rows[:, [names.index(column) for column in columns]]
        for kind, columns in wanted.items()
        if all(column in names for column in columns)
    }
    velocities = found.get("dq")
    accelerations = None if velocities is None else found.get("ddq")
    return not_too_long(TrajectoryMotion(t, found["q"], velocities, accelerations, name=Path(name).stem))
