"""What a robot's controller counts as its load, and who can be asked and told."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from armload.devices.load import Load
from armload.errors import ArmloadError, SentError
from armload.inertia import InertialParameters

_TAKEN, _LOOK = 1.0, 0.01  # [s] until what was sent is read back, between two looks
_SAME = 1e-3  # [kg, kg·m, kg·m²] between what was sent and what is read back
_SEE = "see on its pendant or in Desk what it counts, and whether another program sets its payload"


class Counted(NamedTuple):
    """Joint velocities dq (n,) [rad/s], the mass of the end effector [kg], and the load about the flange."""

    dq: list[float]
    end_effector: float
    load: InertialParameters


class Controller(Protocol):
    """A robot's controller."""

    def counted(self) -> Counted:
        """Its present state; raises ArmloadError if it does not answer."""
        ...

    def put(self, load: Load) -> None:
        """Make it count a load, guarded (`check_writable`); raises ArmloadError if that must not be, or is refused.

        A SentError says that the load was sent, and may be counted all the same.
        """
        ...

    def done(self) -> None:
        """Nothing more is written for a while; raises ArmloadError if the robot cannot be told."""

    def close(self) -> None:
        """Let go of it; raises ArmloadError as `done`."""


def read_back(told: InertialParameters, counted: Callable[[], InertialParameters]) -> InertialParameters:
    """What a controller counts, once that is what it was told: equal to 1e-3 in each of phi.

    Args:
        told: about the flange. counted: asks the controller.

    Raises:
        SentError: after a second it still counts something else, or it does not say what.
    """
    until = time.monotonic() + _TAKEN
    while True:
        back = _asked(told, counted)
        if np.abs(back.phi - told.phi).max() <= _SAME:
            return back
        if time.monotonic() > until:
            raise SentError(f"the controller was told {_named(told, back)} and counts {_named(back, told)}: {_SEE}")
        time.sleep(_LOOK)


def _asked(told: InertialParameters, counted: Callable[[], InertialParameters]) -> InertialParameters:
    try:
        return counted()
    except ArmloadError as error:
        raise SentError(
            f"the controller was told {told.mass:.3f} kg, and does not say what it counts now ({error}): {_SEE}"
        ) from None


def _named(body: InertialParameters, other: InertialParameters) -> str:
    """A body's mass, and what else tells it from another one."""
    mass = f"{body.mass:.3f} kg"
    if abs(body.mass - other.mass) > _SAME or body.mass <= 0.0 or other.mass <= 0.0:
        return mass
    if np.abs(body.phi[1:4] - other.phi[1:4]).max() > _SAME:
        return f"{mass} at ({', '.join(f'{x:.4f}' for x in body.com)}) m"
    return f"{mass} with moments of inertia ({', '.join(f'{x:.4f}' for x in np.diag(body.inertia_com))}) kg·m²"
