"""What a robot's controller counts as its load, and who can be asked and told."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from armload.devices.load import Load
from armload.inertia import InertialParameters


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
        """Make it count a load, guarded (`check_writable`); raises ArmloadError if that must not be, or is refused."""
        ...

    def done(self) -> None:
        """Nothing more is written for a while; raises ArmloadError if the robot cannot be told."""

    def close(self) -> None:
        """Let go of it; raises ArmloadError as `done`."""
