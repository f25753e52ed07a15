"""Controllers that can be told a load, by the name of the source that reads them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from armload.arms import Arm
from armload.devices.counted import Controller
from armload.devices.opening import address_of
from armload.errors import SourceError

if TYPE_CHECKING:
    from armload.devices.detached import Detached


_FRANKA = ("fr3", "panda")


def has_controller(spec: str) -> bool:
    """Whether a load can be told to the controller behind a source.

    >>> [has_controller(spec) for spec in ("fr3://172.16.0.2", "UR://192.168.0.10", "ros2:///joint_states", "sim")]
    [True, True, False, False]
    """
    scheme, _, rest = spec.partition("://")
    return bool(rest) and scheme.lower() in (*_FRANKA, "ur")


def controller_of(spec: str, arm: Arm, present: Callable[[], Detached | None]) -> Controller:
    """The controller behind a source.

    Args:
        spec: of the source, as of `open_source`. arm: it.
        present: gives the connection that reads it, for robots that take no second one; None while there is none.

    Raises:
        SourceError: nothing can be written to this source, or its client is not installed.
    """
    scheme = spec.partition("://")[0].lower()
    if scheme in _FRANKA:
        from armload.devices.franka.controller import FrankaController

        return FrankaController(present, arm)
    if scheme == "ur":
        from armload.devices.ur.controller import URController

        return URController(address_of(spec).host, arm)
    raise SourceError(f"no load can be written to {spec}: expected fr3://, panda:// or ur://")
