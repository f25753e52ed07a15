"""What a Franka robot counts as its load, over the one connection that it takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.devices.counted import Counted
from armload.devices.franka.writer import set_load
from armload.devices.guard import flange_of
from armload.devices.load import Load
from armload.errors import SourceError
from armload.inertia import InertialParameters

if TYPE_CHECKING:
    from armload.devices.detached import Detached


class FrankaController:
    """A robot that is being read.

    Args:
        present: gives the connection that reads it; None while there is none. arm: it.
    """

    def __init__(self, present: Callable[[], Detached | None], arm: Arm) -> None:
        self._present, self._arm, self._flange = present, arm, flange_of(arm)

    def counted(self) -> Counted:
        """Its present state.

        Raises:
            SourceError: it does not answer.
        """
        status = self._connection().read_once()
        load = body_of(status.m_load, status.com_load, status.inertia_load, self._flange)
        return Counted(status.dq, status.m_ee, load)

    def put(self, load: Load) -> None:
        """Make it count a load, guarded; one of zero is nothing.

        Raises:
            SinkError: the load must not be written, or the robot refused it. SentError: it was sent, and may count.
        """
        robot = self._connection()
        set_load(robot, load, self._arm, write=True, allow_undetermined_inertia=True, allow_nothing=True)

    def done(self) -> None:
        """Nothing more is written for a while."""

    def close(self) -> None:
        """The connection is the reader's."""

    def _connection(self) -> Detached:
        if (robot := self._present()) is None:
            raise SourceError("the robot is not connected: it is being opened again")
        return robot


def body_of(mass: float, com: ArrayLike, inertia: ArrayLike, flange: str) -> InertialParameters:
    """A load in the robot's own numbers: its centre (3,) [m] and inertia (9,), column by column [kg·m²]."""
    if mass <= 0.0:
        return InertialParameters.zero(flange)
    return InertialParameters.from_com(mass, com, np.reshape(inertia, (3, 3), order="F"), flange)
