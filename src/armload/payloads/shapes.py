"""Random bodies of many shapes, and tools, made of solids: consistent by construction.

Lengths are in metres for an arm rated for 3 kg. They grow with the cube root of what another arm is rated for, so that
densities stay.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from armload.inertia import InertialParameters
from armload.payloads import solids

Shape = Callable[[np.random.Generator, float, float], InertialParameters]  # of rng, mass [kg], scale of lengths


def any_turn(rng: np.random.Generator) -> NDArray[np.float64]:
    """A rotation (3, 3), uniform over all of them (QR of a Gaussian matrix, Stewart 1980)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, ::-1]


def _place(rng: np.random.Generator, scale: float, side: float = 0.08, far: float = 0.16) -> NDArray[np.float64]:
    return scale * rng.uniform((-side, -side, 0.0), (side, side, far))


def block(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A box of any proportions, turned any way."""
    size = scale * rng.uniform(0.02, 0.2, size=3)
    return solids.box(size, mass=mass, rotation=any_turn(rng), translation=_place(rng, scale))


def cylinder(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A cylinder, turned any way."""
    radius, length = scale * rng.uniform(0.01, 0.08), scale * rng.uniform(0.02, 0.25)
    return solids.cylinder(radius, length, mass=mass, rotation=any_turn(rng), translation=_place(rng, scale))


def ball(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A ball."""
    return solids.sphere(scale * rng.uniform(0.02, 0.09), mass=mass, translation=_place(rng, scale))


def lump(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """All mass in a dense lump of steel, off the axis."""
    radius = float(np.cbrt(mass / (7800.0 * 4 / 3 * np.pi)))
    return solids.sphere(radius, mass=mass, translation=_place(rng, scale, 0.12, 0.2))


def plate(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A thin plate, turned any way, held off its centre."""
    size = scale * np.append(rng.uniform(0.08, 0.35, size=2), rng.uniform(0.002, 0.01))
    return solids.box(size, mass=mass, rotation=any_turn(rng), translation=_place(rng, scale, 0.1))


def rod(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A long rod, turned any way."""
    radius, length = scale * rng.uniform(0.005, 0.02), scale * rng.uniform(0.25, 0.7)
    return solids.cylinder(radius, length, mass=mass, rotation=any_turn(rng), translation=_place(rng, scale))


def bracket(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """An L or a T: a stem away from the flange, and an arm across at its end."""
    stem, across, thick = scale * rng.uniform((0.06, 0.06, 0.015), (0.22, 0.25, 0.05))
    shift = rng.uniform(0.0, 0.5) * across  # 0: a T; half of it: an L
    share = stem / (stem + across)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    about_z = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return solids.compose(
        [
            solids.box((thick, thick, stem), mass=share * mass, translation=(0.0, 0.0, stem / 2)),
            solids.box(
                (across, thick, thick),
                mass=(1 - share) * mass,
                rotation=about_z,
                translation=about_z @ [shift, 0.0, stem + thick / 2],
            ),
        ]
    )


def gripper(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A gripper: a body on the flange, turned about its axis, and two fingers."""
    wide, deep, high = scale * rng.uniform((0.10, 0.04, 0.05), (0.22, 0.10, 0.11))
    finger, gap = scale * rng.uniform(0.03, 0.07), scale * rng.uniform(0.01, 0.08)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    fingers = rng.uniform(0.03, 0.1) * mass
    off = scale * rng.uniform(-0.015, 0.015, size=2)  # cables and valves on one side
    at = (*off, high / 2)
    parts = [solids.box((wide, deep, high), mass=mass - 2 * fingers, rotation=turn, translation=at)]
    for side in (-0.5, 0.5):
        at = turn @ [side * gap, 0.0, high + finger / 2]
        parts.append(solids.box((0.01, 0.02, finger), mass=fingers, rotation=turn, translation=at))
    return solids.compose(parts)


def gripped(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A gripper, and an object far out in its fingers."""
    share = rng.uniform(0.25, 0.7)
    at = scale * rng.uniform((-0.03, -0.03, 0.10), (0.03, 0.03, 0.24))
    size = scale * rng.uniform(0.02, 0.12, size=3)
    held = solids.box(size, mass=(1 - share) * mass, rotation=any_turn(rng), translation=at)
    return gripper(rng, share * mass, scale) + held


def torch(rng: np.random.Generator, mass: float, scale: float) -> InertialParameters:
    """A holder on the flange and a slanted cylinder: a torch, a spindle, a camera on a stalk."""
    holder, length = scale * rng.uniform(0.03, 0.09), scale * rng.uniform(0.1, 0.35)
    turn, share = any_turn(rng), rng.uniform(0.2, 0.7)
    axis = turn[:, 2] if turn[2, 2] > 0 else -turn[:, 2]
    return solids.compose(
        [
            solids.cylinder(scale * 0.04, holder, mass=share * mass, translation=(0.0, 0.0, holder / 2)),
            solids.cylinder(
                scale * rng.uniform(0.01, 0.03),
                length,
                mass=(1 - share) * mass,
                rotation=turn,
                translation=[0.0, 0.0, holder] + 0.4 * length * axis,
            ),
        ]
    )


SHAPES: dict[str, Shape] = {
    "block": block,
    "cylinder": cylinder,
    "ball": ball,
    "lump": lump,
    "plate": plate,
    "rod": rod,
    "bracket": bracket,
    "gripped": gripped,
}
TOOLS: dict[str, Shape] = {"gripper": gripper, "bracket": bracket, "torch": torch}
