"""What a designed motion keeps to: the numbers of the promise, which design and check both read.

A share s of each limit: velocity, acceleration, jerk and torque stay below s times the limit; position stays within s
times the half range about the middle of the range. Torque is that of the worst payload of a range. Limits that the
maker does not give are assumed (`motion.random_fourier.filled_limits`: velocity is reached in 0.25 s, acceleration in
0.1 s), a range wider than a turn counts as it is, and no joint goes farther than `travel` from the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, payload_regressor
from armload.arms.limits import Limits
from armload.arms.units import heading, unit_of
from armload.errors import MotionError
from armload.excitation.payload_range import PayloadRange
from armload.excitation.surroundings import Surroundings
from armload.motion.random_fourier import filled_limits

SHARE = 0.8  # of each limit, as the shipped excitation keeps to
TRAVEL = 1.0  # [rad] the farthest a joint goes from the start, as of the shipped excitation
TOOL_SPEED = 1.5  # [m/s] of the payload frame: Franka's Cartesian limit is 1.7, a UR's safety setting 1.5
_MAY_BE_ASSUMED = ("acceleration", "jerk")
SHORTEST, LONGEST = 0.2, 60.0  # [s] of a designed motion


@dataclass(frozen=True, eq=False)
class Constraints:
    """What a motion from `start` (n,) [rad] and back must keep to.

    joints: (n,) which of them may move; those whose limits leave no room do not. share: of each limit. travel [rad];
    speed: of the payload frame [m/s]. payload: what may be mounted. surroundings: floor, boxes, what is held.
    path_uses: by quantity ("acceleration", "jerk"), what a path uses by itself (n,): where the maker gives no limit,
    that and the assumed one are allowed.

    Raises:
        MotionError: a number out of range, or a start that the constraints forbid, with the limit that stands in the
            way.
    """

    arm: Arm
    start: NDArray[np.float64]
    share: float = SHARE
    payload: PayloadRange | None = None
    surroundings: Surroundings | None = None
    travel: float = TRAVEL
    speed: float = TOOL_SPEED
    joints: NDArray[np.bool_] | None = None
    path_uses: dict[str, NDArray[np.float64]] | None = None

    def __post_init__(self) -> None:
        arm, n = self.arm, self.arm.n
        start = np.array(self.start, dtype=float)
        if start.shape == (n,) and not np.all(np.isfinite(start)):
            j = int(np.argmin(np.isfinite(start)))
            raise MotionError(f"the start has {start[j]} at {arm.joint_names[j]}: expected a finite position")
        if start.shape != (n,):
            raise MotionError(
                f"the start has {start.size} joint positions: {arm.name} has {n} joints; give {n} finite numbers: "
                f"{heading('position', arm.limits.slides)}"
            )
        for name, value, most in (("share", self.share, 1.0), ("travel", self.travel, np.inf)):
            if not (np.isfinite(value) and 0 < value <= most):
                raise MotionError(
                    f"{name} is {value}: expected a number above 0" + (", at most 1" if most == 1 else "")
                )
        if not self.speed > 0:
            raise MotionError(f"the tool speed limit is {self.speed} m/s: expected a number above 0")
        object.__setattr__(self, "start", start)
        if self.payload is None:
            object.__setattr__(self, "payload", PayloadRange.rated(arm))
        if self.surroundings is None:
            object.__setattr__(self, "surroundings", Surroundings(arm))
        moving = np.ones(n, bool) if self.joints is None else np.asarray(self.joints, dtype=bool)
        object.__setattr__(self, "joints", moving)
        if moving.shape != (n,) or not moving.any():
            raise MotionError(f"no joint of {arm.name} may move: name some of its {n} joints")
        self._check_start()
        if not len(self.moving):
            named = ", ".join(name for name, may in zip(arm.joint_names, moving, strict=True) if may)
            raise MotionError(
                f"no joint of {arm.name} can move: the limits of {named} leave no room; name one that they leave some"
            )

    @cached_property
    def low(self) -> NDArray[np.float64]:
        """Lowest positions (n,) of the promise [rad]."""
        return np.maximum(self._band[0], self.start - self.travel)

    @cached_property
    def high(self) -> NDArray[np.float64]:
        """Highest positions (n,) of the promise [rad]."""
        return np.minimum(self._band[1], self.start + self.travel)

    @cached_property
    def most(self) -> dict[str, NDArray[np.float64]]:
        """By quantity, the largest magnitude (n,) of velocity, acceleration, jerk and torque."""
        return {
            "velocity": self.share * self._limits.velocity,
            "acceleration": self._beside_path("acceleration", self.share * self._limits.acceleration),
            "jerk": self._beside_path("jerk", self.share * self._limits.jerk),
            "torque": self.share * self.arm.limits.effort,
        }

    def fastest(self, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        """The largest speed (N, n) at positions q (N, n) in the sense of velocities dq (N, n): less near the ends."""
        return self.share * self._limits.velocity_at(q, dq)

    def whose(self, what: str) -> list[str]:
        """Of each joint, what a limit is a share of, in words: its own limit, or one that is assumed."""
        if what not in _MAY_BE_ASSUMED:
            return ["its limit"] * self.arm.n
        assumed = "what is assumed, as its maker gives no limit"
        given = np.isfinite(getattr(self.arm.limits, what))
        wider = self._wider(what, self.share * getattr(self._limits, what))
        return [
            "its limit" if limit else f"{assumed}, beside what the path itself uses" if more else assumed
            for limit, more in zip(given, wider, strict=True)
        ]

    def _wider(self, what: str, most: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Of which joints (n,) an assumed limit is less than what the path uses by itself."""
        if self.path_uses is None:
            return np.zeros(self.arm.n, bool)
        return ~np.isfinite(getattr(self.arm.limits, what)) & (self.path_uses[what] > most)

    def _beside_path(self, what: str, most: NDArray[np.float64]) -> NDArray[np.float64]:
        return most if self.path_uses is None else np.where(self._wider(what, most), self.path_uses[what] + most, most)

    @cached_property
    def _limits(self) -> Limits:
        return filled_limits(self.arm.limits)

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Of the payload range (V, 10)."""
        assert self.payload is not None
        return self.payload.corners()

    @property
    def around(self) -> Surroundings:
        """The surroundings."""
        assert self.surroundings is not None
        return self.surroundings

    @property
    def moving(self) -> NDArray[np.intp]:
        """Which joints move: they may, and their limits leave them room."""
        assert self.joints is not None
        return np.flatnonzero(self.joints & (self.high > self.low))

    @cached_property
    def _band(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        limits = self.arm.limits
        low, high = limits.position_low, limits.position_high
        endless = ~(np.isfinite(low) & np.isfinite(high))
        middle = np.where(endless, 0.0, (np.where(endless, 0.0, low) + np.where(endless, 0.0, high)) / 2)
        half = np.where(endless, np.inf, self.share * (high - low) / 2)
        return middle - half, middle + half

    def _check_start(self) -> None:
        arm, (low, high), payload = self.arm, self._band, self.payload
        assert payload is not None
        for j in np.flatnonzero((self.start < low) | (self.start > high)):
            limits = arm.limits
            middle = (limits.position_low[j] + limits.position_high[j]) / 2
            unit = unit_of("position", limits.slides[j])
            half = limits.position_high[j] - middle
            needed = abs(self.start[j] - middle) / half if half > 0 else np.inf  # a joint that is locked
            raise MotionError(
                f"{arm.joint_names[j]} starts at {self.start[j]:.4g} {unit}, outside {self.share:g} of its range about "
                f"the middle, {low[j]:.4g} to {high[j]:.4g} {unit} (its limits are {limits.position_low[j]:.4g} and "
                f"{limits.position_high[j]:.4g}): start elsewhere{_or_share(needed)}"
                f"{limits.as_degrees(self.start)}"
            )
        bare, each = arm.torque(self.start), self._static()
        held = bare + each
        over = np.abs(held).max(axis=0) - self.most["torque"]
        j = int(np.argmax(over / np.where(np.isfinite(self.most["torque"]), self.most["torque"], 1.0)))
        if over[j] >= 0.0:
            unit = unit_of("torque", arm.limits.slides[j])
            needed = float((np.abs(held).max(axis=0) / arm.limits.effort).max())
            raise MotionError(
                f"at the start {arm.joint_names[j]} needs {np.abs(held[:, j]).max():.4g} {unit} to hold the worst "
                f"payload of the range (up to {payload.mass:g} kg), more than {self.most['torque'][j]:.4g} {unit}, "
                f"{self.share:g} of its limit: start elsewhere{_or_share(needed)}, or give the payload's mass "
                f"({self._holds(bare, each)})"
            )
        self.around.check_start(self.start)

    def _holds(self, bare: NDArray[np.float64], each: NDArray[np.float64]) -> str:
        """How much of the heaviest payload the start can hold: a torque grows with the mass."""
        assert self.payload is not None
        room = np.maximum(self.most["torque"] - np.sign(each) * bare, 0.0)
        share = float((room / np.maximum(np.abs(each), 1e-9)).min())
        return f"{share * self.payload.mass:.3g} kg can be held"

    def _static(self) -> NDArray[np.float64]:
        rest = np.zeros((1, self.arm.n))
        Y = payload_regressor(self.arm.frame_motion(self.start[None]), rest, rest)[0]  # (n, 10)
        return self.corners @ Y.T


def _or_share(needed: float) -> str:
    """A larger share as a way out, where one is enough for the start; a motion needs some more."""
    rounded = np.ceil(100.0 * needed) / 100.0
    return f", allow a larger share (more than {rounded:g})" if rounded < 1.0 else ""
