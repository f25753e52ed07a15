"""A task's own path with the smallest change that lets it tell a payload: so many millimetres and degrees, no time.

    maximise J(c)   subject to   |p(q) − p(q_0)| ≤ d,   |angle of R(q)·R(q_0)ᵀ| ≤ θ,   the constraints,
    q(t) = q_0(t) + Σ_k c_k·B_k(t) while the path moves,   q(t) = q_0(t) while it stands

The change is made of quintic splines on each stretch between stops that start and end at rest with it: ends, stops and
times stay as they are, exactly. What costs nothing at the flange, motion in the arm's own null space, is found first,
as the tube (`tube.py`) does not hold it back. What is found is checked at 1 kHz by other code, and made smaller until
it passes; no change at all passes if the path does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.excitation.constraints import Constraints
from armload.excitation.criterion import Criterion
from armload.excitation.optimisation import Climb
from armload.excitation.surroundings import Surroundings
from armload.excitation.track import Track
from armload.excitation.tube import Tube, away, poses
from armload.excitation.verification import RATE, Used, used
from armload.motion import Motion, PathMotion

DISTANCE, ANGLE = 5e-3, np.deg2rad(2.0)  # [m], [rad] at the payload frame
_POINTS_PER_SECOND = 6.0  # control points: changes so small tell by their acceleration, up to about 3 Hz
_SHORTEST = 0.5  # [s] of a stretch that is changed
_STILL = 1e-3  # [rad/s] of the fastest joint: the path stands
_STAGES = ((10, 50.0), (14, 1000.0))  # iterations of L-BFGS and weight of the penalty
_RATE = 25.0  # [Hz] of the samples while it is looked for, four for each control point
_REACH = 0.03  # [rad] that a control point is scaled by
_POINTS = 100.0  # [Hz] of the path that is handed out
_SHRINKS, _SHRINK = 40, 0.95
_INSIDE = 0.999


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
) -> Enriched:
    """The path with the change that tells most of a payload.

    Args:
        path: from rest to rest.
        constraints: about the path's start; their clearances are kept as far as the path itself keeps them.
        criterion: what is known besides the run; its tare is no motion of its own.
        distance, angle: of the payload frame at most [m, rad].
        seed: of the start; the same seed gives the same path.

    Raises:
        MotionError: no room for a change, a path with nothing to change, or one that passes a limit by itself.
    """
    arm = constraints.arm
    if path.n != arm.n:
        raise MotionError(f"the path {path.name!r} moves {path.n} joints: {arm.name} has {arm.n}")
    if not (distance >= 0 and angle >= 0 and distance + angle > 0):
        raise MotionError(f"a change of {distance} m and {angle} rad is asked for: expected room in one of them")
    constraints = _as_the_path(constraints, path)
    passed = [one for one in used(constraints, path) if one.share > 1.0 and one.what != "rest"]
    if passed:
        raise MotionError(
            f"the path {path.name!r} passes a limit by itself: {passed[0].text}; allow more, or change it"
        )
    stretches = moving_stretches(path)
    if not stretches:
        raise MotionError(
            f"the path {path.name!r} has no stretch of {_SHORTEST:g} s between stops: there is nothing to change"
        )
    track = Track(path, path.duration, stretches)
    tube = Tube(arm, track.base_at(track.sampled(_RATE).t, 0), distance, angle)
    reach = np.full(arm.n, min(_REACH, 3.0 * max(angle, distance / 0.3)))
    problem = Climb(constraints, criterion, [track], [reach], tube, _RATE)
    x = 0.3 * np.random.default_rng(seed).normal(size=problem.size)
    for iterations, weight in _STAGES:
        x = problem.climb(x, iterations, weight)[0]
    motion, far, turned, found = _held_back(constraints, path, track, problem.points(x)[0], distance, angle)
    before, after = problem.evaluated([path]).half_width, problem.evaluated([motion]).half_width
    return Enriched(motion, before, after, far, turned, found)


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
    """From, to [s] and control points of the stretches between stops that are long enough to be changed."""
    t = path.instants(200.0)
    moves = np.abs(path.velocity(t)).max(axis=1) > _STILL
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moves, [False]]).astype(int)))
    out = []
    for first, last in edges.reshape(-1, 2):
        begin, end = float(t[max(first - 1, 0)]), float(t[min(last, len(t) - 1)])
        if end - begin >= _SHORTEST:
            out.append((begin, end, max(3, round(_POINTS_PER_SECOND * (end - begin)))))
    return out


def _as_the_path(constraints: Constraints, path: Motion) -> Constraints:
    """The constraints, with clearances no larger than the path's own."""
    own = constraints.around.clearance(_poses(path)).min(axis=0)
    keep = np.minimum(constraints.around.keep, np.where(np.isfinite(own), own - 1e-3, np.inf))
    return replace(constraints, surroundings=replace(constraints.around, keep=tuple(keep.tolist())))


def _held_back(
    constraints: Constraints, path: Motion, track: Track, c: NDArray[np.float64], distance: float, angle: float
) -> tuple[PathMotion, float, float, list[Used]]:
    found: list[Used] = []
    given = poses(constraints.arm, path, RATE)
    for _ in range(_SHRINKS):
        changed = PathMotion.of(_Changed(track, c, path.name), _POINTS, f"{path.name}-enriched")
        far, turned = (float(x.max()) for x in away(given, poses(constraints.arm, changed, RATE)))
        over = max(far / distance if distance > 0 else 0.0, turned / angle if angle > 0 else 0.0)
        if over > _INSIDE:
            c = c * min(_SHRINK, _INSIDE / over)
            continue
        found = [one for one in used(constraints, changed) if one.what != "rest"]
        if found[0].share <= 1.0:
            return changed, far, turned, found
        c = c * _SHRINK
    what = found[0].text if found else "none stays within the tube"
    raise MotionError(f"no change of the path {path.name!r} keeps to the constraints: {what}")


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
