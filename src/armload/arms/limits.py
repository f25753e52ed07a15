"""What an arm's joints may do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray


class VelocityEnds(NamedTuple):
    """Towards an end of its range a joint may go at most at √(slope·(end − q)) − reserve; each an array (n,)."""

    low: NDArray[np.float64]  # [rad]
    high: NDArray[np.float64]  # [rad]
    slope: NDArray[np.float64]  # [rad/s²]
    reserve: NDArray[np.float64]  # [rad/s]


@dataclass(frozen=True)
class Limits:
    """What the joints may do; each an array (n,). Acceleration and jerk are infinite where the maker gives none.

    slides: which joints slide along an axis: m and N take the place of rad and N·m. ends: less velocity near the ends
    of the range; None: the same everywhere.
    """

    position_low: NDArray[np.float64]  # [rad]
    position_high: NDArray[np.float64]  # [rad]
    velocity: NDArray[np.float64]  # [rad/s]
    effort: NDArray[np.float64]  # [N·m]
    acceleration: NDArray[np.float64]  # [rad/s²]
    jerk: NDArray[np.float64]  # [rad/s³]
    slides: NDArray[np.bool_]
    ends: VelocityEnds | None = None

    @property
    def middle(self) -> NDArray[np.float64]:
        """The middle of each joint's range (n,) [rad, m]; the position nearest to 0 where that has no two ends."""
        ends = np.stack([self.position_low, self.position_high])
        middle = np.where(np.isfinite(ends).all(axis=0), ends, 0.0).mean(axis=0)
        return np.clip(middle, *ends)

    def velocity_at(self, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        """The largest speed (N, n) [rad/s] allowed at positions q (N, n) in the sense of velocities dq (N, n)."""
        most = np.broadcast_to(self.velocity, np.shape(q))
        if self.ends is None:
            return most
        low, high, slope, reserve = self.ends
        left = np.where(np.asarray(dq) < 0.0, q - low, high - q)  # to the end that it moves to
        return np.clip(np.sqrt(slope * np.maximum(left, 0.0)) - reserve, 0.0, most)

    def as_degrees(self, q: ArrayLike) -> str:
        """A question to whoever named a pose (n,) [rad] that is beyond the limits, and would be within them in degrees.

        Empty where there is nothing to ask.
        """

        def within(pose: NDArray[np.float64]) -> bool:
            return bool(np.all((self.position_low <= pose) & (pose <= self.position_high)))

        pose = np.asarray(q, dtype=float)
        turned = np.where(self.slides, pose, np.deg2rad(pose))
        return "; positions are in rad: are these degrees?" if not within(pose) and within(turned) else ""

    @classmethod
    def of(
        cls,
        model: pin.Model,
        acceleration: Sequence[float] | None,
        jerk: Sequence[float] | None,
        ends: Sequence[Sequence[float]] | None = None,
    ) -> Limits:
        """Those of a URDF's model, and of the arm's sheet what a URDF cannot hold; its further joints are left."""
        n = model.nv
        endless = np.full(n, np.inf)
        wide = model.upperPositionLimit >= 1e3
        return cls(
            np.where(wide, -np.inf, model.lowerPositionLimit),
            np.where(wide, np.inf, model.upperPositionLimit),
            np.where(model.upperVelocityLimit > 0, model.upperVelocityLimit, np.inf),
            np.where(model.upperEffortLimit > 0, model.upperEffortLimit, np.inf),
            endless if acceleration is None else np.array(acceleration[:n]),
            endless if jerk is None else np.array(jerk[:n]),
            np.array([joint.shortname().startswith("JointModelP") for joint in list(model.joints)[1 : n + 1]]),
            None if ends is None else VelocityEnds(*(np.array(row[:n]) for row in ends)),
        )
