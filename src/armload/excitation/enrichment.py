"""A task's own path with the smallest change that lets it tell a payload: so many millimetres and degrees, no time.

    maximise J(c)   subject to   |p(q) − p(q_0)| ≤ d,   |angle of R(q)·R(q_0)ᵀ| ≤ θ,   the constraints,
    q(t) = q_0(t) + Σ_k c_k·B_k(t) while the path moves,   q(t) = q_0(t) while it stands

The change is made of quintic splines on each stretch between stops that start and end at rest with it: ends, stops and
times stay as they are, exactly. What costs nothing at the flange, motion in the arm's own null space, is found first,
as the tube (`tube.py`) does not hold it back. What is found is checked at 1 kHz by other code, and made smaller until
it passes; no change at all passes if the path does. One of which little would be left is looked for further first, at
the points that are handed out and with a heavier penalty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms.units import unit_of
from armload.errors import MotionError
from armload.excitation.constraints import Constraints
from armload.excitation.criterion import Criterion
from armload.excitation.optimisation import AGAIN, INSIDE, MUCH_SMALLER, Climb
from armload.excitation.surroundings import Surroundings
from armload.excitation.track import Track
from armload.excitation.tube import Tube, away, poses
from armload.excitation.verification import RATE, Used, used
from armload.motion import Motion, PathMotion

DISTANCE, ANGLE = 5e-3, np.deg2rad(2.0)  # [m], [rad] at the payload frame
_POINTS_PER_SECOND = 6.0  # control points: changes so small tell by their acceleration, up to about 3 Hz
_SHORTEST = 0.5  # [s] of a stretch that is changed
_STILL = 1e-3  # [rad/s] of the fastest joint: the path stands
_FAR = 0.05  # [rad] that a path goes, which hence does not stand
_STAGES = ((10, 50.0), (14, 1000.0))  # iterations of L-BFGS and weight of the penalty
_RATE = 25.0  # [Hz] of the samples while it is looked for, four for each control point
_ANY = 100.0  # [rad] of --travel: no bound
_REACH = 0.03  # [rad] that a control point is scaled by
_POINTS = 100.0  # [Hz] of the path that is handed out
_SHRINKS, _SHRINK = 40, 0.95
_NEARER = 1e-3  # [m] that a change may come nearer to what the path nearly touches
# no change at all, of which 0 is asked: what no robot repeats. Motion that costs nothing at the flange does so to
# first order alone
_NO_DISTANCE, _NO_ANGLE = 1e-5, np.deg2rad(0.01)  # [m], [rad]
_MOVING_AT_ENDS = 0.01  # of the velocity limit: less may be noise of a recorded path, or rounding


@dataclass(frozen=True, eq=False)
class Enriched:
    """An enriched path, and what that is worth.

    motion: the path with its change. before, after: 95 % half-widths (10,) of both at best. distance, angle: of the
    payload frame's poses at most [m, rad]. used: of each limit, the most first.
    """

    motion: PathMotion
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    distance: float
    angle: float
    used: list[Used]


def enrich(
    path: Motion,
    constraints: Constraints,
    criterion: Criterion,
    *,
    distance: float = DISTANCE,
    angle: float = ANGLE,
    seed: int = 0,
    quick: bool = False,
) -> Enriched:
    """The path with the change that tells most of a payload.

    Args:
        path: from rest to rest.
        constraints: about the path's start; their clearances are kept as far as the path itself keeps them.
        criterion: what is known besides the run; its tare is no motion of its own.
        distance, angle: of the payload frame at most [m, rad]; 0: none that matters, 0.01 mm or 0.01°.
        seed: of the start; the same seed gives the same path.
        quick: whether a change that does not pass as it is may be made much smaller, rather than looked for further:
            for a task that goes on (`benchmarks/design_time.py`).

    Raises:
        MotionError: no room for a change, a path with nothing to change, or one that passes a limit by itself.
    """
    arm = constraints.arm
    if path.n != arm.n:
        raise MotionError(f"the path {path.name!r} moves {path.n} joints: {arm.name} has {arm.n}")
    if not (distance >= 0 and angle >= 0 and distance + angle > 0):
        asked = f"{1e3 * distance:g} mm and {np.rad2deg(angle):g}°"
        raise MotionError(f"a change of {asked} is asked for: expected room in one of them")
    distance, angle = max(distance, _NO_DISTANCE), max(angle, _NO_ANGLE)
    _check_at_rest(constraints, path)
    _check_pace(path)
    constraints = _as_the_path(constraints, path)
    passed = [one for one in used(constraints, path) if one.share > 1.0 and one.what != "rest"]
    if passed:
        raise MotionError(
            f"the path {path.name!r} passes a limit by itself: {passed[0].text}; {_way_out(constraints, passed[0])}"
        )
    stretches = moving_stretches(path)
    if not stretches:
        raise MotionError(
            f"the path {path.name!r} has no stretch of {_SHORTEST:g} s between stops: there is nothing to change"
        )
    track = Track(path, path.duration, stretches)
    reach = np.full(arm.n, min(_REACH, 3.0 * max(angle, distance / 0.3)))

    def sampled_at(rate: float, spare: float = 0.0) -> Climb:
        tube = Tube(arm, track.base_at(track.sampled(rate).t, 0), distance, angle)
        return Climb(constraints, criterion, [track], [reach], tube, rate, spare)

    def held_back(x: NDArray[np.float64]) -> _HeldBack:
        return _held_back(constraints, path, track, problem.points(x)[0], distance, angle)

    problem = sampled_at(_RATE)
    x = 0.3 * np.random.default_rng(seed).normal(size=problem.size)
    for iterations, weight in _STAGES:
        x = problem.climb(x, iterations, weight)[0]
    found = [held_back(x)]
    # a UR10e's pick and place keeps four of its 5 mm without this, and 4.9 with it
    # (test_a_quick_change_that_does_not_pass_is_made_smaller_and_not_looked_for_further)
    if found[0].size < MUCH_SMALLER and not quick:
        found.append(held_back(sampled_at(_POINTS, _NEARER / 2.0).climb(x, *AGAIN)[0]))
    passing = [one for one in found if one.passes]
    if not passing:
        raise MotionError(f"no change of the path {path.name!r} keeps to the constraints: {found[-1].in_the_way}")
    best = max(passing, key=lambda one: problem.evaluated([one.motion]).value)
    before, after = problem.evaluated([path]).half_width, problem.evaluated([best.motion]).half_width
    return Enriched(best.motion, before, after, best.distance, best.angle, best.used)


def touched_by(path: Motion, around: Surroundings) -> str | None:
    """What the path itself comes to, in words, and by how much; None: it stays clear.

    A task may mean to: what it holds stands on a table at last.
    """
    q = _poses(path)
    clearance = around.clearance(q)
    row, kind = np.unravel_index(int(np.argmin(clearance)), clearance.shape)
    if clearance[row, kind] > 0.0:
        return None
    return f"{around.nearest(q[row : row + 1], int(kind))} ({clearance[row, kind]:.3f} m between their capsules)"


def _poses(path: Motion) -> NDArray[np.float64]:
    return path(np.linspace(0.0, path.duration, round(path.duration * 100.0) + 2))[0]


def moving_stretches(path: Motion) -> list[tuple[float, float, int]]:
    """From, to [s] and control points of the stretches between stops that are long enough to be changed.

    They begin and end at points of the path that is handed out: the jerk of a change jumps there, and a quintic between
    two points would swing about a jump amid them.
    """
    t = path.instants(_POINTS)
    moves = np.abs(path.velocity(t)).max(axis=1) > _STILL
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moves, [False]]).astype(int)))
    out = []
    for first, last in edges.reshape(-1, 2):
        begin, end = float(t[max(first - 1, 0)]), float(t[min(last, len(t) - 1)])
        if end - begin >= _SHORTEST:
            out.append((begin, end, max(3, round(_POINTS_PER_SECOND * (end - begin)))))
    return out


def _check_at_rest(constraints: Constraints, path: Motion) -> None:
    """See that a path begins and ends at rest: an arm cannot jump into one that moves."""
    arm, most = constraints.arm, constraints.most["velocity"] / constraints.share
    for at, where in ((0.0, "begin"), (path.duration, "end")):
        speed = np.abs(path.velocity([at])[0])
        j = int(np.argmax(speed / most))
        if speed[j] > _MOVING_AT_ENDS * most[j]:
            raise MotionError(
                f"the path {path.name!r} does not {where} at rest: {arm.joint_names[j]} moves at {speed[j]:.3g} "
                f"{unit_of('velocity', arm.limits.slides[j])}; expected a path from rest to rest"
            )


def _check_pace(path: Motion) -> None:
    """See that a path that goes anywhere does so in seconds: one of hours would be looked at 1000 times a second."""
    fastest = float(np.abs(path.velocity(path.instants(200.0))).max())
    if fastest <= _STILL and float(np.ptp(_poses(path), axis=0).max()) > _FAR:
        raise MotionError(
            f"the path {path.name!r} takes {path.duration:g} s, and no joint goes faster than {fastest:.2g} rad/s: "
            "times are in s; are these ms?"
        )


def _way_out(constraints: Constraints, passed: Used) -> str:
    """What may be done about a limit that a path passes: only a limit of the user's own can be made wider."""
    ways = ["change the path"]
    if passed.what == "torque":
        ways.append("give the payload's mass (--payload)")
    own = {"tool speed": "allow a higher --speed", "position": "allow a larger --travel"}
    if passed.what in own and (passed.what == "tool speed" or constraints.travel < _ANY):
        ways.append(own[passed.what])
    if constraints.share < 1.0 and passed.what not in ("tool speed", "clearance"):
        ways.append("allow a larger --share")
    return ", or ".join(ways)


