"""Motions one after another: the way to where a motion begins, and then the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import SAME_PLACE, SAME_SPEED, Motion


@dataclass(frozen=True, eq=False)
class JoinedMotion(Motion):
    """Motions, each from rest to rest and from where the one before ends.

    >>> from armload.motion import StraightMotion
    >>> there, back = StraightMotion([0.0], [1.0], 2.0), StraightMotion([1.0], [0.0], 3.0)
    >>> both = JoinedMotion((there, back), "there and back")
    >>> both.duration, both.position([0.0, 2.0, 5.0]).ravel().tolist()
    (5.0, [0.0, 1.0, 0.0])

    Args:
        parts: in their order, one at least. name: what they are called together.

    Raises:
        MotionError: there is none, they are of different arms, or one does not begin at rest where the last one ends.
    """

    parts: Sequence[Motion]
    name: str = "joined"

    def __post_init__(self) -> None:
        if not self.parts or len({part.n for part in self.parts}) != 1:
            raise MotionError(f"{len(self.parts)} motions cannot be joined: expected one or more of the same arm")
        for before, after in zip(self.parts, self.parts[1:], strict=False):
            q = before.position([before.duration])[0], after.position([0.0])[0]
            dq = before.velocity([before.duration])[0], after.velocity([0.0])[0]
            if np.abs(q[1] - q[0]).max() > SAME_PLACE or np.abs(dq).max() > SAME_SPEED:
                raise MotionError(f"{after.name} does not begin at rest where {before.name} ends at rest")

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.parts[0].n

    @property
    def duration(self) -> float:
        """Of all [s]."""
        return sum(part.duration for part in self.parts)

    def seams(self) -> NDArray[np.float64]:
        """Of all parts [s]."""
        begins = np.cumsum([0.0, *(part.duration for part in self.parts[:-1])])
        return np.unique(np.concatenate([at + part.seams() for at, part in zip(begins, self.parts, strict=True)]))

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        ends = np.cumsum([part.duration for part in self.parts])
        which = np.minimum(np.searchsorted(ends, t, side="right"), len(self.parts) - 1)
        out = np.empty((len(t), self.n))
        for k, part in enumerate(self.parts):
            mine = which == k
            out[mine] = part.derivative(np.clip(t[mine] - (ends[k] - part.duration), 0.0, part.duration), order)
        return out
