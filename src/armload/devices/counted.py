"""What a robot's controller counts as its load, and who can be asked and told."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

from armload.arms import Arm
from armload.devices.load import Load
from armload.devices.opening import address_of
from armload.errors import SourceError
from armload.inertia import InertialParameters

if TYPE_CHECKING:
    from armload.devices.detached import Detached


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
        """Nothing more is written for a while."""

    def close(self) -> None:
        """Let go of it."""


def controller_of(spec: str, arm: Arm, present: Callable[[], Detached | None]) -> Controller:
    """The controller behind a source.

    Args:
        spec: of the source, as of `open_source`. arm: it.
        present: gives the connection that reads it, for robots that take no second one; None while there is none.

    Raises:
        SourceError: nothing can be written to this source, or its client is not installed.
    """
    scheme = spec.partition("://")[0]
    if scheme in ("fr3", "panda"):
        from armload.devices.franka.controller import FrankaController

        return FrankaController(present, arm)
    if scheme == "ur":
        from armload.devices.ur.controller import URController

        return URController(address_of(spec).host, arm)
    raise SourceError(f"no load can be written to {spec}: expected fr3://, panda:// or ur://")
