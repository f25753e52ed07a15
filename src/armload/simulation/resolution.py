"""How finely a run is integrated: what it costs, and how well the controller acts; the log is exact to second order.

Whatever is chosen here, a log holds the torque that moved the rigid bodies plus the joints' own at the logged instants
(see `simulate.rollout`). What a coarse resolution changes is how the arm strays from its command: as if the controller
had misread its own torque by a little.
"""

from __future__ import annotations

from dataclasses import dataclass

from armload.errors import ArmError


@dataclass(frozen=True)
class Resolution:
    """step: the largest time step [s]; passes: rollouts in search of the disturbance along the motion; knots: how far
    apart the feed-forward torque is computed, cubic between [s]; slow_knots: as far apart what is smooth along the
    motion that came out [s].

    >>> Resolution.coarse().step
    0.0025
    """

    step: float = 5e-4
    passes: int = 2
    knots: float = 2e-3
    slow_knots: float = 1e-2

    def __post_init__(self) -> None:
        if not (self.step > 0 and self.passes >= 1 and self.knots > 0 and self.slow_knots > 0):
            raise ArmError(f"{self} cannot be simulated with: expected positive times and at least one pass")

    @classmethod
    def coarse(cls) -> Resolution:
        """A sixth of the cost, for thousands of runs; torque within about 1 mN·m rms of the inverse dynamics."""
        return cls(step=2.5e-3, passes=1, knots=1e-2, slow_knots=2e-2)


FINE, COARSE = Resolution(), Resolution.coarse()
