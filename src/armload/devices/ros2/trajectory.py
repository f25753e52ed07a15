"""A trajectory_msgs/JointTrajectory as a motion, interpolated as ROS 2's joint trajectory controller does it.

Between two points each joint follows the polynomial that their derivatives determine: a cubic with velocities, a
quintic with accelerations. With positions only the controller goes in straight lines, whose velocity jumps; here a
cubic spline through all points, to rest at the last, takes their place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.arms.units import unit_of
from armload.errors import MotionError
from armload.motion import Motion
from armload.motion.as_written import not_too_long, shown

_SAME_PLACE = 0.02  # [rad] a trajectory that begins at once may begin so far from where the arm is
_AT_REST = 1e-3  # [rad/s]
_LOOK = 0.005  # [s] between the instants at which limits are looked at
_SLACK = 1e-6  # of rounding


@dataclass(frozen=True, eq=False)
class TrajectoryMotion(Motion):
    """A motion through points.

    >>> motion = TrajectoryMotion([0.0, 2.0], [[0.0], [1.0]], [[0.0], [0.0]])
    >>> motion.position([1.0]).tolist()
    [[0.5]]

    Args:
        times: (K,) [s], the first of them 0, rising.
        positions: (K, n) [rad]; velocities [rad/s], accelerations [rad/s²]: the same, or None.
        begins: when the first point is due, counted from when the trajectory was to start [s]; None: nobody said.
        leaving: velocity (n,) at the first point, where `velocities` is None; None: from rest [rad/s].

    Raises:
        MotionError: shapes that do not fit, times that do not rise from 0, numbers that are not finite.
    """

    times: ArrayLike
    positions: ArrayLike
    velocities: ArrayLike | None = None
    accelerations: ArrayLike | None = None
    leaving: ArrayLike | None = None
    name: str = "trajectory"
    begins: float | None = None

    def __post_init__(self) -> None:
        for name in ("times", "positions", "velocities", "accelerations"):
            if getattr(self, name) is not None:
                value = np.array(getattr(self, name), dtype=float)
                value.setflags(write=False)
                object.__setattr__(self, name, value)
        times, shape = np.asarray(self.times), np.shape(self.positions)
        if times.ndim != 1 or len(times) < 2 or len(shape) != 2:
            raise MotionError(f"the {self.name} has {times.size} point(s): expected at least 2, times (K,), (K, n)")
        for name in ("positions", "velocities", "accelerations"):
            value = getattr(self, name)
            if value is None:
                continue
            if value.shape != (len(times), shape[1]):
                raise MotionError(
                    f"the {name} of the {self.name} have shape {value.shape}: expected ({len(times)}, {shape[1]})"
                )
            if len(bad := np.argwhere(~np.isfinite(value))):
                k, j = bad[0].tolist()
                raise MotionError(f"the {name} of the {self.name} are not finite: joint {j + 1} at point {k + 1}")
        if times[0] != 0 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
            raise MotionError(f"the times of the {self.name} do not rise from 0: expected each point after the last")

    @property
    def n(self) -> int:
        """Number of joints."""
        return np.shape(self.positions)[1]

    @property
    def duration(self) -> float:
        """Time of the last point [s]."""
        return float(np.asarray(self.times)[-1])

    def seams(self) -> NDArray[np.float64]:
        """The points' times [s]."""
        return np.asarray(self.times)

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        return np.asarray(self._curve(np.asarray(t, dtype=float), nu=order))

    @cached_property
    def _curve(self) -> Any:
        from scipy.interpolate import BPoly, CubicSpline

        if self.velocities is None:
            rest = np.zeros(self.n)
            ends: Any = ((1, rest if self.leaving is None else np.asarray(self.leaving)), (1, rest))
            return CubicSpline(self.times, self.positions, bc_type=ends)
        known = [self.positions, self.velocities] + ([] if self.accelerations is None else [self.accelerations])
        return BPoly.from_derivatives(self.times, np.stack([np.asarray(x) for x in known], axis=1))


