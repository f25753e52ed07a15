"""What stands around a robot, and how far its arm, with what it holds, stays away from it.

Links are capsules (`motion.collision`); the floor is a plane, obstacles are boxes along the axes of the base, what is
held is a ball 0.1 m beyond the payload frame or a box that begins at it. Distances are coal's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, Capsule, NearestCapsules
from armload.arms.capsules import Box
from armload.errors import MotionError
from armload.motion.collision import KEPT_FLOOR, KEPT_SELF, PAYLOAD_RADIUS, CapsuleArm, capsule_arm

_BOXES = 0.05  # [m] clearance that designed motions keep
_OF_START = 0.5  # of the start's clearance, where that is less


class Obstacle(NamedTuple):
    """A box along the axes of the base: its centre and its edges [m]."""

    centre: tuple[float, float, float]
    edges: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Floor, boxes and what is held.

    floor: height in the base's frame [m]; None: there is none. boxes: obstacles. held: radius of a ball [m], or the
    edges (3,) of a box that begins at the payload frame and lies along its z axis; 0: nothing. keep: clearances to keep
    from the floor, itself and boxes [m]. of_start: the share that is kept of what the start has, where that is less.

    Raises:
        MotionError: an edge or a radius that is not a length.
    """

    arm: Arm
    floor: float | None = 0.0
    boxes: tuple[Obstacle, ...] = ()
    held: float | tuple[float, float, float] = PAYLOAD_RADIUS
    keep: tuple[float, float, float] = (KEPT_FLOOR, KEPT_SELF, _BOXES)
    of_start: float = _OF_START

    def __post_init__(self) -> None:
        for box in self.boxes:
            if not np.all(np.isfinite([*box.centre, *box.edges])) or min(box.edges) <= 0:
                raise MotionError(
                    f"the box at {box.centre} has edges {box.edges}: expected finite lengths above 0 in m"
                )
        edges = self.held if isinstance(self.held, tuple) else (self.held,)
        if not np.all(np.isfinite(edges)) or min(edges) < 0 or (len(edges) == 3 and min(edges) == 0):
            raise MotionError(f"the held body has the size {self.held}: expected a radius or three edges in m")

    def clearance(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance to the floor, of the arm to itself and to the boxes (N, 3) [m] at poses q (N, n)."""
        height = self._floor(q)[0] - (0.0 if self.floor is None else self.floor)
        return np.stack([height, self._itself(q)[0], self._obstacles(q)[0]], axis=1)

    def kept(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """The clearances (3,) [m] that a motion from this pose keeps."""
        return np.minimum(self.keep, self.of_start * self.clearance(start[None])[0])

    def check_start(self, start: NDArray[np.float64]) -> None:
        """See that nothing touches at the start.

        Raises:
            MotionError: something does; it says what.
        """
        found = self.clearance(start[None])[0]
        k = int(np.argmin(found))
        if found[k] > 0.0:
            return
        what = self.nearest(start[None], k)
        raise MotionError(
            f"at the start {what} ({found[k]:.3f} m between their capsules): start elsewhere, or say what is there "
            "(--floor, --box and, of `armload motion`, --held)"
        )

    def nearest(self, q: NDArray[np.float64], kind: int) -> str:
        """What touches, or nearly, at the first of the poses q (N, n), in words."""
        names = self._body.names
        if kind == 0:
            part = int(self._body.above[self._floor(q)[1][0]])
            return f"{names[part]} is at the floor"
        if kind == 1:
            i, j = self._body.pairs[self._itself(q)[1][0]]
            return f"{names[i]} is at {names[j]}"
        i, j = self._obstacle_pairs[int(self._obstacles(q)[1][0])]
        return f"{names[i]} is at box {j - len(names) + 1}"

    @cached_property
    def _body(self) -> CapsuleArm:
        radius = max(self.held) / 2 if isinstance(self.held, tuple) else self.held
        return capsule_arm(self.arm, radius)

    @cached_property
    def _solids(self) -> list[Capsule | Box]:
        body = self._body
        parts = zip(body.link, body.start, body.end, body.radius, strict=True)
        out: list[Capsule | Box] = [Capsule(int(k), tuple(a), tuple(b), float(r)) for k, a, b, r in parts]  # type: ignore[arg-type]
        if isinstance(self.held, tuple):
            zero = np.zeros((1, self.arm.n))
            R, p = self.arm.link_poses(zero)
            F, at = self.arm.frame_pose(zero)
            axes = R[0, -1].T @ F[0]
            centre = R[0, -1].T @ (at[0] - p[0, -1]) + axes[:, 2] * self.held[2] / 2
            out[-1] = Box(self.arm.n, tuple(centre.tolist()), self.held, axes)
        return out

    @cached_property
    def _floor(self) -> NearestCapsules:
        above = [] if self.floor is None else [(int(part), -1) for part in self._body.above]
        return NearestCapsules(self.arm, self._solids, above)

    @cached_property
    def _itself(self) -> NearestCapsules:
        return NearestCapsules(self.arm, self._solids, [(int(i), int(j)) for i, j in self._body.pairs])

    @cached_property
    def _obstacle_pairs(self) -> list[tuple[int, int]]:
        moving = np.flatnonzero(self._body.link > 0)
        return [(int(i), len(self._solids) + k) for k in range(len(self.boxes)) for i in moving]

    @cached_property
    def _obstacles(self) -> NearestCapsules:
        boxes = [Box(0, box.centre, box.edges) for box in self.boxes]
        return NearestCapsules(self.arm, [*self._solids, *boxes], self._obstacle_pairs)
