"""Joint friction of many shapes, smooth in velocity.

    f(dq, tau) = tanh(dq/w)·[c·(1 + a·tanh(dq/w)) + s·exp(−(dq/v_s)²) + mu·|tau|] + d·dq

with Coulomb level c, width w, asymmetry a of the two directions, Stribeck peak s of velocity v_s, share mu of the
transmitted torque's magnitude, and viscous coefficient d. The step at rest is smoothed, because a torque sensor behind
the gear sees it so, and so that the torque is a function of the state.

Forms for geared robot joints: Bona & Indri, "Friction compensation in robotics: an overview", CDC 2005; with load:
Bittencourt & Gunnarsson, "Static friction in a robot joint: modeling and identification of load and temperature
effects", ASME J. Dyn. Sys. Meas. Control 134, 2012.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import ArmError
from armload.runtime.real_numbers import own_reals

_NUDGE = 1e-6  # [rad/s] finite difference for the slope
_EXTRAS = ("asymmetry", "stribeck", "viscous", "load")  # what is zero in plain friction


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of n joints; each field (n,), None: zero.

    >>> friction = Friction(np.array([0.3]), np.array([0.06]), asymmetry=np.array([0.1]))
    >>> friction(np.array([[-1.0], [0.0], [1.0]])).round(3).ravel().tolist()
    [-0.27, 0.0, 0.33]

    Args:
        level: c, mean of the Coulomb levels of the two directions [N·m].
        width: w [rad/s].
        asymmetry: a, half the difference of the two levels over their mean.
        stribeck: s, the peak at low speed beyond the level [N·m].
        stribeck_velocity: v_s, at which the peak has fallen to 1/e [rad/s]; None: 0.1 rad/s.
        viscous: d [N·m·s/rad].
        load: mu, share of the magnitude of the transmitted torque.

    Raises:
        ArmError: fields of different lengths, or a number that is not finite, or a width or velocity not above 0.
    """

    level: NDArray[np.float64]
    width: NDArray[np.float64]
    asymmetry: NDArray[np.float64] | None = None
    stribeck: NDArray[np.float64] | None = None
    stribeck_velocity: NDArray[np.float64] | None = None
    viscous: NDArray[np.float64] | None = None
    load: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.level)
        for entry in fields(self):
            default = 0.1 if entry.name == "stribeck_velocity" else 0.0
            given = getattr(self, entry.name)
            value = own_reals(
                np.full(shape, default) if given is None else given, f"{entry.name} of the friction", ArmError
            )
            if value.ndim != 1 or value.shape != shape or not np.all(np.isfinite(value)):
                raise ArmError(f"{entry.name} of the friction has shape {value.shape}: expected {shape}, all finite")
            if entry.name in ("width", "stribeck_velocity") and not np.all(value > 0):
                raise ArmError(f"{entry.name} of the friction is {value.tolist()}: expected numbers above 0 rad/s")
            object.__setattr__(self, entry.name, value)

    @classmethod
    def none(cls, n: int) -> Friction:
        """No friction in any of n joints."""
        return cls(np.zeros(n), np.ones(n))

    @property
    def plain(self) -> bool:
        """Whether it is c·tanh(dq/w) and nothing else."""
        return not any(np.any(getattr(self, name)) for name in _EXTRAS)

    @property
    def zero(self) -> bool:
        """Whether there is none."""
        return self.plain and not np.any(self.level)

    def __call__(self, dq: ArrayLike, torque: ArrayLike | None = None) -> NDArray[np.float64]:
        """f (N, n) [N·m] at velocities dq (N, n) [rad/s] and transmitted torques (N, n) [N·m]; None: 0."""
        dq = np.asarray(dq, dtype=float)
        direction = np.tanh(dq / self.width)
        if self.plain:
            return self.level * direction
        size = self.level * (1.0 + self.asymmetry * direction)
        size = size + self.stribeck * np.exp(-((dq / self.stribeck_velocity) ** 2))
        if torque is not None:
            size = size + self.load * np.abs(torque)
        return direction * size + self.viscous * dq

    def with_slope(self, dq: NDArray[np.float64], torque: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
        """f (n,) at dq (n,) and a torque (n,), and how it grows with dq (n,), at least 0 [N·m·s/rad]."""
        here, there = self(np.stack([dq, dq + _NUDGE]), torque)
        return here, np.maximum((there - here) / _NUDGE, 0.0)

    @property
    def numbers(self) -> list[NDArray[np.float64]]:
        """All that makes it, for a fingerprint; of plain friction level and width only."""
        return [self.level, self.width] if self.plain else [getattr(self, entry.name) for entry in fields(self)]
