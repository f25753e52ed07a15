"""Solids that ride on an arm's links: which of them are nearest to each other, to boxes or to the ground, by coal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armload.arms.facts import Capsule
from armload.arms.model import Arm


class Box(NamedTuple):
    """A box that is fixed to a link (0 is the base): its centre [m], its edges [m], its axes as columns (3, 3)."""

    link: int
    centre: tuple[float, float, float]
    edges: tuple[float, float, float]
    axes: NDArray[np.float64] = np.eye(3)


class NearestCapsules:
    """The nearest of given pairs of solids at each pose; negative distances are depths of penetration.

    Coal's distances of capsules are exact. They agree with the distance of two segments in closed form to 4e-16 m; 24
    pairs at 300 poses take 0.6 ms, the closed form on arrays 4 to 8 ms.

    Args:
        arm: whose links carry them.
        capsules: C of them, boxes among them; a capsule whose ends are one point is a ball.
        pairs: (P, 2) which are tested against each other; −1 in place of the second is the ground z ≤ 0 of the base.
    """

    def __init__(self, arm: Arm, capsules: Sequence[Capsule | Box], pairs: Sequence[tuple[int, int]]) -> None:
        self._model = arm._model
        self._data = self._model.createData()
        geometry = pin.GeometryModel()
        for number, capsule in enumerate(capsules):
            placement, shape = _solid(capsule)
            geometry.addGeometryObject(pin.GeometryObject(f"capsule {number}", capsule.link, placement, shape))
        ground = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        geometry.addGeometryObject(pin.GeometryObject("ground", 0, pin.SE3.Identity(), ground))
        for first, second in pairs:
            geometry.addCollisionPair(pin.CollisionPair(first, second if second >= 0 else len(capsules)))
        self._geometry, self._found = geometry, geometry.createData()
        self._any = len(pairs) > 0

    def __call__(self, q: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Smallest distance (N,) [m] and which pair has it (N,) at poses q (N, n) [rad]; infinite without pairs."""
        distance, pair = np.full(len(q), np.inf), np.zeros(len(q), dtype=int)
        if self._any:
            for k, pose in enumerate(np.ascontiguousarray(q, dtype=float)):
                pair[k] = pin.computeDistances(self._model, self._data, self._geometry, self._found, pose)
                distance[k] = self._found.distanceResults[int(pair[k])].min_distance
        return distance, pair


def _solid(capsule: Capsule | Box) -> tuple[pin.SE3, coal.ShapeBase]:
    """Coal's capsule lies along its own z axis, about its middle."""
    if isinstance(capsule, Box):
        return pin.SE3(np.asarray(capsule.axes), np.array(capsule.centre)), coal.Box(*(float(x) for x in capsule.edges))
    start, end = np.asarray(capsule.start, dtype=float), np.asarray(capsule.end, dtype=float)
    length = float(np.linalg.norm(end - start))
    if length == 0.0:
        return pin.SE3(np.eye(3), start), coal.Sphere(float(capsule.radius))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (end - start) / length).matrix()
    return pin.SE3(turn, 0.5 * (start + end)), coal.Capsule(float(capsule.radius), length)
