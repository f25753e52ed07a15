"""Random motions an arm may run: the variety a learned model needs so that it is not tied to one trajectory."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm, Limits, facts_of
from armload.errors import MotionError
from armload.motion.check import check_motion, rated_load
from armload.motion.collision import KEPT_FLOOR, KEPT_SELF, POSE_FLOOR, POSE_SELF, CapsuleArm, capsule_arm
from armload.motion.fourier import FourierMotion
from armload.motion.motion_file import shipped_motion
from armload.runtime.real_numbers import own_reals

_SPEED = 1.5  # [rad/s] velocity limit of an arm whose maker gives none
_TO_SPEED = 0.25  # [s] in which it reaches its velocity limit, where no acceleration limit is given
_TO_PUSH = 0.10  # [s] in which it reaches its acceleration limit, where no jerk limit is given
_SHARE = 0.7  # of each limit
_TRAVEL = (0.5, 1.2)  # [rad] the farthest a joint goes from its mean, drawn per joint
_POSES = 128  # mean poses tried
_TRIALS = 24  # of them that are followed up with a motion
_FACTORS = 0.8 ** np.arange(9)  # by which all amplitudes are reduced until nothing touches
_ENOUGH = 0.6  # a motion reduced no further than this is taken at once; otherwise the least reduced one


def excitation(arm: Arm, seed: int = 0) -> FourierMotion:
    """The shipped motion that was designed for the arm; for an arm without one a random motion of this seed.

    >>> from armload.arms import arm
    >>> excitation(arm("panda")).name, excitation(arm("ur5e"), 2).name
    ('taie2024', 'random-ur5e-2')
    """
    facts = facts_of(arm)
    designed = None if facts is None else facts.excitation
    return random_motion(arm, seed) if designed is None else shipped_motion(designed)


def random_motion(
    arm: Arm,
    seed: int,
    *,
    duration: float = 6.0,
    harmonics: int = 5,
    floor: float | None = 0.0,
    around: ArrayLike | None = None,
) -> FourierMotion:
    """A random Fourier motion, from rest to rest, that the arm may run with its rated payload.

    A clear mean pose is drawn, then coefficients that fall with the harmonic; each joint is scaled to a share of its
    limits, and all of them down together until `check_motion` is content.

    >>> from armload.arms import arm
    >>> motion = random_motion(arm("ur10e"), seed=1)
    >>> motion.name, motion.duration, check_motion(arm("ur10e"), motion).ok
    ('random-ur10e-1', 6.0, True)

    Args:
        arm: any arm; limits its maker does not give are assumed (velocity reached in 0.25 s).
        seed: the same seed gives the same motion.
        duration: T [s].
        harmonics: number of harmonics K, at least 2 (a single one cannot start at rest).
        floor: height of the floor in the base's frame [m]; None: there is none.
        around: mean pose (n,) [rad], as of an arm that works in one place; None: a clear one is drawn.

    Raises:
        MotionError: fewer than 2 harmonics, a duration that is not positive, a mean pose of another arm, or no clear
            pose found.
    """
    if harmonics < 2:
        raise MotionError(f"{harmonics} harmonic(s) asked for: expected at least 2, a single one cannot start at rest")
    if not (np.isfinite(duration) and duration > 0):
        raise MotionError(f"a motion of {duration} s asked for: expected a positive number of seconds")
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise MotionError(f"seed is {seed!r}: expected a whole number of 0 or more")
    rng = np.random.default_rng(seed)
    limits, model, load = filled_limits(arm.limits), capsule_arm(arm), rated_load(arm)
    best: tuple[float, FourierMotion] | None = None
    k = np.arange(1.0, harmonics + 1.0)
    if around is None:
        poses = clear_poses(arm, model, rng, floor, _POSES, POSE_FLOOR, POSE_SELF)[:_TRIALS]
    else:
        poses = np.tile(own_reals(around, "the mean pose", MotionError), (_TRIALS, 1))
        if poses.shape != (_TRIALS, arm.n):
            raise MotionError(f"the mean pose has shape {poses.shape[1:]}: expected ({arm.n},)")
    for pose in poses:
        sine, cosine = rng.normal(size=(2, arm.n, harmonics)) / k
        travel = rng.uniform(*_TRAVEL, size=arm.n)
        motion = FourierMotion(pose, sine, cosine, duration, f"random-{arm.name}-{seed}", f"random_motion, seed {seed}")
        motion = _within(motion.smooth(), limits, travel)
        for factor in _FACTORS:
            if best is not None and factor <= best[0]:
                break
            trial = motion.scaled(factor)
            clear = model.clearance(trial(np.linspace(0.0, duration, 100))[0], floor)
            if clear.floor.min() < KEPT_FLOOR or clear.self.min() < KEPT_SELF:
                continue
            if check_motion(arm, trial, load, floor=floor).ok:
                best = factor, trial
                break
        if best is not None and best[0] >= _ENOUGH:
            break
    if best is None:
        raise MotionError(
            f"no random motion of {arm.name} found that stays clear of the floor and of itself and below its torque "
            f"limits with the rated payload (seed {seed}): try another seed, or floor=None if its base does not stand "
            "on the floor"
        )
    return best[1]


def filled_limits(limits: Limits) -> Limits:
    """The limits with an assumed number wherever the maker gives none; joints that turn stay within one turn."""
    low, high = limits.position_low, limits.position_high
    rail = limits.slides & np.isfinite(low) & np.isfinite(high)  # which may begin anywhere
    velocity = np.where(np.isfinite(limits.velocity), limits.velocity, _SPEED)
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, velocity / _TO_SPEED)
    jerk = np.where(np.isfinite(limits.jerk), limits.jerk, acceleration / _TO_PUSH)
    return Limits(
        np.where(rail, low, np.maximum(low, -np.pi)),
        np.where(rail, high, np.minimum(high, np.pi)),
        velocity,
        limits.effort,
        acceleration,
        jerk,
        limits.slides,
        limits.ends,
    )


def clear_poses(
    arm: Arm,
    model: CapsuleArm,
    rng: np.random.Generator,
    floor: float | None,
    count: int,
    floor_clearance: float,
    self_clearance: float,
) -> NDArray[np.float64]:
    """Those of `count` random poses (P, n) in the middle of the range that are clear and can hold the rated payload."""
    limits = filled_limits(arm.limits)
    middle, half = (limits.position_low + limits.position_high) / 2, (limits.position_high - limits.position_low) / 2
    poses = middle + 0.7 * half * rng.uniform(-1.0, 1.0, size=(count, arm.n))
    clear = model.clearance(poses, floor)
    load = rated_load(arm)
    held = np.abs((arm if load is None else arm.with_payload(load)).torque(poses))
    apart = (clear.floor >= floor_clearance) & (clear.self >= self_clearance)
    return poses[apart & np.all(held <= _SHARE * limits.effort, axis=1)]


def _within(motion: FourierMotion, limits: Limits, travel: NDArray[np.float64]) -> FourierMotion:
    """Each joint scaled so that it uses its travel or its share of a limit, whichever comes first."""
    t = np.linspace(0.0, motion.duration, 301)
    q, dq, ddq = motion(t)
    room = _SHARE * np.minimum(motion.offset - limits.position_low, limits.position_high - motion.offset)
    reach = [
        np.minimum(travel, room) / np.abs(q - motion.offset).max(axis=0),
        _SHARE * limits.velocity / np.abs(dq).max(axis=0),
        _SHARE * limits.acceleration / np.abs(ddq).max(axis=0),
        _SHARE * limits.jerk / np.abs(motion.jerk(t)).max(axis=0),
    ]
    return motion.scaled(np.min(reach, axis=0))