def _as_the_path(constraints: Constraints, path: Motion) -> Constraints:
    """The constraints, with clearances no larger than the path's own.

    An acceleration or a jerk to which the maker sets no limit is allowed as far as the path itself uses it, with what
    is assumed of such an arm on top: a task's path that runs every day may jump in its acceleration.
    """
    own = constraints.around.clearance(_poses(path)).min(axis=0)
    keep = np.minimum(constraints.around.keep, np.where(np.isfinite(own), own - _NEARER, np.inf))
    steps = max(4, int(np.ceil(path.duration * RATE)))
    t = np.linspace(0.0, path.duration, steps + 1)
    both = [motion.position(t) for motion in (path, PathMotion.of(path, _POINTS))]  # as it is, and as it is handed out
    own = {
        what: np.max([np.abs(np.diff(q, k, axis=0)).max(axis=0) for q in both], axis=0) / t[1] ** k
        for what, k in (("acceleration", 2), ("jerk", 3))
    }
    around = replace(constraints.around, keep=tuple(keep.tolist()), of_start=1.0)
    return replace(constraints, surroundings=around, path_uses=own)


class _HeldBack(NamedTuple):
    """A change made smaller: the path with it, what is left of its size, and what was found of it.

    distance, angle: of the payload frame's poses at most [m, rad]. used: of each limit; empty: it leaves the tube.
    """

    motion: PathMotion
    size: float
    distance: float
    angle: float
    used: list[Used]

    @property
    def passes(self) -> bool:
        """Whether it keeps to the tube and to every limit."""
        return bool(self.used) and self.used[0].share <= 1.0

    @property
    def in_the_way(self) -> str:
        """What it does not keep to, in words."""
        return self.used[0].text if self.used else "none stays within the tube"


def _held_back(
    constraints: Constraints, path: Motion, track: Track, c: NDArray[np.float64], distance: float, angle: float
) -> _HeldBack:
    """The path with a change c (n, K), made smaller until it passes, or is as small as it gets."""
    given, size = poses(constraints.arm, path, RATE), 1.0
    for _ in range(_SHRINKS):
        changed = PathMotion.of(_Changed(track, size * c, path.name), _POINTS, f"{path.name}-enriched")
        far, turned = (float(x.max()) for x in away(given, poses(constraints.arm, changed, RATE)))
        over = max(far / distance, turned / angle)
        inside = over <= INSIDE
        found = [one for one in used(constraints, changed) if one.what != "rest"] if inside else []
        out = _HeldBack(changed, size, far, turned, found)
        if out.passes:
            break
        size *= _SHRINK if inside else min(_SHRINK, INSIDE / over)
    return out


@dataclass(frozen=True, eq=False)
class _Changed(Motion):
    """A track with its control points (n, K)."""

    track: Track
    control: NDArray[np.float64]
    name: str

    @property
    def n(self) -> int:
        return len(self.control)

    @property
    def duration(self) -> float:
        return self.track.lasting

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        return self.track.base_at(t, order) + self.track.basis(t, order) @ self.control.T
