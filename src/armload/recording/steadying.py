"""Velocities with less noise on a stream: samples come out as they went in, but later, and with `steadied` velocities.

What comes after a moment tells as much of its velocity as what came before: a sample is held back until the next
`AROUND` has come. Nothing is told across a gap or a jump of the clock, nor by a sample that is none, or whose time does
not rise: such a one is handed on in its turn, as it came.
"""

from __future__ import annotations

from collections import deque
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.recording.recording import GAP, Sample
from armload.recording.steadied import AROUND, positions_alone, precision_of, told
from armload.recording.turns import TURN

_ROWS = 1024  # of the arrays that the last samples are in, at first; they grow where more come within `AROUND`
_THIRD = np.array([-1.0, 3.0, -3.0, 1.0])  # differences of them: of white noise they have 20 times the power
_STUCK = 3  # samples in a row whose time does not rise: nobody knows for how long the others would wait
_LONG = 2000.0  # [samples] over which noise is averaged: some seconds. It may change with the motion


class _Held(NamedTuple):
    """A sample that waits, and what goes with it; t: its time [s]; None: it tells nothing."""

    sample: Sample
    tag: Any
    t: float | None


class Steadying:
    """Takes samples, and gives them back `AROUND` later with the velocities that q and dq together tell.

    Args:
        n: joints.
        alone: the positions tell all: what a sample has for dq counts for nothing. One that has no other near has no
            velocity, NaN.
    """

    def __init__(self, n: int, alone: bool = False) -> None:
        self._n, self._alone = n, alone
        self._t, self._both = np.empty(_ROWS), np.empty((_ROWS, 2 * n))  # times, and q and dq·AROUND beside each other
        self._power, self._count = np.zeros(2 * n), 0.0  # mean square of third differences, and of how many
        self._begin()

    def _begin(self) -> None:
        """A stretch of its own: what came before tells nothing of what comes."""
        self._first = self._stop = 0  # rows that are kept
        self._stuck = 0
        self._held: deque[_Held] = deque()

    def take(self, sample: Sample, tag: Any = None) -> list[tuple[Sample, Any]]:
        """Take a sample; those whose time has come, in order, each with the tag that it was given with."""
        t, both = self._of(sample)
        if t is None:
            self._held.append(_Held(sample, tag, None))
            return self.flush()  # nobody knows how long
        out, step = [], t - self._t[self._stop - 1] if self._stop else 1.0
        if self._stop and not -GAP <= step <= GAP:
            out, step = self.flush(), 1.0
        if both is not None and self._stop:  # angles of an endless joint are counted anew after each turn
            q = both[: self._n]
            q -= TURN * np.rint((q - self._both[self._stop - 1, : self._n]) / TURN)
        self._stuck = 0 if step > 0.0 else self._stuck + 1
        good = both is not None and step > 0.0
        self._held.append(_Held(sample, tag, t if good else None))
        if self._stuck >= _STUCK:
            return out + self.flush()
        if both is not None and step > 0.0:
            self._append(t, both)
        while self._held and (self._held[0].t is None or self._held[0].t <= t - AROUND):
            out.append(self._next())
        return out

    def flush(self) -> list[tuple[Sample, Any]]:
        """All that is held back, by what has come so far: no more is coming, or not for long."""
        out = [self._next() for _ in range(len(self._held))]
        self._begin()
        return out

    def _of(self, sample: Sample) -> tuple[float | None, NDArray[np.float64] | None]:
        """Time of a sample, and its q and dq·AROUND, as far as they can be used."""
        try:
            t = float(sample.t)
            q = np.asarray(sample.q, float)
            both = np.concatenate([q, np.zeros_like(q) if self._alone else AROUND * np.asarray(sample.dq, float)])
        except (TypeError, ValueError):
            return _finite(sample.t), None
        good = both.shape == (2 * self._n,) and np.isfinite(both.sum())
        return _finite(t), both if good else None

    def _append(self, t: float, both: NDArray[np.float64]) -> None:
        if self._stop == len(self._t):
            kept = slice(self._first, self._stop)
            size = max(2 * (kept.stop - kept.start), _ROWS)
            self._t, self._both = (_moved(x[kept], size) for x in (self._t, self._both))
            self._first, self._stop = 0, kept.stop - kept.start
        self._t[self._stop], self._both[self._stop] = t, both
        self._stop += 1
        if self._stop - self._first >= len(_THIRD):
            third = _THIRD @ self._both[self._stop - len(_THIRD) : self._stop]
            self._count = min(self._count + 1.0, _LONG)
            self._power += (third**2 - self._power) / self._count

    def _next(self) -> tuple[Sample, Any]:
        """The sample that is held back longest."""
        sample, tag, t = self._held.popleft()
        if t is None:
            return sample, tag
        kept = self._t[self._first : self._stop]
        first, stop = np.searchsorted(kept, t - AROUND), np.searchsorted(kept, t + AROUND, side="right")
        near = slice(self._first + int(first), self._first + int(stop))
        self._first = near.start
        if self._alone and near.stop - near.start < 2:  # it may move, or not
            return sample._replace(dq=np.full(self._n, np.nan)), tag
        powers = ((self._t[near] - t) / AROUND) ** np.arange(7)[:, None]
        sums = powers[:4] @ self._both[near]
        std = np.sqrt(self._power / 20.0)
        precision = positions_alone(self._n) if self._alone else precision_of(std[: self._n], std[self._n :] / AROUND)
        dq = told(powers.sum(axis=1)[:, None], sums[:, None, : self._n], sums[:3, None, self._n :], precision)[0]
        return sample._replace(dq=dq), tag


def _finite(t: Any) -> float | None:
    """A time that is a number; None: it is none."""
    try:
        return float(t) if isfinite(t) else None
    except TypeError:
        return None


def _moved(x: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    out = np.empty((size, *x.shape[1:]))
    out[: len(x)] = x
    return out
