"""The orders in which other programs write the same body.

| order       | numbers | layout                                                                 | inertia about |
|-------------|---------|------------------------------------------------------------------------|---------------|
| `paper`     | 10      | m, m·r (3), Ixx Ixy Ixz Iyy Iyz Izz                                     | frame origin  |
| `pinocchio` | 10      | m, m·r (3), Ixx Ixy Iyy Ixz Iyz Izz (`Inertia.toDynamicParameters`)     | frame origin  |
| `mujoco`    | 10      | mass, ipos (3), fullinertia: xx yy zz xy xz yz                          | CoM           |
| `ur`        | 10      | mass, CoG (3), Ixx Iyy Izz Ixy Ixz Iyz (`set_target_payload`)           | CoM           |
| `franka`    | 13      | mass, F_x_Cload (3), I_load 3×3 column-major (`setLoad`)                | CoM           |
| `urdf`      | 10      | mass, origin xyz (3), ixx ixy ixz iyy iyz izz (`<inertial>`, rpy = 0)   | CoM           |

All are in the axes of the same frame. Sources: the programs' own reference manuals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import InertiaError
from armload.inertia.parameters import InertialParameters, inertia_matrix, parameters_only, phi_to_com, vech
from armload.runtime.real_numbers import reals

# position of each of the other program's six inertia numbers in (xx, xy, xz, yy, yz, zz)
_ABOUT_ORIGIN = {"paper": [0, 1, 2, 3, 4, 5], "pinocchio": [0, 1, 3, 2, 4, 5]}
_ABOUT_COM = {"mujoco": [0, 3, 5, 1, 2, 4], "ur": [0, 3, 5, 1, 2, 4], "urdf": [0, 1, 2, 3, 4, 5]}
# What `to_order` and `from_order` know: the orders of other programs and of the paper.
ORDERS = ("paper", "pinocchio", "mujoco", "ur", "franka", "urdf")


def to_order(parameters: InertialParameters, order: str) -> NDArray[np.float64]:
    """The numbers of `parameters` as another program writes them (table above); shape (10,), Franka (13,).

    >>> body = InertialParameters.from_com(2.0, (0, 0, 0.1), np.diag([1.0, 2.0, 3.0]))
    >>> to_order(body, "ur").tolist()
    [2.0, 0.0, 0.0, 0.1, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0]

    Raises:
        InertiaError: what is given are no parameters; the order is unknown, or needs a CoM that a massless body does
            not have.
    """
    parameters = parameters_only(parameters)
    if order in _ABOUT_ORIGIN:
        return np.concatenate([parameters.phi[:4], parameters.phi[4:][_ABOUT_ORIGIN[order]]])
    _known(order)
    mass, com, inertia = phi_to_com(parameters.phi)
    if order == "franka":
        return np.concatenate([[mass], com, inertia.flatten(order="F")])
    return np.concatenate([[mass], com, vech(inertia)[_ABOUT_COM[order]]])


def from_order(values: ArrayLike, order: str, frame: str | None = None) -> InertialParameters:
    """The inverse of `to_order`: read what another program wrote.

    Args:
        values: (10,), Franka (13,).
        order: one of `ORDERS`.
        frame: the frame the numbers are about.

    Raises:
        InertiaError: the order is unknown, or the numbers do not fit it.
    """
    _known(order)
    expected = 13 if order == "franka" else 10
    try:
        v = reals(values)
    except ValueError as error:
        raise InertiaError(
            f"values not numeric: found {error}, {expected} numbers expected in the order {order!r}"
        ) from None
    if v.shape != (expected,):
        raise InertiaError(f"{v.size} numbers given in the order {order!r}: expected {expected}")
    if order in _ABOUT_ORIGIN:
        six = np.empty(6)
        six[_ABOUT_ORIGIN[order]] = v[4:]
        return InertialParameters(np.concatenate([v[:4], six]), frame)
    if order == "franka":
        return InertialParameters.from_com(v[0], v[1:4], v[4:].reshape(3, 3, order="F"), frame)
    six = np.empty(6)
    six[_ABOUT_COM[order]] = v[4:]
    return InertialParameters.from_com(v[0], v[1:4], inertia_matrix(six), frame)


def _known(order: str) -> None:
    if order not in ORDERS:
        raise InertiaError(f"unknown order {order!r}: expected one of {', '.join(ORDERS)}")
