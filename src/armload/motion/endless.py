"""A repeated motion: forward each time if it ends as it began, forward and backward if it only comes to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import SAME_PLACE, SAME_SPEED, Motion


@dataclass(frozen=True, eq=False)
class EndlessMotion(Motion):
    """A motion that goes on for ever.

    >>> from armload.motion import taie2024
    >>> motion = EndlessMotion(taie2024())
    >>> bool(np.allclose(motion.position([1.0]), motion.position([601.0])))
    True

    Args:
        motion: ends as it began, or is at rest at both ends (then it runs backwards in time every second turn).

    Raises:
        MotionError: it does neither.
    """

    motion: Motion

    def __post_init__(self) -> None:
        dq = self.motion.velocity([0.0, self.motion.duration])
        if not self.motion.duration > 0:
            raise MotionError(f"the motion lasts {self.motion.duration} s: expected a positive time")
        if not (np.allclose(dq[0], dq[1], atol=SAME_SPEED) and (self.closed or np.allclose(dq, 0, atol=SAME_SPEED))):
            raise MotionError(
                "the motion cannot be repeated: expected one that ends as it began, or starts and stops at rest"
            )

    @property
    def closed(self) -> bool:
        """Whether it ends where it began."""
        q = self.motion.position([0.0, self.motion.duration])
        return bool(np.allclose(q[0], q[1], atol=SAME_PLACE))

    @property
    def name(self) -> str:  # type: ignore[override]
        """The motion's own."""
        return self.motion.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.motion.n

    @property
    def duration(self) -> float:
        """Infinite [s]."""
        return float("inf")

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,) ≥ 0; (N, n)."""
        turn, within = np.divmod(t, self.motion.duration)
        if self.closed:
            return self.motion.derivative(within, order)
        back = turn % 2 == 1
        out = self.motion.derivative(np.where(back, self.motion.duration - within, within), order)
        out[back] *= (-1.0) ** order
        return out
