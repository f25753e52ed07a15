"""KUKA's form for an LBR iiwa: load data for Sunrise, as Java and as what an object template asks for.

The centre of mass is in the flange frame, in millimetres. The moments of inertia are about the centre of mass and the
principal axes, which are turned from the flange's by A about z, then B about the new y, then C about the new x. From:
KUKA's own examples of SmartServo, where `LoadData` has setMass and setCenterOfMass; KUKA, operating instructions, load
center of gravity and mass moment of inertia (A, B, C and the units).
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.devices.load import Load
from armload.inertia import InertialParameters, phi_to_com

_DECIMALS = 6


class KukaLoad(NamedTuple):
    """M [kg], CM x y z [mm] and A B C [°], J x y z [kg·m²]."""

    mass: float
    com: list[float]
    axes: list[float]
    moments: list[float]


def kuka_load(parameters: InertialParameters) -> KukaLoad:
    """Load data for parameters about the flange.

    Of the orders and directions of the principal axes those are taken that are nearest to the flange's.

    >>> inertia = [[0.02, 0, 0], [0, 0.03, 0.005], [0, 0.005, 0.03]]
    >>> load = kuka_load(InertialParameters.from_com(2.0, (0, 0, 0.1), inertia))
    >>> load.com, load.axes, load.moments
    ([0.0, 0.0, 100.0], [0.0, 0.0, -45.0], [0.02, 0.025, 0.035])
    """
    if not parameters.phi.any():  # nothing has no centre of mass
        return KukaLoad(0.0, [0.0] * 3, [0.0] * 3, [0.0] * 3)
    mass, com, inertia = phi_to_com(parameters.phi)
    moments, axes = _principal(inertia)
    return KukaLoad(float(mass), _rounded(1e3 * com), _rounded(_turned(axes)), _rounded(moments, 12))


def sunrise_text(load: Load) -> str:
    """Java for an application, whose tool or workpiece is attached to the flange."""
    mass, com, axes, moments = kuka_load(load.parameters)
    return "\n".join(
        [
            *(f"// {line}" for line in load.description()),
            "LoadData loadData = new LoadData();",
            f"loadData.setMass({mass!r}); // [kg]",
            f"loadData.setCenterOfMass({', '.join(map(repr, com))}); // [mm] from the flange",
            "// in an object template, with the same mass and centre of mass:",
            f"// principal axes A {axes[0]!r}, B {axes[1]!r}, C {axes[2]!r} [deg]",
            f"// moments JX {moments[0]!r}, JY {moments[1]!r}, JZ {moments[2]!r} [kg m^2] about the centre of mass",
            "",
        ]
    )


def _principal(inertia: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Principal moments (3,) and axes, the columns of a rotation (3, 3), in the order nearest to the given axes."""
    moments, axes = np.linalg.eigh(inertia)
    order = max(permutations(range(3)), key=lambda order: np.abs(axes[range(3), order]).sum())  # nearest to x, y, z
    moments, axes = moments[list(order)], axes[:, order]
    axes = axes * np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, np.argmin(np.diag(axes))] *= -1.0
    return moments, axes


def _turned(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """A, B and C (3,) [°] of a rotation R = Rz(A)·Ry(B)·Rx(C) that turns by less than a quarter."""
    b = -np.arcsin(np.clip(R[2, 0], -1.0, 1.0))
    return np.degrees([np.arctan2(R[1, 0], R[0, 0]), b, np.arctan2(R[2, 1], R[2, 2])])


def _rounded(values: NDArray[np.float64], decimals: int = _DECIMALS) -> list[float]:
    return [round(float(x), decimals) + 0.0 for x in values]
