"""Motions for somebody with a robot: a table (CSV), a ROS 2 trajectory (YAML) and a program for UR robots (URScript).

All three contain numbers sampled evenly from the analytic motion, and both ends exactly. **Check the motion first**
(`check_motion`, with what the robot carries), and run it slowly first: these files know nothing of what stands around.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion
from armload.motion.motion_file import write_whole
from armload.motion.path import PathMotion

LEAD = 5.0  # [s] for getting to the start
RATES = {"csv": 1000.0, "ros2": 100.0, "ur": 500.0}  # [Hz] by format, the default
# [rad] that what is run between two entries may be off the motion: a tenth of what stops an arm that is off its path
# (`devices.supervision`). Designed motions are 0.3 mrad off at 5 points per second and 50 mrad at 2; as straight lines
# 1 mrad at 50 Hz
_OFF = 5e-3
_LOOK = 1000.0  # [Hz] at which that is looked at


def export_motion(
    motion: Motion,
    path: str | Path,
    format: str = "csv",
    rate: float | None = None,
    joint_names: Sequence[str] | None = None,
    lead: float = LEAD,
) -> None:
    """Write a motion as a file that a robot's own tools read, complete or not at all.

    - "csv": a header and one row per sample: t, q1 … qn, dq1 … dqn, ddq1 … ddqn [s, rad, rad/s, rad/s²].
    - "ros2": a `trajectory_msgs/msg/JointTrajectory` as YAML, for `ros2 topic pub --once <topic>
      trajectory_msgs/msg/JointTrajectory "$(cat file)"`, or as the `trajectory` of a FollowJointTrajectory goal.
    - "ur": a URScript program: `movej` to the start, then `servoj` from entry to entry, one per controller cycle.

    Args:
        motion: what to write.
        path: the file; an existing one is replaced.
        format: "csv", "ros2" or "ur".
        rate: samples per second [Hz]; default 1000 (csv), 100 (ros2), 500 (ur, an e-Series controller's cycle; give 125
            for a CB3 controller).
        joint_names: the joints in the order of q, as the robot's driver calls them (`arm.joint_names`); needed by
            "ros2".
        lead: time for getting to the start in a "ros2" trajectory [s]: its first point comes so late, and the
            controller interpolates from wherever the arm is. That way is not checked; be near the start. 0: it is.

    Raises:
        MotionError: an unknown format, a rate that is not positive or too low for the motion, a lead below 0, joint
            names missing, a "ur" motion that has not 6 joints, or a file that cannot be written.
    """
    write_whole([(path, motion_text(motion, format, rate, joint_names, lead))])


def motion_text(
    motion: Motion,
    format: str = "csv",
    rate: float | None = None,
    joint_names: Sequence[str] | None = None,
    lead: float = LEAD,
) -> str:
    """The text that `export_motion` writes; arguments and errors as there."""
    if format not in RATES:
        raise MotionError(f"unknown motion format {format!r}: expected one of {', '.join(RATES)}")
    rate = RATES[format] if rate is None else float(rate)
    if not (np.isfinite(rate) and rate > 0):
        raise MotionError(f"rate of the export is {rate} Hz: expected a positive number")
    if not (np.isfinite(lead) and lead >= 0):
        raise MotionError(f"lead of the export is {lead} s: expected a time for getting to the start, of 0 or more")
    steps = max(1, round(motion.duration * rate))
    t = np.linspace(0.0, motion.duration, steps + 1)
    _check_rate(motion, t, format, rate)
    if format == "csv":
        return _csv(motion, t)
    return _ros2(motion, t, joint_names, lead) if format == "ros2" else _ur(motion, t)


def _check_rate(motion: Motion, t: NDArray[np.float64], format: str, rate: float) -> None:
    """See that what is run between the entries at t is the motion: quintics, or straight lines of servoj."""
    looked = motion.instants(_LOOK)
    if format == "ur":
        q = motion.position(t)
        run = np.stack([np.interp(looked, t, column) for column in q.T], axis=1)
    else:
        run = PathMotion(t, *motion(t)).position(looked)
    off = np.abs(run - motion.position(looked)).max(axis=0)
    j = int(off.argmax())
    if off[j] > _OFF:
        raise MotionError(
            f"with {rate:g} samples per second joint {j + 1} would be up to {off[j]:.2g} rad (or m) off the "
            f"motion {motion.name!r} between two of them: expected at most {_OFF:g}; give a higher rate"
        )


def _csv(motion: Motion, t: NDArray[np.float64]) -> str:
    q, dq, ddq = motion(t)
    names = [f"{kind}{joint + 1}" for kind in ("q", "dq", "ddq") for joint in range(motion.n)]
    rows = [",".join(_number(x) for x in row) for row in np.column_stack([t, q, dq, ddq])]
    return "\n".join([",".join(["t", *names]), *rows]) + "\n"


def _ros2(motion: Motion, t: NDArray[np.float64], joint_names: Sequence[str] | None, lead: float) -> str:
    if joint_names is None:
        raise MotionError("a ROS 2 trajectory names its joints: give joint_names, such as those of the arm")
    joint_names = list(joint_names)
    if len(joint_names) != motion.n:
        raise MotionError(f"{len(joint_names)} joint names for a motion of {motion.n} joints: expected one for each")
    lines = [
        "header:",
        "  stamp: {sec: 0, nanosec: 0}",  # zero: start as soon as the message arrives
        "  frame_id: ''",
        f"joint_names: [{', '.join(_quoted(name) for name in joint_names)}]",
        "points:",
    ]
    nanoseconds = np.round((t + lead) * 1e9).astype(np.int64)
    for k, rows in enumerate(zip(*motion(t), strict=True)):
        position, velocity, acceleration = ("[" + ", ".join(_number(x) for x in row) + "]" for row in rows)
        seconds, rest = divmod(int(nanoseconds[k]), 10**9)
        lines += [
            f"- positions: {position}",
            f"  velocities: {velocity}",
            f"  accelerations: {acceleration}",
            f"  time_from_start: {{sec: {seconds}, nanosec: {rest}}}",
        ]
    return "\n".join(lines) + "\n"


def _ur(motion: Motion, t: NDArray[np.float64]) -> str:
    if motion.n != 6:
        raise MotionError(f"the motion {motion.name!r} moves {motion.n} joints: a UR robot has 6")
    q = motion(t)[0]
    name = " ".join(motion.name.split())  # a line break would let the rest of the name out of its comment
    poses = [f"[{', '.join(_number(x) for x in row)}]" for row in q]
    # One call per entry and no list of lists: every controller version runs it, and none limits its length.
    return "\n".join(
        [
            "def armload_motion():",
            f"  # {name}: {motion.duration:g} s; q1 to q6 in rad, one entry every {_number(t[1])} s",
            "  def go(q):",
            f"    servoj(q, t={_number(t[1])}, lookahead_time=0.1, gain=300)",
            "  end",
            f"  movej({poses[0]}, a=0.5, v=0.3)",
            "  sleep(1.0)",
            *(f"  go({pose})" for pose in poses),
            "  stopj(2.0)",
            "end",
            "armload_motion()",
            "",
        ]
    )


def _number(x: float) -> str:
    """Nine decimals, without trailing zeros and without −0: 1 nrad is far below what any robot resolves."""
    text = f"{x:.9f}".rstrip("0")
    text = text + "0" if text.endswith(".") else text
    return "0.0" if text == "-0.0" else text


def _quoted(name: str) -> str:
    """A YAML string that cannot be taken for anything else."""
    return "'" + name.replace("'", "''") + "'"
