"""The motion that tells most of a payload in a given time, about a given pose.

    maximise J(c) = −log det B(c)   subject to the constraints,   q(t) = q_0 + Σ_k c_k·B_k(t)

c are the control points of quintic splines (`motion.spline`), at rest at both ends by construction, J the information
of `criterion.py`, the constraints those of `constraints.py`. They enter as a quadratic penalty whose weight rises from
stage to stage; L-BFGS follows the exact gradient from several seeded starts, the best of which goes on. What is found
is checked at 1 kHz by other code (`verification.py`) and drawn together about the start pose until it passes: the pose
itself keeps to every constraint, so that such a motion exists. One that this would make much smaller, as a smaller
motion need not be farther from what it nearly touches, is designed on first, with a heavier penalty and more clearance.

Sources: Swevers et al., T-RO 1997 (D-optimal excitation); Liu & Nocedal 1989 (L-BFGS); Nocedal & Wright, Numerical
Optimization, ch. 17 (quadratic penalties).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from armload.arms.units import unit_of
from armload.errors import MotionError
from armload.excitation.constraints import LONGEST, SHORTEST, Constraints
from armload.excitation.criterion import Criterion, CriterionValue
from armload.excitation.penalty import Penalty
from armload.excitation.promise import promised
from armload.excitation.track import Track
from armload.excitation.tube import Tube
from armload.excitation.verification import Used, used
from armload.motion import Motion
from armload.motion.spline import SplineMotion

# control points: motions up to about 2 Hz, below what joints' elasticity and the lag take away
_POINTS_PER_SECOND = 4.0
_FEWEST, _MOST = 4, 48
_RATE = 50.0  # [Hz] of the samples while designing: the bound differs by less than 0.1 in J from that at 200 Hz
STARTS = 4  # seeded
# iterations of L-BFGS and weight of the penalty: of each start, then of the best one
STAGES = ((12, 30.0), (30, 200.0), (40, 2000.0))
# what must be left of a motion's size once it is drawn together: else the design goes on, a fifth longer, with so many
# iterations, a penalty of such a weight, and a clearance [m] beyond what is kept, as a penalty leaves a millimetre to
# it (test_a_clearance_a_millimetre_short_does_not_cost_most_of_the_motion)
MUCH_SMALLER = 0.9
AGAIN, _SPARE = (20, 20_000.0), 0.002
_SHRINKS, _SHRINK = 60, 0.97  # how often, and by what at least, a motion is drawn together
INSIDE = 0.999  # of each limit that a finished motion may use: room for the rounding of exports
_STIRRING = 0.02  # [rad] a motion that goes no farther tells nothing


@dataclass(frozen=True, eq=False)
class Design:
    """A designed motion, what it tells, and what it uses of its limits.

    motion: the loaded run. empty: the empty run that goes with it; None: it is the loaded run's own motion, or none.
    half_width: of the 95 % intervals (10,) at best. promised: what nine in ten arms stay within (`promise.py`).
    used: of each limit, the most first. evaluations: of the gradient.
    """

    motion: SplineMotion
    empty: SplineMotion | None
    half_width: NDArray[np.float64]
    promised: NDArray[np.float64]
    information: float
    used: list[Used]
    evaluations: int


def design_motion(
    constraints: Constraints,
    criterion: Criterion,
    time: float,
    *,
    tare_time: float | None = None,
    seed: int = 0,
    name: str = "designed",
    starts: int = STARTS,
    stages: Sequence[tuple[int, float]] = STAGES,
) -> Design:
    """The motion of `time` seconds, and its own empty run of `tare_time`, that tell most of a payload.

    Args:
        constraints: what is allowed, and the pose.
        criterion: what is wanted; with a tare of its "own" exactly where `tare_time` is given.
        time: of the loaded run [s].
        tare_time: of the empty run [s].
        seed: of the starts; the same seed gives the same motion.
        starts, stages: how long it looks, as the constants of the same names.
        name: of the motion; the empty run's ends in "-empty".

    Raises:
        MotionError: a time out of range, or no motion that keeps to the constraints, with the limit in the way.
    """
    times = [time] if tare_time is None else [time, tare_time]
    for t in times:
        if not SHORTEST <= t <= LONGEST:
            raise MotionError(f"a motion of {t:g} s asked for: expected {SHORTEST:g} to {LONGEST:g} s")
    if len(times) != criterion.motions:
        raise MotionError("an empty run of its own is designed where its time is given, and only there")
    problem = about_a_pose(constraints, criterion, times)
    rng = np.random.default_rng(seed)
    (few, light), *later = stages
    found = [problem.climb(0.5 * rng.normal(size=problem.size), few, light) for _ in range(starts)]
    x = max(found, key=lambda one: one[1])[0]
    for iterations, weight in later:
        x = problem.climb(x, iterations, weight)[0]
    first = problem.motions(x, name)
    motions = [_drawn_together(constraints, motion) for motion in first]
    if any(_size(after) < MUCH_SMALLER * _size(before) for after, before in zip(motions, first, strict=True)):
        x = about_a_pose(constraints, criterion, times, _SPARE).climb(x, *AGAIN)[0]
        again = [_drawn_together(constraints, motion) for motion in problem.motions(x, name)]
        motions = max(motions, again, key=lambda found: (_pass(constraints, found), problem.evaluated(found).value))
    for motion in motions:
        _check_worth(constraints, motion)
    reached = problem.evaluated(motions)
    assert constraints.payload is not None
    return Design(
        motions[0],
        motions[1] if len(motions) > 1 else None,
        reached.half_width,
        promised(criterion, reached.half_width, constraints.payload),
        reached.value,
        used(constraints, motions[0]),
        problem.evaluations,
    )


class Climb:
    """J − weight·P and its gradient, as a function of the scaled control points of all tracks together."""

    def __init__(
        self,
        constraints: Constraints,
        criterion: Criterion,
        tracks: Sequence[Track],
        reach: Sequence[NDArray[np.float64]],
        tube: Tube | None = None,
        rate: float = _RATE,
        spare: float = 0.0,
    ) -> None:
        self.constraints, self.criterion, self.tracks = constraints, criterion, tracks
        self.penalty, self.tube = Penalty(constraints, spare), tube
        self.evaluations = 0
        self.samples = [track.sampled(rate) for track in tracks]
        self.scale = [each[constraints.moving] for each in reach]
        self.size = sum(track.count * len(constraints.moving) for track in tracks)

    def points(self, x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Control points (n, K) of each track."""
        out, first, moving = [], 0, self.constraints.moving
        for track, scale in zip(self.tracks, self.scale, strict=True):
            c = np.zeros((self.constraints.arm.n, track.count))
            last = first + track.count * len(moving)
            c[moving] = x[first:last].reshape(len(moving), track.count) * scale[:, None]
            first = last
            out.append(c)
        return out

    def motions(self, x: NDArray[np.float64], name: str) -> list[SplineMotion]:
        """The loaded run about a pose, and its own empty run, if there is one."""
        start, names = self.constraints.start, (name, f"{name}-empty")
        parts = zip(self.points(x), self.tracks, names, strict=False)
        return [SplineMotion(start, c, track.lasting, label) for c, track, label in parts]

    def climb(self, x: NDArray[np.float64], iterations: int, weight: float) -> tuple[NDArray[np.float64], float]:
        """The control points after so many iterations, and what they reach."""
        options = {"maxiter": iterations, "maxcor": 20, "ftol": 1e-7}
        found = minimize(self.loss, x, args=(weight,), jac=True, method="L-BFGS-B", options=options)
        return found.x, -float(found.fun)

    def loss(self, x: NDArray[np.float64], weight: float) -> tuple[float, NDArray[np.float64]]:
        """weight·P − J and its gradient."""
        self.evaluations += 1
        model, controls = self.criterion.model, self.points(x)
        moved = [
            [b + B @ c.T for b, B in zip(s.base, s.basis, strict=True)]
            for s, c in zip(self.samples, controls, strict=True)
        ]
        rows = [model.forward(m[0], m[1], s.step) for m, s in zip(moved, self.samples, strict=True)]
        found = self.criterion(rows)
        total, out = -found.value, []
        for k, change in enumerate(found.changes):
            basis, (_, _, ddq, jerk) = self.samples[k].basis, moved[k]
            for part in (change.q, change.dq, change.momentum, change.drift):
                part *= -1.0
            beyond = self.penalty(rows[k], ddq, jerk, change, weight)
            total += weight * beyond.value
            if self.tube is not None:
                total += self.tube(moved[k][0], change, weight)
            q, dq = model.at_joints(rows[k], change)
            slope = basis[0].T @ q + basis[1].T @ dq + basis[2].T @ beyond.ddq + basis[3].T @ beyond.jerk  # (K, n)
            out.append((slope.T[self.constraints.moving] * self.scale[k][:, None]).ravel())
        return total, np.concatenate(out)

    def evaluated(self, motions: Sequence[Motion]) -> CriterionValue:
        """J and the bound of finished motions."""
        rows = []
        for motion in motions:
            t = motion.instants(4.0 * _RATE)
            rows.append(self.criterion.model.forward(motion(t)[0], motion.velocity(t), t[1]))
        return self.criterion(rows)