def read_trajectory(
    message: Any,
    arm: Arm,
    start: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    now: int | None = None,
) -> TrajectoryMotion:
    """The motion that a JointTrajectory asks of an arm commanded to be at `start`: q, dq and ddq, each (n,).

    It blends into the points from the state the arm is in. Its times count from the header's stamp, and points that are
    over by `now`, when the motion begins [ns since 1970], are left out; without a stamp, or a `now`, it begins at once.

    Raises:
        MotionError: joints that are not the arm's, all of them once; no points; points that lack positions, go back in
            time, begin elsewhere than the arm is or do not end at rest; more than an hour; a joint limit of position or
            velocity passed.
    """
    names = list(message.joint_names)
    for name in names:
        if not isinstance(name, str):
            raise MotionError(f"the trajectory names a joint {shown(name)}: expected texts")
    if sorted(names) != sorted(arm.joint_names):
        raise MotionError(
            f"the trajectory moves {', '.join(names) or 'no joints'}: expected {', '.join(arm.joint_names)}, each once"
        )
    order = [names.index(name) for name in arm.joint_names]
    points = list(message.points)
    if not points:
        raise MotionError("the trajectory has no points: expected at least one")
    times = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points])
    stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
    if now is not None and stamp:
        times = times - 1e-9 * (now - stamp)
        ahead = times > _LOOK
        if not ahead.any():
            raise MotionError(f"the trajectory was over {-times[-1]:.3f} s before it could begin")
        times, points = times[ahead], [point for point, kept in zip(points, ahead, strict=True) if kept]
    positions, *rest = [_column(points, kind, order) for kind in ("positions", "velocities", "accelerations")]
    velocities, accelerations = rest if rest[0] is not None else (None, None)
    if positions is None:
        raise MotionError("the trajectory has points without positions: expected one for each joint")
    if velocities is not None and np.max(np.abs(velocities[-1])) > _AT_REST:
        raise MotionError("the trajectory does not end at rest: expected velocities of 0 in its last point")
    if times[0] > 0:  # from where the arm is
        times = np.append(0.0, times)
        positions, velocities, accelerations = (
            None if column is None else np.vstack([here, column])
            for column, here in zip((positions, velocities, accelerations), start, strict=True)
        )
    elif np.max(away := np.abs(positions[0] - start[0])) > _SAME_PLACE:
        j = int(np.argmax(away))
        unit = unit_of("position", arm.limits.slides[j])
        raise MotionError(
            f"the trajectory begins at once, {away[j]:.3f} {unit} from where {arm.joint_names[j]} is: give its first "
            "point a time_from_start that lets the arm get there"
        )
    assert positions is not None
    motion = not_too_long(TrajectoryMotion(times, positions, velocities, accelerations, start[1]))
    _check_limits(arm, motion)
    return motion


def _column(points: Sequence[Any], kind: str, order: list[int]) -> NDArray[np.float64] | None:
    """Positions, velocities or accelerations (K, n) in the arm's order; None where not every point has them."""
    rows = [list(getattr(point, kind)) for point in points]
    for k, row in enumerate(rows):
        if len(row) not in (0, len(order)):
            raise MotionError(
                f"point {k + 1} of the trajectory has {len(row)} {kind} for {len(order)} joints: expected one for each"
            )
    return np.array(rows, dtype=float)[:, order] if all(rows) else None


def _check_limits(arm: Arm, motion: TrajectoryMotion) -> None:
    t = np.linspace(0.0, motion.duration, max(2, int(np.ceil(motion.duration / _LOOK)) + 1))
    q, dq, _ = motion(t)
    limits = arm.limits
    for what, over in (
        ("position", np.maximum(limits.position_low - q, q - limits.position_high)),
        ("velocity", np.abs(dq) - limits.velocity_at(q, dq)),
    ):
        k, j = np.unravel_index(np.argmax(over), over.shape)
        if over[k, j] > _SLACK:
            raise MotionError(
                f"the trajectory takes {arm.joint_names[j]} past its {what} limit by {over[k, j]:.3g} "
                f"{unit_of(what, limits.slides[j])} at {t[k]:.2f} s: expected a motion within the limits of {arm.name}"
            )
