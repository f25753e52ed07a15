"""What an arm is made with, beside its URDF: numbers that can be what they are called."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armload.errors import ArmError
from armload.runtime.real_numbers import own_reals, reals

# [m/s²] least and most at a base that an arm works on: the Moon has 1.62, and a base on the Earth that brakes or turns
# at one g beside it has 14. A stated guard: 1, which is gravity in g, is below it, 32 in ft/s² and 981 in cm/s² above
GRAVITIES = (1.5, 20.0)


def gravity_of(given: ArrayLike) -> tuple[float, float, float]:
    """Gravity (3,) in the base's axes [m/s²].

    Raises:
        ArmError: not three finite numbers, or of a size that is found nowhere.
    """
    try:
        gravity = reals(given)
    except ValueError:
        gravity = np.full(3, np.nan)
    if gravity.shape != (3,) or not np.all(np.isfinite(gravity)):
        raise ArmError(f"gravity is {given!r}: expected 3 finite numbers x,y,z in m/s², such as 0,0,-9.81")
    least, most = GRAVITIES
    if not least <= np.linalg.norm(gravity) <= most:
        raise ArmError(
            f"gravity {tuple(gravity.tolist())} has magnitude {np.linalg.norm(gravity):.3g} m/s²: expected about "
            f"9.81 on Earth (1.62 on the Moon, {least:g} to {most:g} anywhere); give it in m/s², not in g, in the "
            "axes of the robot's base, pointing down"
        )
    x, y, z = gravity.tolist()
    return x, y, z


def check_number(value: float | None, what: str, zero: bool) -> None:
    """See that a number is finite and above zero; `zero`: or zero. None is for what is not known.

    Raises:
        ArmError: it is not.
    """
    if value is None:
        return
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not (0.0 <= number < np.inf and (zero or number > 0.0)):
        raise ArmError(f"{what} is {value!r}: expected a finite number {'of 0 or more' if zero else 'above 0'}")


def check_ends(values: ArrayLike | None, joints: int) -> None:
    """See that the rows of `limits.VelocityEnds` are four, each with a finite number for each joint. None: not known.

    Raises:
        ArmError: they are not, or a slope is not above zero.
    """
    if values is None:
        return
    rows = own_reals(values, "the ends of the velocity limits", ArmError)
    if rows.ndim != 2 or len(rows) != 4 or rows.shape[1] < joints or not np.isfinite(rows).all() or rows[2].min() <= 0:
        raise ArmError(
            f"the ends of the velocity limits are {values!r}: expected low and high ends, slopes above 0 and reserves, "
            f"each for {joints} joints"
        )


def check_limits(values: ArrayLike | None, what: str, joints: int) -> None:
    """See that there is a limit above zero for each joint, and maybe for more. None is for what is not known.

    Raises:
        ArmError: there are fewer, or one is no limit.
    """
    if values is None:
        return
    limits = own_reals(values, what, ArmError)
    if limits.ndim != 1 or len(limits) < joints or not np.all(limits > 0.0):
        raise ArmError(f"{what} is {values!r}: expected a number above 0 for each of {joints} joints")
