"""Clearance of an arm to the floor and to itself, with every link taken as capsules (segments with a radius).

Capsules are coarse on purpose: a motion must stay clear of them by a margin, not graze the true surface.

- an arm whose sheet gives its outer size (the Panda), and any arm whose joints sit as that one's do (an FR3, a Panda
  with other inertias): the sheet's capsules.
- any other arm: one capsule from each joint origin to the next, with a radius of half its length, but between 2 % and
  4 % of the sum of these lengths (UR10e: 0.08 m for the upper arm, 0.06 m for the wrist).
- what the arm holds: a ball of a given radius, centred 0.1 m beyond the payload frame along its z axis.
- base: the link that carries the first joint. What it is mounted on, and all else in the file, is not seen.
- floor: the plane z = 0 of the file's root, on which the base is mounted (for an arm on a wall or ceiling: that wall).

Neighbouring links share a joint and always touch, so they are not tested against each other; nor are links with so
little between them that they touch whenever the arm folds. No part is tested against a floor that it is never
`POSE_FLOOR` above (a UR5's shoulder, an arm that hangs from the root), and of an arm without a size on its sheet no two
parts that no pose brings `POSE_SELF` apart (a UR5's forearm and the ball): no motion could keep them clear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import ARMS, PAYLOAD_REACH, Arm, Capsule, NearestCapsules, arm, poses

PAYLOAD_RADIUS = 0.15  # [m]
_THIN, _THICK = 0.02, 0.04  # radius of an unknown arm's links over the sum of its link lengths
POSE_FLOOR, POSE_SELF = 0.10, 0.02  # [m] clearances of a pose that a motion may be built around
KEPT_FLOOR, KEPT_SELF = 0.05, 0.01  # [m] clearances that random and designed motions keep
_SAME_PLACE = 1e-3  # [m] between joints' origins of arms with the same links
_ROOM_TO_FOLD = 1.2  # links nearer than this multiple of their radii cannot be kept apart by the joints between them


class Clearance(NamedTuple):
    """Smallest distances at each of N poses [m]; negative means penetration (of capsules, not of real surfaces)."""

    floor: NDArray[np.float64]  # (N,)
    floor_part: NDArray[np.int64]  # (N,) which capsule of the model is lowest
    self: NDArray[np.float64]  # (N,)
    self_pair: NDArray[np.int64]  # (N,) which pair of the model is closest


@dataclass(frozen=True, eq=False)
class CapsuleArm:
    """An arm as capsules, ready to be tested at many poses.

    link: (C,) the link that carries each capsule, 0 for the base, i for the link moved by joint i.
    start, end: (C, 3) ends of the capsules' axes in the links' joint frames, of the base's in the file's root [m].
    radius: (C,) [m].
    pairs: (P, 2) capsules to test against each other.
    above: (F,) capsules to test against the floor.
    names: what each capsule is called in a message.
    """

    arm: Arm
    link: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: NDArray[np.float64]
    pairs: NDArray[np.int64]
    above: NDArray[np.int64]
    names: tuple[str, ...]

    def clearance(self, q: ArrayLike, floor: float | None = 0.0) -> Clearance:
        """Distance to the floor and of the arm to itself at poses q (N, n).

        Args:
            q: (N, n) [rad].
            floor: height of the floor in the frame of the file's root [m]; None: there is none.
        """
        poses = np.atleast_2d(np.asarray(q, dtype=float))
        apart, pair = self._itself(poses)
        if floor is None:
            return Clearance(np.full(len(poses), np.inf), np.zeros(len(poses), dtype=int), apart, pair)
        height, lowest = self._ground(poses)
        return Clearance(height - floor, self.above[lowest] if len(self.above) else lowest, apart, pair)

    @cached_property
    def _capsules(self) -> list[Capsule]:
        parts = zip(self.link, self.start, self.end, self.radius, strict=True)
        return [_capsule(*part) for part in parts]

    @cached_property
    def _itself(self) -> NearestCapsules:
        return NearestCapsules(self.arm, self._capsules, [(int(i), int(j)) for i, j in self.pairs])

    @cached_property
    def _ground(self) -> NearestCapsules:
        return NearestCapsules(self.arm, self._capsules, [(int(part), -1) for part in self.above])


def capsule_arm(arm: Arm, payload_radius: float = PAYLOAD_RADIUS) -> CapsuleArm:
    """The capsules of an arm and of what it holds.

    Args:
        arm: any arm; one whose outer size is known by that, others by the distances between their joints.
        payload_radius: radius of the ball around the payload [m]; 0: nothing is held.
    """
    origins = _joint_origins(arm)  # (n + 1, 3): of joint i + 1 in link i; the last is the payload frame in link n
    turned, at = arm.base_pose
    length = np.linalg.norm(origins, axis=1)
    measured = _measured(origins)
    if measured is not None:
        parts = [(link, np.array(a, float), np.array(b, float), r) for link, a, b, r in measured]
    else:
        radius = np.clip(length / 2, _THIN * length.sum(), _THICK * length.sum())
        parts = [(link, np.zeros(3), origin, radius[link]) for link, origin in enumerate(origins)]
    parts = [(link, *((a, b) if link else (at + turned @ a, at + turned @ b)), r) for link, a, b, r in parts]
    names = ["the base" if link == 0 else f"the link of {arm.joint_names[link - 1]}" for link, *_ in parts]
    if payload_radius > 0:
        R, _ = arm.link_poses(np.zeros((1, arm.n)))
        z = R[0, -1].T @ arm.frame_pose(np.zeros((1, arm.n)))[0][0, :, 2]
        centre = origins[-1] + PAYLOAD_REACH * z
        parts.append((arm.n, centre, centre, payload_radius))
        names.append("the payload")
    payload = len(parts) - 1 if payload_radius > 0 else -1

    def always_touch(i: int, j: int) -> bool:
        (link_i, *_, r_i), (link_j, *_, r_j) = parts[i], parts[j]
        if link_j - link_i <= 1:
            return True
        between = float(length[link_i + 1 : link_j].sum())  # how far the links between can keep the two apart
        if j == payload:
            between += float(length[-1]) + PAYLOAD_REACH
        elif measured is not None and link_j - link_i == 2:
            return True  # the joint limits between them keep these apart; their capsules overlap
        return between <= _ROOM_TO_FOLD * (r_i + r_j)

    pairs = [pair for pair in combinations(range(len(parts)), 2) if not always_touch(*pair)]
    above = [(part, -1) for part, (link, *_) in enumerate(parts) if link >= 2]  # the rest only turns on the base
    capsules = [_capsule(link, start, end, radius) for link, start, end, radius in parts]
    above = _separable(arm, capsules, above, POSE_FLOOR)
    if measured is None:
        pairs = _separable(arm, capsules, pairs, POSE_SELF)
    return CapsuleArm(
        arm,
        np.array([part[0] for part in parts]),
        np.array([part[1] for part in parts]),
        np.array([part[2] for part in parts]),
        np.array([part[3] for part in parts]),
        np.array(pairs, dtype=int).reshape(-1, 2),
        np.array([part for part, _ in above], dtype=int),
        tuple(names),
    )


def _capsule(link: int, start: NDArray[np.float64], end: NDArray[np.float64], radius: float) -> Capsule:
    return Capsule(int(link), (start[0], start[1], start[2]), (end[0], end[1], end[2]), float(radius))


def _separable(arm: Arm, capsules: list[Capsule], pairs: list[tuple[int, int]], apart: float) -> list[tuple[int, int]]:
    """Those of the pairs that some pose brings this far apart [m]."""
    q = poses(arm)
    return [pair for pair in pairs if NearestCapsules(arm, capsules, [pair])(q)[0].max() >= apart]


def _measured(origins: NDArray[np.float64]) -> tuple[Capsule, ...] | None:
    """The capsules of the built-in arm whose joints sit like these (n + 1, 3); None: no such arm was measured."""
    for facts in ARMS.values():
        if facts.capsules is not None and facts.joints == len(origins) - 1:
            theirs = _origins_of(facts.name)
            if np.allclose(origins[:-1], theirs[:-1], atol=_SAME_PLACE):
                return facts.capsules
    return None


@cache
def _origins_of(name: str) -> NDArray[np.float64]:
    return _joint_origins(arm(name))


def _joint_origins(arm: Arm) -> NDArray[np.float64]:
    """Origin of each next joint in the frame of the link before it, and of the payload frame in the last link."""
    zero = np.zeros((1, arm.n))
    turned, at = arm.base_pose
    R, p = arm.link_poses(zero)
    end = arm.frame_pose(zero)[1]
    points = np.concatenate([p[0], end])  # (n + 1, 3)
    steps = [R[0, i].T @ (points[i + 1] - points[i]) for i in range(arm.n)]
    return np.array([turned.T @ (points[0] - at), *steps])