def about_a_pose(constraints: Constraints, criterion: Criterion, times: Sequence[float], spare: float = 0.0) -> Climb:
    """The problem of motions from rest at the start, and back, with so much spare clearance [m]."""
    counts = [int(np.clip(round(_POINTS_PER_SECOND * t), _FEWEST, _MOST)) for t in times]
    tracks = [Track(constraints.start, t, ((0.0, t, count),)) for t, count in zip(times, counts, strict=True)]
    return Climb(constraints, criterion, tracks, [amplitude(constraints, t) for t in times], spare=spare)


def amplitude(constraints: Constraints, lasting: float) -> NDArray[np.float64]:
    """How far each joint (n,) gets within its limits on a swing of the whole time, 1.5 s at most."""
    c, omega = constraints, 2.0 * np.pi / min(lasting, 1.5)
    room = np.minimum(c.high - c.start, c.start - c.low) + 0.05
    reach = [room, c.most["velocity"] / omega, c.most["acceleration"] / omega**2, c.most["jerk"] / omega**3]
    return np.min(reach, axis=0)


def _pass(constraints: Constraints, motions: Sequence[Motion]) -> bool:
    return all(used(constraints, motion)[0].share <= INSIDE for motion in motions)


def _size(motion: SplineMotion) -> float:
    return float(np.abs(motion.control).max())


