"""The payloads that a designed motion is safe for: from nothing up to a mass, centred anywhere within a box.

A joint's torque is linear in the ten parameters, so that its largest magnitude over a polytope of parameters is at one
of the polytope's corners. With the centre of mass c anywhere in a box of half edges d about c_0, the second moment
about the frame, m·c·cᵀ, lies below the chord of its corners by m·V, V = diag(v), 0 ≤ v_k ≤ d_k². So the corners

    m,   m·c_i,   I_ball + m·S(c_i) − m·(tr(V)·1 − V),      c_i: 8 corners,  v: 8 corners,

and no payload at all contain every payload of the range, exactly, and nothing much heavier.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armload.arms import PAYLOAD_REACH, Arm, rated_mass
from armload.errors import MotionError
from armload.inertia import InertialParameters

_BALL = 0.05  # [m] radius of the solid ball a payload is taken to be about its centre, as `motion.rated_load`
# [m] half edges of the box about a point 0.1 m beyond the payload frame that its centre may lie in. A stated choice
OFF_CENTRE = (0.05, 0.05, 0.05)


@dataclass(frozen=True)
class PayloadRange:
    """Payloads from nothing to `mass` [kg], centred within `half` [m] of `centre` [m] in the payload frame.

    Raises:
        MotionError: a mass or a half edge that is negative, or a number that is not finite.
    """

    mass: float
    centre: tuple[float, float, float] = (0.0, 0.0, PAYLOAD_REACH)
    half: tuple[float, float, float] = OFF_CENTRE

    def __post_init__(self) -> None:
        numbers = np.array([self.mass, *self.centre, *self.half])
        if not np.all(np.isfinite(numbers)) or self.mass < 0 or min(self.half) < 0:
            raise MotionError(
                f"the payload range of {self.mass} kg about {self.centre} m within {self.half} m is not possible: "
                "expected finite numbers, the mass and the half edges not negative"
            )

    @classmethod
    def rated(cls, arm: Arm) -> PayloadRange:
        """Up to what the arm is rated for."""
        return cls(rated_mass(arm))

    def payload(self, share: float, offset: NDArray[np.float64]) -> InertialParameters:
        """One of them: `share` of the mass, centred `offset` half edges (3,) off the centre."""
        com = np.array(self.centre) + np.asarray(offset) * self.half
        m = share * self.mass
        return InertialParameters.from_com(m, (com[0], com[1], com[2]), 0.4 * m * _BALL**2 * np.eye(3))

    def corners(self) -> NDArray[np.float64]:
        """Parameters (V, 10) of the corners; the first is no payload."""
        out = [np.zeros(10)]
        if self.mass == 0.0:
            return np.array(out)
        signs = [(0.0,) if d == 0.0 else (-1.0, 1.0) for d in self.half]
        below = [(0.0,) if d == 0.0 else (0.0, d**2) for d in self.half]
        for corner in product(*signs):
            phi = self.payload(1.0, np.array(corner)).phi
            for v in product(*below):
                less = np.zeros(10)
                total = sum(v)
                less[[4, 7, 9]] = self.mass * (total - np.array(v))  # Ixx, Iyy, Izz of vech
                out.append(phi - less)
        return np.array(out)
