"""The simulator as an arm that is moved."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.devices.mover import StreamedMover
from armload.devices.simulator.commanded import CommandedMotion
from armload.devices.simulator.source import Simulator
from armload.inertia import InertialParameters
from armload.motion import StraightMotion
from armload.recording import Sample
from armload.simulation import Sensors, World

_AHEAD = 0.02  # [s] computed at once: a stop takes effect after so long, as over a network


class SimulatedMover(StreamedMover):
    """A simulated arm that stands until it is moved.

    >>> from armload.arms import arm
    >>> panda = arm("panda")
    >>> mover = SimulatedMover(panda, [0, -0.5, 0, -2, 0, 1.5, 0], speed=None, rate=100.0)
    >>> mover.follow(StraightMotion(mover.commanded(), mover.commanded() + 0.1, 1.0))
    >>> while mover.moving:
    ...     sample = next(iter(mover))
    >>> (mover.commanded()[:2].round(3) + 0.0).tolist(), mover.why
    ([0.1, -0.4], None)

    Args:
        arm: as its controller knows it.
        at: where it stands (n,) [rad].
        payload: what `mount` puts on; None: nothing.
        mounted: what is on from the start, unknown to the controller; None: nothing.
        world, sensors, rate, speed, seed, ahead: see `Simulator`.
    """

    def __init__(
        self,
        arm: Arm,
        at: ArrayLike,
        payload: Any | None = None,
        mounted: Any | None = None,
        *,
        world: World | None = None,
        sensors: Sensors | None = None,
        rate: float = 1000.0,
        speed: float | None = 1.0,
        seed: int = 0,
        ahead: float = _AHEAD,
    ) -> None:
        super().__init__(arm)
        standing = StraightMotion(at, at, 1.0, "standing")
        held = [] if mounted is None else [(0.0, mounted)]
        settings: Any = {"world": world, "sensors": sensors, "rate": rate, "speed": speed, "seed": seed, "ahead": ahead}
        self.simulator = Simulator(arm, standing, held, **settings, comes_to_rest=True)
        self.simulator.motion = self._commanded = CommandedMotion(standing)
        self.name, self.rate, self.speed = self.simulator.name, rate, self.simulator.speed
        self._payload = payload
        self._samples = iter(self.simulator)

    def __iter__(self) -> Iterator[Sample]:
        for sample in self._samples:
            movement = self._took(sample, self._begin)
            if movement is not None and movement.begun is not None:
                self._brakes(movement, self._commanded.asked - movement.begun)
            yield sample

    def commanded(self) -> NDArray[np.float64]:
        """Where the controller holds the arm, q (n,) [rad]."""
        return self._commanded.state[0]

    def mount(self) -> bool:
        """Put on the payload."""
        self.simulator.hold(self._payload)
        return True

    def arrived(self) -> float | None:
        """When the sample handed on last was due; None without a clock."""
        return self.simulator.arrived()

    def truth(self, t: float) -> InertialParameters:
        """What the arm holds at time t."""
        return self.simulator.truth(t)

    def close(self) -> None:
        """End the simulation."""
        self.simulator.close()

    def _begin(self) -> float:
        assert self._movement is not None
        return self._commanded.order(self._movement.course)
