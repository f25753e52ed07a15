"""A run without an end, in pieces: memory stays constant, and the payload may change between two of them.

Each piece is one native rollout from the state in which the one before it ended. When the payload changes, position and
velocity go on as they are and the inertia behind the last joint is another one from the next sample on: an object
gripped or let go while it moves with the hand. The controller learns nothing of it, so that the arm gives way and
comes to its new balance by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import ArmError, MotionError
from armload.motion import Motion
from armload.simulation.controller import Command, Gains
from armload.simulation.plant import build_model, diverged
from armload.simulation.resolution import FINE, Resolution
from armload.simulation.rollout import Clock, damping_at_rest, roll_on
from armload.simulation.runs import Run, payload_parameters, prepare
from armload.simulation.worlds import World


@dataclass(frozen=True, eq=False)
class _From(Motion):
    """A motion from a later time on."""

    motion: Motion
    start: float

    @property
    def n(self) -> int:
        return self.motion.n

    @property
    def duration(self) -> float:
        return self.motion.duration - self.start

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        return self.motion._at(self.start + t, order)


class ContinuedRun:
    """What `simulate` does, piece by piece.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> run = ContinuedRun(arm("panda"), taie2024(), rate=100.0)
    >>> [run.advance(50)[0][[0, -1]].tolist() for _ in range(2)]
    [[0.0, 0.49], [0.5, 0.99]]

    Args:
        arm: as the controller knows it.
        motion: as long as the run is to go on; beyond its end the arm stands still.
        payload: at the start.
        world: the arm as it really is; None: nominal.
        rate: [Hz]. seed: of what stiction holds at rest.
        comes_to_rest: friction at rest is implicit (`rollout`): an arm that is told to stand does, whatever its joints'
            friction.

    Raises:
        MotionError: the motion has another number of joints.
        PayloadError, ArmError: as `simulate`.
    """

    def __init__(
        self,
        arm: Arm,
        motion: Motion,
        payload: Any | None = None,
        *,
        world: World | None = None,
        rate: float = 1000.0,
        resolution: Resolution = FINE,
        seed: int = 0,
        comes_to_rest: bool = False,
    ) -> None:
        if not (np.isfinite(rate) and rate > 0):
            raise ArmError(f"the rate is {rate}: expected a positive number of Hz")
        if motion.n != arm.n:
            raise MotionError(f"the motion moves {motion.n} joints: {arm.name} has {arm.n}")
        self.rate = rate
        self._arm, self._motion, self._resolution = arm, motion, resolution
        world = world or World.nominal(arm)
        self._actual, self._sticking = world.arm(arm), world.sticking(seed)
        gains = Gains.of(arm)
        clock = Clock.at(rate, 2, resolution)
        command = Command.along(arm, motion, clock.step, clock.steps, resolution.knots)
        self._state = prepare(self._actual, gains, Run(motion, payload), world, command, clock)
        self._rows, self._comes_to_rest = 0, comes_to_rest

    def hold(self, payload: Any | None) -> None:
        """Change the payload, from the next sample on; None: nothing is held.

        Raises:
            PayloadError, ArmError: the payload cannot be simulated.
        """
        parameters = payload_parameters(payload, self._arm)
        state = self._state
        actual = self._actual if parameters is None else self._actual.with_payload(parameters)
        model = build_model(actual, state.gains, state.model.opt.timestep)
        model.dof_armature[:] = state.model.dof_armature
        self._state = replace(state, model=model)

    def advance(self, samples: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """The next samples: t (samples,) and q, dq, tau (samples, n), noise-free.

        Raises:
            ArmError: the simulation diverged.
        """
        clock = Clock.at(self.rate, samples + 1, self._resolution)
        ahead = _From(self._motion, self._rows / self.rate)
        command = Command.along(self._arm, ahead, clock.step, clock.steps, self._resolution.knots)
        state = replace(self._state, command=command)
        if self._comes_to_rest:
            state = replace(state, damping=damping_at_rest(state))
        (q, dq, tau), self._state = roll_on(state, clock)
        if diverged(dq) or not np.all(np.isfinite(tau)):
            raise ArmError(f"the simulated {self._arm.name} diverged: its gains do not suit its motion")
        tau = tau + self._sticking(dq)
        t = (self._rows + np.arange(samples)) / self.rate
        self._rows += samples
        return t, q, dq, tau
