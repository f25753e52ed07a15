"""What a driver publishes as `effort`, as joint torque with gravity in it.

tau = K·effort for motor currents [A], with K the torque constants of the joints; tau = effort + g(q) where the
controller has taken gravity out, of the arm and of the payload it was set to. UR's driver publishes either
(docs/ros2.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import SourceSetupError
from armload.recording import arm_as_set


class Effort:
    """Turns efforts into joint torque.

    >>> import numpy as np
    >>> from armload.arms import arm
    >>> panda, still = arm("panda"), np.zeros(7)
    >>> bool(np.allclose(Effort(panda, compensated="nothing").torque(still, still), panda.torque(still)))
    True

    Args:
        arm: whose efforts, with its base's orientation.
        torque_constants: joint torque per motor current (n,) [N·m/A]; None: efforts are no currents.
        compensated: what the controller that takes gravity out was set to carry, a payload's file or "nothing"; None:
            gravity is in the efforts.

    Raises:
        SourceSetupError: both are given, or the constants are not one positive number for each joint. PayloadError: the
            file cannot be read.
    """

    def __init__(
        self, arm: Arm, torque_constants: Sequence[float] | None = None, compensated: str | None = None
    ) -> None:
        if torque_constants is not None and compensated is not None:
            raise SourceSetupError(
                "torque_constants and compensated: efforts are motor currents or torque; leave one out"
            )
        self._constants = np.ones(arm.n) if torque_constants is None else np.asarray(torque_constants, dtype=float)
        if self._constants.shape != (arm.n,) or not (np.isfinite(self._constants) & (self._constants > 0.0)).all():
            raise SourceSetupError(
                f"torque_constants are {torque_constants}: expected {arm.n} positive numbers in N·m/A, one per joint"
            )
        self._set = None if compensated is None else arm_as_set(arm, compensated)

    def torque(self, q: NDArray[np.float64], effort: NDArray[np.float64]) -> NDArray[np.float64]:
        """tau (n,) [N·m], gravity in it."""
        if self._set is not None:
            return effort + self._set.torque(q)
        return self._constants * effort
