"""What a joint's quantities are called and measured in: one that slides along an axis has m and N, not rad and N·m."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

TURNING = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "jerk": "rad/s³", "torque": "N·m"}
SLIDING = {"position": "m", "velocity": "m/s", "acceleration": "m/s²", "jerk": "m/s³", "torque": "N"}
QUANTITIES = tuple(TURNING)


def unit_of(what: str, slides: bool | np.bool_) -> str:
    """The unit of a joint's quantity.

    >>> unit_of("torque", False), unit_of("torque", True)
    ('N·m', 'N')
    """
    return (SLIDING if slides else TURNING)[what]


def called(what: str, slides: bool | np.bool_) -> str:
    """What a joint's quantity is called: the torque of one that slides is a force."""
    return "force" if slides and what == "torque" else what


def heading(what: str, slides: ArrayLike, name: str | None = None) -> str:
    """A quantity with its unit over a column, whose rows are joints; both units where only some of them slide.

    >>> heading("velocity", [False, False]), heading("torque", [True, False]), heading("position", [True], "from")
    ('velocity [rad/s]', 'torque [N·m, N]', 'from [m]')
    """
    some = np.asarray(slides)
    kinds = [units[what] for units, there in ((TURNING, ~some), (SLIDING, some)) if there.any()]
    return f"{name or what} [{', '.join(kinds)}]"


def marked(joint: str, slides: ArrayLike, k: int) -> str:
    """A joint's name in such a table; those that slide are marked where others turn."""
    some = np.asarray(slides)
    return f"{joint} (slides)" if some[k] and not some.all() else joint
