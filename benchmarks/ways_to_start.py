"""Which way leads from a present pose to where a motion begins: the straight quintic, or ruckig's time-optimal one?

    pip install ruckig
    nice -n 15 python benchmarks/ways_to_start.py [--ways 100] [--arms panda,ur10e] [--page]

Poses at random, each joint up to 1 rad from the other end. Both ways are straight in joint space, from rest to rest,
and keep to the same share of the limits of velocity, acceleration and jerk (what no maker gives is assumed); where
the check with the rated payload refuses one, the next smaller share is tried, as `armload measure` does. Poses from
which no way is allowed are told, and count for nothing else. Writes benchmarks/results/ways_to_start.json, and the
table in docs/motion.md.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table

from armload.arms import Arm, arm
from armload.measuring.plan import SHARES
from armload.motion import Motion, MotionCheck, StraightMotion, check_motion, rated_load
from armload.motion.random_fourier import filled_limits

_FARTHEST = 1.0  # [rad] of a joint, as of `armload measure --approach`
_CLEARANCES = 100.0  # [Hz] at which clearances are checked
_STEP = 1e-6  # [s] of ruckig's jerk
_WITHIN = 0.9  # of half the range, of the poses drawn


@dataclass(frozen=True, eq=False)
class TimeOptimal(Motion):
    """The straight way of ruckig: bang-bang in jerk, all joints in phase."""

    trajectory: Any
    joints: int
    name: str = "ruckig"  # type: ignore[assignment]

    @classmethod
    def between(cls, robot: Arm, start: NDArray, stop: NDArray, share: float) -> TimeOptimal:
        """From pose to pose within a share of the limits."""
        import ruckig

        limits, asked = filled_limits(robot.limits), ruckig.InputParameter(robot.n)
        asked.current_position, asked.target_position = start.tolist(), stop.tolist()
        asked.max_velocity = (share * limits.velocity).tolist()
        asked.max_acceleration = (share * limits.acceleration).tolist()
        asked.max_jerk = (share * limits.jerk).tolist()
        asked.synchronization = ruckig.Synchronization.Phase
        found = ruckig.Trajectory(robot.n)
        assert ruckig.Ruckig(robot.n).calculate(asked, found) == ruckig.Result.Working
        return cls(found, robot.n)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.joints

    @property
    def duration(self) -> float:
        """[s]."""
        return self.trajectory.duration

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """Of the order 0 to 3; jerk is the difference quotient of acceleration, constant but where it jumps."""
        if order == 3:
            return (self.derivative(t + _STEP, 2) - self.derivative(t - _STEP, 2)) / (2 * _STEP)
        return np.array([self.trajectory.at_time(float(np.clip(x, 0.0, self.duration)))[order] for x in np.ravel(t)])


def found_way(robot: Arm, make: Any) -> tuple[Motion, MotionCheck, float] | None:
    """The fastest way that is allowed, what the check says, and its share."""
    for share in SHARES:
        way = make(share)
        check = check_motion(robot, way, rated_load(robot), rate=1000.0, collision_rate=_CLEARANCES)
        if check.ok:
            return way, check, share
    return None


def measured(robot: Arm, seed: int) -> dict[str, Any]:
    """Both ways between two poses; "none" where none is allowed."""
    rng, limits = np.random.default_rng([24, seed]), filled_limits(robot.limits)
    middle, half = (
        (limits.position_high + limits.position_low) / 2,
        (limits.position_high - limits.position_low) / 2,
    )
    start = middle + _WITHIN * half * rng.uniform(-1, 1, robot.n)
    stop = np.clip(
        start + rng.uniform(-1, 1, robot.n) * rng.uniform(0, _FARTHEST),
        middle - _WITHIN * half,
        middle + _WITHIN * half,
    )
    out = {}
    for name, make in {
        "quintic": lambda share: StraightMotion.slow(robot, start, stop, share),
        "ruckig": lambda share: TimeOptimal.between(robot, start, stop, share),
    }.items():
        begun = process_time()
        make(SHARES[0])
        seconds = process_time() - begun
        found = found_way(robot, make)
        if found is not None:
            way, check, share = found
            jerk = np.abs(way.derivative(np.linspace(0, way.duration, 2001), 3)).max(axis=0) / limits.jerk
            torque = float(check.used("torque").max())
            out[name] = [way.duration, share, float(jerk.max()), torque, seconds]
    return out


def summary(ways: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians of both over the poses where both are allowed."""
    both = [one for one in ways if len(one) == 2]
    names = ("duration", "share", "jerk", "torque", "cpu")
    out: dict[str, Any] = {
        "ways": len(ways),
        "none": sum(not one for one in ways),
        "one only": {name: sum(set(one) == {name} for one in ways) for name in ("quintic", "ruckig")},
    }
    for kind in ("quintic", "ruckig"):
        rows = np.array([one[kind] for one in both])
        out[kind] = dict(zip(names, np.median(rows, axis=0).tolist(), strict=True))
        out[kind]["duration_95"] = float(np.quantile(rows[:, 0], 0.95))
        out[kind]["jerk_most"] = float(rows[:, 2].max())
    return out


def table(found: dict[str, Any]) -> str:
    """A row for each arm and kind of way."""
    columns = ["arm, way", "allowed", "duration [s], median (95 %)", "largest jerk, of its limit: median (most)"]
    rows = []
    for name, one in found.items():
        for kind in ("quintic", "ruckig"):
            allowed = one["ways"] - one["none"] - sum(n for k, n in one["one only"].items() if k != kind)
            mine = one[kind]
            rows.append(
                [
                    f"{name}, {kind}",
                    f"{allowed} of {one['ways']}",
                    f"{mine['duration']:.1f} ({mine['duration_95']:.1f})",
                    f"{100 * mine['jerk']:.2g} % ({100 * mine['jerk_most']:.2g} %)",
                ]
            )
    return markdown_table(columns, "lrrr", rows)


def main() -> None:
    """Draw, compare, write."""
    asked = options(__doc__, ways=100, arms="panda,ur10e", page=False)
    if not asked.page:
        found = {}
        for name in asked.arms.split(","):
            robot = arm(name)
            found[name] = summary([measured(robot, seed) for seed in range(asked.ways)])
            say(f"{name}: {found[name]}")
        write("ways_to_start", {"arms": found}, None)
    found = json.loads((RESULTS / "ways_to_start.json").read_text(encoding="utf-8"))["arms"]
    write_table(ROOT / "docs" / "motion.md", "ways to start", table(found))


if __name__ == "__main__":
    main()
