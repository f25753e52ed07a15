"""Stiction as a motor-side torque shows it: a joint at rest is held by friction of any size up to its level."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_MOVING = 4.0  # widths of the friction beyond which a joint's next rest is another one; stiction is 0.1 % there


class Stiction:
    """What stiction adds to the torque of a run, piece by piece; the same for the same seed, however it is cut.

        u_k·level·(1 − tanh²(dq/w)),      u_k ~ U(−1, 1), another one for each rest k of each joint

    Args:
        level: (n,) the most that friction holds [N·m]. width: w (n,) of the friction [rad/s]. seed: of u.
    """

    def __init__(self, level: NDArray[np.float64], width: NDArray[np.float64], seed: int) -> None:
        self.level, self.width = level, width
        self._rng = np.random.default_rng([seed, 5])
        self._rests = np.zeros(len(level), dtype=int)  # that each joint has had
        self._moving = np.zeros(len(level), dtype=bool)
        self._held = np.empty((0, len(level)))  # u of the rests from the `_first` on
        self._first = 0

    def __call__(self, dq: ArrayLike) -> NDArray[np.float64]:
        """What it adds (N, n) [N·m] at the next velocities dq (N, n)."""
        dq = np.asarray(dq, dtype=float)
        moving = np.abs(dq) > _MOVING * self.width
        before = np.concatenate([self._moving[None], moving[:-1]])
        rests = self._rests + np.cumsum(before & ~moving, axis=0)
        missing = int(rests.max()) + 1 - self._first - len(self._held)
        self._held = np.concatenate([self._held, self._rng.uniform(-1.0, 1.0, size=(max(missing, 0), len(self.level)))])
        held = np.take_along_axis(self._held, rests - self._first, axis=0)
        self._rests, self._moving = rests[-1], moving[-1]
        done = int(self._rests.min()) - self._first
        self._held, self._first = self._held[done:], self._first + done
        return self.level * (1.0 - np.tanh(dq / self.width) ** 2) * held
