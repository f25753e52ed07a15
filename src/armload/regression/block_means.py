"""How much a correlated residual is worth: the long-run variance, by the method of batch means.

For a stationary residual e(t) the variance of its mean over a time T tends to S/T, where S = ∫ E[e(0)·e(s)] ds is the
long-run variance [N²·m²·s]. The means over blocks of length B ≫ correlation time give S = B·mean(block mean²).
Taking neighbouring samples for independent would put S = variance × sample time: on real arms 100 times too small.
Source: Conway 1963; Flegal & Jones, Annals of Statistics 2010 (batch means).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from numpy.typing import ArrayLike, NDArray

_MOST_BLOCKS = 256  # when they are full, pairs are joined: a variance of 128 blocks is known to 12 %
# [1] weight of a block at which it is left out: all that are lighter hold a hundredth of what counts
_FORGOTTEN = 0.01
# [s] of a block to begin with: residuals of real arms stay correlated for about a second (two Pandas, a UR10e)
BLOCK = 1.0


class BlockMeans:
    """Block sums of a signal of any shape, in constant memory: when there are too many blocks, pairs are joined.

    Args:
        shape: shape of one value of the signal (an int or a tuple).
        block: length of a block to begin with [s]; it should exceed the correlation time.

    Attributes:
        sums: (B, *shape) integral of the signal over each block, as far as it is filled.
    """

    def __init__(self, shape: int | tuple[int, ...], block: float = BLOCK) -> None:
        self.block = block
        self.sums = np.zeros((_MOST_BLOCKS, *np.atleast_1d(shape)))
        self._times, self._weights = np.zeros(_MOST_BLOCKS), np.ones(_MOST_BLOCKS)
        self._filled = 0  # index of the block being filled
        self._count = 0

    def add(self, duration: float, value: ArrayLike) -> None:
        """One value that stands for `duration` seconds."""
        self.extend(np.array([duration], dtype=float), np.asarray(value, dtype=float)[None])

    def extend(self, durations: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Values (N, *shape) that stand for `durations` (N,) seconds each."""
        self.extend_by(durations, lambda part: np.tensordot(durations[part], values[part], 1))

    def extend_by(self, durations: NDArray[np.float64], integral: Callable[[slice], NDArray[np.float64]]) -> None:
        """The same of values that need not be there: `integral` gives that of some of them, one after another."""
        first, time = 0, float(self._times[self._filled])
        for k, duration in enumerate(durations.tolist()):
            if time + 0.5 * duration >= self.block:
                self._put(durations[first:k], integral(slice(first, k)))
                first, time = k, 0.0
                self._filled += 1
                if self._filled == _MOST_BLOCKS:
                    self._join_pairs()
            time += duration
        self._put(durations[first:], integral(slice(first, None)))

    def _put(self, durations: NDArray[np.float64], integral: NDArray[np.float64]) -> None:
        """Into the block being filled; its weight is that of its parts."""
        k, more = self._filled, float(durations.sum())
        if self._weights[k] != 1.0 and more > 0.0:
            self._weights[k] = (self._weights[k] * self._times[k] + more) / (self._times[k] + more)
        self.sums[k] += integral
        self._times[k] += more
        self._count += int(np.count_nonzero(durations > 0))

    @property
    def rate(self) -> float:
        """Mean number of values per second; 0 before there are any."""
        total = self._times.sum()
        return self._count / total if total > 0 else 0.0

    @property
    def ready(self) -> bool:
        """Whether there are blocks enough for a variance."""
        return int(np.sum(self._times >= 0.5 * self.block)) >= 2

    def means(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Means (B, *shape), durations (B,) [s] and weights (B,) of the blocks that are at least half full."""
        keep = self._times >= 0.5 * self.block
        times, weights = self._times[keep], self._weights[keep]
        return self.sums[keep] / times.reshape(-1, *[1] * (self.sums.ndim - 1)), times, weights

    @property
    def duration(self) -> float:
        """Total time of the values [s], that of each block by its weight."""
        return float(self._times @ self._weights)

    def discount(self, share: float) -> None:
        """Let all values so far count for a share of what they did; the oldest that count for hardly anything are left.

        Else blocks would grow with all that ever was, and few be left to tell a variance of what counts.
        """
        weights = self._weights[: self._filled + 1]
        weights *= share
        if old := int(np.argmax(weights > _FORGOTTEN)):
            self._count = round(self._count * float(self._times[old:].sum() / self._times.sum()))
            for values, blank in ((self.sums, 0.0), (self._times, 0.0), (self._weights, 1.0)):
                values[:-old], values[-old:] = values[old:].copy(), blank
            self._filled -= old

    def long_run_variance(self) -> NDArray[np.float64]:
        """S (shape) [unit²·s] about zero; infinite while fewer than two blocks are full."""
        means, times, weights = self.means()
        if not self.ready:
            return np.full(self.sums.shape[1:], np.inf)
        shape = (-1, *[1] * (means.ndim - 1))
        return np.average(means**2 * times.reshape(shape), axis=0, weights=weights)

    def mapped(self, change: Callable[[NDArray], NDArray]) -> BlockMeans:
        """The blocks of a linear function of the signal; change: (B, *shape) → (B, *new)."""
        out, used = copy(self), change(self.sums[: self._filled + 1])
        out.sums = np.zeros((_MOST_BLOCKS, *used.shape[1:]))  # what is not used takes no memory
        out.sums[: len(used)] = used
        out._times, out._weights = self._times.copy(), self._weights.copy()
        return out

    @classmethod
    def joined(cls, parts: Sequence[BlockMeans]) -> BlockMeans:
        """The blocks of several stretches of one signal, one after another, to be read and not to be added to.

        Stretches whose blocks are shorter, as they lasted less, have theirs put together first.
        """
        out = cls(parts[0].sums.shape[1:], max(part.block for part in parts))
        shorter = [round(np.log2(out.block / part.block)) for part in parts]
        counts = [(part._filled >> by) + 1 for part, by in zip(parts, shorter, strict=True)]
        total, halvings, weighted = sum(counts), 0, np.zeros(_MOST_BLOCKS)
        while total > _MOST_BLOCKS << halvings:
            halvings += 1
        for part, first, by in zip(parts, np.cumsum([0, *counts[:-1]]), shorter, strict=True):
            count = part._filled + 1
            into = (first + (np.arange(count) >> by)) >> halvings
            starts = np.flatnonzero(np.diff(into, prepend=-1))
            out.sums[into[starts]] += np.add.reduceat(part.sums[:count], starts, axis=0)
            out._times[into[starts]] += np.add.reduceat(part._times[:count], starts)
            weighted[into[starts]] += np.add.reduceat(part._times[:count] * part._weights[:count], starts)
        out._weights = _share(weighted, out._times)
        out.block *= 2.0**halvings
        out._filled = (total - 1) >> halvings
        out._count = sum(part._count for part in parts)
        return out

    def _join_pairs(self) -> None:
        half, weighted = _MOST_BLOCKS // 2, self._times * self._weights
        self.sums[:half] = self.sums[0::2] + self.sums[1::2]
        self._times[:half] = self._times[0::2] + self._times[1::2]
        self.sums[half:], self._times[half:] = 0.0, 0.0
        self._weights[:half], self._weights[half:] = _share(weighted[0::2] + weighted[1::2], self._times[:half]), 1.0
        self.block *= 2.0
        self._filled = half


def _share(weighted: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weight of each block, of its time and of that time by the weights of its parts; 1 where there is none."""
    return np.divide(weighted, times, out=np.ones_like(times), where=times > 0.0)
