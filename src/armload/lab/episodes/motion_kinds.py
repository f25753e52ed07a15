"""Random motions of many kinds that an arm may run: within its limits, clear of the floor and of itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, Limits
from armload.errors import MotionError
from armload.inertia import InertialParameters
from armload.motion import FourierMotion, Motion, check_motion, rated_load
from armload.motion.blended import BlendedMotion
from armload.motion.collision import KEPT_FLOOR, KEPT_SELF, POSE_FLOOR, POSE_SELF, CapsuleArm, capsule_arm
from armload.motion.point_to_point import PointToPoint
from armload.motion.random_fourier import clear_poses, filled_limits

_POSES = 512  # poses tried for the list of clear ones
_TRIALS = 40  # motions tried until one may be run
_FACTORS = 0.8 ** np.arange(7)  # by which all amplitudes are reduced until nothing touches
BLEND = 0.5  # [s]
KINDS = ("reference", "long", "slow", "fast", "harmonics", "point-to-point", "pick-and-place", "partial")


@dataclass(frozen=True, eq=False)
class MotionSource:
    """Draws motions for one arm; what does not depend on the draw is made once.

    arm: any arm; limits its maker does not give are assumed (`filled_limits`).
    floor: height of the floor in the base's frame [m]; None: there is none.
    """

    arm: Arm
    floor: float | None = 0.0

    def fourier(
        self,
        rng: np.random.Generator,
        duration: float,
        *,
        harmonics: int = 5,
        period: float | None = None,
        share: float = 0.7,
        travel: tuple[float, float] = (0.5, 1.2),
        moving: NDArray[np.bool_] | None = None,
        around: NDArray[np.float64] | None = None,
        near: float = 0.0,
        name: str = "fourier",
    ) -> Motion:
        """A Fourier motion about a clear pose, from rest with a blend-in of 0.5 s, and back to rest after `duration`.

        Coefficients fall with the harmonic; each joint is scaled to its travel or to a share of its limits, and all of
        them down together until the arm may run it with its rated payload.

        Args:
            duration: of the motion at speed [s]; the blend-out comes after it.
            harmonics, period: K and T [s] of the excitation; T None: `duration`.
            share: of each limit that may be used.
            travel: how far a joint may go from its mean, drawn per joint [rad].
            moving: joints (n,) that move; None: all.
            around: pose (n,) near which to move, as of an arm that works in one place [rad]; None: anywhere clear.
            near: how near, standard deviation of each joint's mean [rad].

        Raises:
            MotionError: nothing found that the arm may run.
        """
        n, k = self.arm.n, np.arange(1.0, harmonics + 1.0)
        for _ in range(_TRIALS):
            pose = self._place(rng, around, near)
            sine, cosine = rng.normal(size=(2, n, harmonics)) / k
            reach = rng.uniform(*travel, size=n)
            if moving is not None:
                reach = np.where(moving, reach, 0.0)
            whole = duration if period is None else period
            inner = FourierMotion(pose, sine, cosine, whole, name, f"random, about a clear pose, {harmonics} harmonics")
            inner = inner.scaled(self._scale(BlendedMotion(inner, duration + BLEND, BLEND), pose, share, reach))
            for factor in _FACTORS:
                motion = BlendedMotion(inner.scaled(factor), duration + BLEND, BLEND)
                if self.may_run(motion):
                    return motion
        raise self._none()

    def stops(
        self,
        rng: np.random.Generator,
        duration: float,
        *,
        share: float = 0.7,
        travel: tuple[float, float] = (0.3, 1.2),
        moving: NDArray[np.bool_] | None = None,
        stations: int | None = None,
        around: NDArray[np.float64] | None = None,
        near: float = 0.0,
        name: str = "point-to-point",
    ) -> Motion:
        """From pose to pose with stops about a clear pose, for `duration` and until the arm has stopped.

        Args:
            share, travel, moving, around, near: as in `fourier`.
            stations: None: every pose is another; otherwise the arm goes from station to station and around again, at
                each of them down from above, and up again.

        Raises:
            MotionError: nothing found that the arm may run.
        """
        n = self.arm.n
        for _ in range(_TRIALS):
            centre = self._place(rng, around, near)
            reach = rng.uniform(*travel, size=n)
            room = 0.7 * np.minimum(centre - self.limits.position_low, self.limits.position_high - centre)
            reach = np.minimum(reach, room) * (1.0 if moving is None else moving)
            ramp, pace = rng.uniform(0.25, 0.5), share * rng.uniform(0.4, 1.0)
            poses, starts, ends = [], [], []
            cycle = [] if stations is None else _cycle(rng, stations, n)
            t = rng.uniform(0.0, 0.4)
            while not ends or t < duration:
                if cycle:
                    poses.append(reach * cycle[len(poses) % len(cycle)])
                else:
                    poses.append(reach * rng.uniform(-1.0, 1.0, size=n))
                if len(poses) > 1:
                    starts.append(t)
                    ends.append(t + self._lasting(np.abs(poses[-1] - poses[-2]), ramp, pace))
                    t = ends[-1] + rng.choice([0.0, rng.uniform(0.05, 1.0)])
            for factor in _FACTORS:
                motion = PointToPoint(centre + factor * np.array(poses), np.array(starts), np.array(ends), ramp, name)
                if self.may_run(motion):
                    return motion
        raise self._none()

    def draw(
        self,
        kind: str,
        rng: np.random.Generator,
        duration: float,
        name: str = "",
        around: NDArray[np.float64] | None = None,
        near: float = 0.0,
    ) -> Motion:
        """A motion of a kind (one of `KINDS`) for `duration` [s]; the same generator gives the same motion.

        Raises:
            MotionError: no such kind, or nothing found that the arm may run.
        """
        if kind not in KINDS:
            raise MotionError(f"no kind of motion is called {kind!r}: expected one of {', '.join(KINDS)}")
        name = name or f"{kind}-{self.arm.name}"
        fourier = partial(self.fourier, rng, duration, around=around, near=near, name=name)
        stops = partial(self.stops, rng, duration, around=around, near=near, name=name)
        if kind == "reference":
            return fourier()
        if kind == "long":
            return fourier(harmonics=10)
        if kind == "slow":
            return fourier(share=rng.uniform(0.1, 0.35))
        if kind == "fast":
            return fourier(share=0.92, travel=(0.6, 1.8))
        if kind == "harmonics":
            period = float(np.exp(rng.uniform(np.log(3.0), np.log(15.0))))
            return fourier(harmonics=int(rng.integers(1, 11)), period=period)
        if kind == "point-to-point":
            return stops(share=rng.uniform(0.3, 0.9))
        if kind == "pick-and-place":
            return stops(share=rng.uniform(0.3, 0.9), stations=int(rng.integers(2, 4)))
        moving = rng.permutation(self.arm.n) < rng.integers(1, max(2, self.arm.n))  # partial: one at least, not all
        return fourier(moving=moving) if rng.random() < 0.5 else stops(moving=moving)

    def centre(self, motion: Motion) -> NDArray[np.float64]:
        """The pose (n,) a motion moves about: the middle between the ends of each joint's way [rad]."""
        q = motion.position(np.linspace(0.0, motion.duration, 200))
        return (q.min(axis=0) + q.max(axis=0)) / 2

    def may_run(self, motion: Motion) -> bool:
        """Whether the arm may run the motion with its rated payload, with some clearance."""
        ticks = np.linspace(0.0, motion.duration, max(50, round(12 * motion.duration)))
        clear = self.model.clearance(motion(ticks)[0], self.floor)
        if clear.floor.min() < KEPT_FLOOR or clear.self.min() < KEPT_SELF:
            return False
        return check_motion(self.arm, motion, self.load, floor=self.floor, rate=100.0, collision_rate=25.0).ok

    @cached_property
    def model(self) -> CapsuleArm:
        """The arm as capsules."""
        return capsule_arm(self.arm)

    @cached_property
    def load(self) -> InertialParameters | None:
        """The maker's rated payload."""
        return rated_load(self.arm)

    @cached_property
    def limits(self) -> Limits:
        """The arm's limits, all finite but the efforts."""
        return filled_limits(self.arm.limits)

    @cached_property
    def poses(self) -> NDArray[np.float64]:
        """Clear poses (P, n) from the middle of the range that the arm can hold with its rated payload."""
        rng = np.random.default_rng(0)
        poses = clear_poses(self.arm, self.model, rng, self.floor, _POSES, POSE_FLOOR, POSE_SELF)
        if not len(poses):
            raise MotionError(
                f"no pose of {self.arm.name} found that is clear of the floor and of itself and within its torque "
                "limits with the rated payload: give floor=None if its base does not stand on the floor"
            )
        return poses

    def _place(self, rng: np.random.Generator, around: NDArray[np.float64] | None, near: float) -> NDArray[np.float64]:
        """A mean pose (n,): a clear one, or one near another, not in the outermost tenth of a joint's range."""
        if around is None:
            return self.poses[rng.integers(len(self.poses))]
        low, high = self.limits.position_low, self.limits.position_high
        margin = 0.1 * (high - low)
        return np.clip(around + near * rng.normal(size=self.arm.n), low + margin, high - margin)

    def _none(self) -> MotionError:
        return MotionError(
            f"no random motion of {self.arm.name} found that stays clear of the floor and of itself and below its "
            "torque limits with the rated payload: try another seed, or floor=None if its base does not stand on the "
            "floor"
        )

    def _lasting(self, way: NDArray[np.float64], ramp: float, share: float) -> float:
        """How long a straight segment of so much (n,) [rad] takes within a share of each limit [s]."""
        top = 1.0 / (1.0 - ramp)  # of the trapezoid, over a constant speed; then its first two derivatives
        return max(
            0.2,
            float(np.max(way * top / (share * self.limits.velocity))),
            float(np.max(np.sqrt(way * top * 1.5 / ramp / (share * self.limits.acceleration)))),
            float(np.max(np.cbrt(way * top * 6.0 / ramp**2 / (share * self.limits.jerk)))),
        )

    def _scale(
        self, motion: Motion, pose: NDArray[np.float64], share: float, travel: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Factor (n,) by which each joint may be scaled about the pose."""
        t = np.linspace(0.0, motion.duration, max(301, round(50 * motion.duration)))
        q, dq, ddq = motion(t)
        room = share * np.minimum(pose - self.limits.position_low, self.limits.position_high - pose)
        used = [
            (np.abs(q - pose), np.minimum(travel, room)),
            (np.abs(dq), share * self.limits.velocity),
            (np.abs(ddq), share * self.limits.acceleration),
            (np.abs(motion.jerk(t)), share * self.limits.jerk),
        ]
        # a joint that one harmonic leaves at rest needs no scaling
        return np.min([allowed / np.maximum(value.max(axis=0), 1e-9) for value, allowed in used], axis=0)


def _cycle(rng: np.random.Generator, stations: int, n: int) -> list[NDArray[np.float64]]:
    """Poses of one round, each within ±1 of the centre: above a station, at it, above it again, and on."""
    out = []
    for _ in range(stations):
        there = rng.uniform(-0.8, 0.8, size=n)
        above = there + 0.2 * rng.uniform(-1.0, 1.0, size=n)
        out += [above, there, above]
    return out