def _drawn_together(constraints: Constraints, motion: SplineMotion) -> SplineMotion:
    """The motion, its way from the start pose made smaller until it passes the check, or is as small as it gets."""
    for _ in range(_SHRINKS):
        worst = used(constraints, motion)[0]
        if worst.share <= INSIDE:
            break
        motion = replace(motion, control=motion.control * min(_SHRINK, 0.5 * (1.0 + INSIDE / worst.share)))
    return motion


def _check_worth(constraints: Constraints, motion: SplineMotion) -> None:
    """See that a motion passes the check and moves.

    Raises:
        MotionError: nothing worth running is left; it says which limit stands in the way.
    """
    worst = used(constraints, motion)[0]
    went = np.abs(motion(np.linspace(0.0, motion.duration, 200))[0] - constraints.start).max(axis=0)
    farthest, unit = float(went.max()), unit_of("position", bool(constraints.arm.limits.slides[went.argmax()]))
    if worst.share > INSIDE or farthest < _STIRRING:
        what = f"no joint goes farther than {farthest:.3f} {unit}, as " if farthest < _STIRRING else ""
        raise MotionError(
            f"no motion of {motion.duration:g} s from this pose keeps to the constraints: {what}{worst.text}; start "
            "elsewhere, allow a larger share or a longer time"
        )
