"""Whether two logs show the same motion, and which moment of one is which moment of the other.

Clocks say nothing: logs start when somebody presses a button. The joint positions do. A short window of the run that
moves is laid over the whole other log (least squares over all lags), the best lag is refined below the sample time
(Gauss–Newton in the time shift), and from there on the two are followed side by side until they part: at the end of
the other log, at a pause that only one of them makes, at a gap. Then the search begins anew. So the logs may have
different rates, lost samples, different lengths and starts, and a periodic run finds every one of its periods.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.recording.recording import GAP, JITTERED, Recording

# of the motion's amplitude, distance in q below which two motions are the same: controllers under a payload part by
# milliradians, other motions by their amplitude
# (test_another_motion_standing_still_and_another_arm_are_not_the_same_motion)
TOLERANCE = 0.1
# share of a run that a tare along the same motion has to show: with less the posterior, which takes all of the run, has
# seen more than the difference
LEAST = 0.5
_RATE = 50.0  # [Hz] at which positions are compared: they hold nothing above a few hertz
# [s] the shortest of these in which the arm moves is looked up: the shorter, the sooner a live run is found
_WINDOWS = (0.5, 1.0, 2.0, 4.0)
_MOVES = 0.05  # [rad] rms amplitude of a window that can be looked up: with `TOLERANCE`, 5 mrad, a controller's error
_EVERY = 0.09  # [s] between two searches, one in ten a second on clocks that jitter: each costs a correlation
_TIE = 2e-3  # [rad] lags whose rms distances differ by no more are equally good: the earliest has most to follow
# times the tolerance, by which the best lag of the grid may be off for a finer one to be tried: at the tare's ends a
# finer lag leaves samples out, and gains more than half a step
_LEEWAY = 3.0
_EDGE = 1e-3  # [s] by which a sample may lie beyond the other log's ends: shifts are found to 0.1 ms, clocks jitter


class Piece(NamedTuple):
    """A stretch of the run, from start to stop on its own clock; the other log's clock shows `shift` more [s]."""

    start: float
    stop: float
    shift: float


@dataclass(frozen=True)
class Alignment:
    """Which moment of a tare is which moment of a run along the same motion.

    pieces: stretches of the run in order of time; t on the run's clock is t + shift on the tare's.
    deviation: rms distance in q of the two over these stretches, relative to the rms amplitude of the run there.
    coverage: the share of the run's path (∫ |dq|) that lies on them.
    """

    pieces: tuple[Piece, ...]
    deviation: float
    coverage: float

    def tare_times(self, t: ArrayLike) -> NDArray[np.float64]:
        """The tare's times (N,) for times of the run (N,) [s]; NaN where the tare does not show the run's motion."""
        t = np.asarray(t, dtype=float)
        out = np.full(t.shape, np.nan)
        for piece in self.pieces:
            inside = (t >= piece.start) & (t <= piece.stop)
            out[inside] = t[inside] + piece.shift
        return out


class Aligned(NamedTuple):
    """A sample of the run that the tare shows: its time, the tare's time − its time, and what came with it."""

    t: float
    shift: float
    row: Any


class MotionTracker:
    """Finds each sample of a run in a tare as it comes, in constant memory.

    Args:
        tare: the log to find it in.
        tolerance: distance in q, relative to the amplitude of the motion, up to which the two motions are the same.
    """

    def __init__(self, tare: Recording, tolerance: float = TOLERANCE) -> None:
        self.tare, self.tolerance = tare, tolerance
        self._times = np.arange(tare.t[0], tare.t[-1], 1.0 / _RATE)
        self._grid = _interpolated(self._times, tare.t, tare.q)
        self._far = tolerance * _amplitude(tare.q)  # [rad] beyond which a sample has left the motion
        # [rad] by which two samples of the tare half a step of the grid apart differ at most, rms over the joints
        self._between = 0.5 / _RATE * float(np.sqrt(np.max(np.mean(tare.dq**2, axis=1), initial=0.0)))
        self.restart()

    def restart(self) -> None:
        """Follow nothing: the next sample may be anywhere."""
        self.shift: float | None = None
        self._waiting: deque[tuple[float, NDArray, Any]] = deque()
        self._last = self._tried = -np.inf

    def feed(self, t: float, q: NDArray, row: Any = None) -> list[Aligned]:
        """The samples that are now found: this one, or after a search also those that waited for it, at most 4 s."""
        if t - self._last > GAP:
            self.restart()
        self._last = t
        if self.shift is not None:
            if self._follows(t + self.shift, q):
                return [Aligned(t, self.shift, row)]
            self.shift = None
        self._waiting.append((t, q, row))
        while t - self._waiting[0][0] > _WINDOWS[-1] + 0.5 / _RATE:
            self._waiting.popleft()
        if t - self._tried < _EVERY:
            return []
        self._tried = t
        self.shift = self._search()
        if self.shift is None:
            return []
        waiting, self._waiting = self._waiting, deque()
        return [Aligned(t, self.shift, row) for t, q, row in waiting if self._follows(t + self.shift, q)]

    def _follows(self, t: float, q: NDArray) -> bool:
        tare = self.tare
        if not tare.t[0] - _EDGE <= t <= tare.t[-1] + _EDGE:
            return False
        k = min(max(int(np.searchsorted(tare.t, t)), 1), len(tare.t) - 1)
        before, after = tare.t[k - 1], tare.t[k]
        if after - before > GAP:
            return False
        there = tare.q[k - 1] + (t - before) / (after - before) * (tare.q[k] - tare.q[k - 1])
        return _rms(q - there) <= self._far

    def _search(self) -> float | None:
        """The shift of the shortest window of the waiting samples that moves enough, if the tare shows it."""
        times = np.array([t for t, *_ in self._waiting])
        for length in _WINDOWS:
            first = int(np.searchsorted(times, times[-1] - length - 0.5 / _RATE))
            if times[-1] - times[first] < 0.9 * length:
                return None
            q = np.array([q for _, q, _ in self._waiting])[first:]
            if _amplitude(q) >= _MOVES:
                return self._look_up(times[first:], q)
        return None

    def _look_up(self, t: NDArray, q: NDArray) -> float | None:
        at = np.arange(t[0], t[-1], 1.0 / _RATE)
        window, grid = _interpolated(at, t, q), self._grid
        if len(grid) < len(window):
            return None
        # |window − grid|² for every lag: squares by running sums, products by correlation
        energy = np.concatenate([[0.0], np.cumsum(np.sum(grid**2, axis=1))])
        square = energy[len(window) :] - energy[: -len(window)] + np.sum(window**2)
        for joint in range(grid.shape[1]):
            square -= 2.0 * np.correlate(grid[:, joint], window[:, joint], "valid")
        mean_square = np.maximum(square, 0.0) / window.size
        if np.sqrt(mean_square.min()) > self._between + _LEEWAY * self.tolerance * _amplitude(q):
            return None  # no lag between those of the grid is so much better
        lag = int(np.argmax(mean_square <= mean_square.min() + _TIE**2))
        shift = float(self._times[lag] - at[0])
        for _ in range(8):
            there = self._there(t + shift)
            away = (q - _interpolated(t + shift, self.tare.t, self.tare.q))[there]
            speed = _interpolated(t + shift, self.tare.t, self.tare.dq)[there]
            shift += float(np.clip(np.sum(speed * away) / max(np.sum(speed**2), 1e-9), -1.0 / _RATE, 1.0 / _RATE))
        there = self._there(t + shift)
        if there.mean() < 0.5:
            return None
        away = (q - _interpolated(t + shift, self.tare.t, self.tare.q))[there]
        return shift if _rms(away) <= self.tolerance * _amplitude(q) else None

    def _there(self, t: NDArray) -> NDArray[np.bool_]:
        """Which of the tare's times (N,) lie between samples of it, not in a gap or beyond its ends."""
        k = np.clip(np.searchsorted(self.tare.t, t), 1, len(self.tare.t) - 1)
        before, after = self.tare.t[k - 1], self.tare.t[k]
        return (t >= before - _EDGE) & (t <= after + _EDGE) & (after - before <= GAP)


def align(run: Recording, tare: Recording, tolerance: float = TOLERANCE) -> Alignment:
    """What a tare shows of a run's motion, be it much or nothing; two logs with the same number of joints.

    Args:
        run: the log to find.
        tare: the log to find it in.
        tolerance: as in `MotionTracker`.
    """
    rows, last = [], -np.inf
    for k, now in enumerate(run.t):
        if now - last >= JITTERED / _RATE:
            rows.append(k)
            last = now
    tracker = MotionTracker(tare, tolerance)
    found = [aligned for k in rows for aligned in tracker.feed(float(run.t[k]), run.q[k], k)]
    pieces: list[Piece] = []
    for aligned in found:
        last = pieces[-1] if pieces else None
        if last is not None and last.shift == aligned.shift and aligned.t - last.stop <= GAP:
            pieces[-1] = last._replace(stop=aligned.t)
        else:
            pieces.append(Piece(aligned.t, aligned.t, aligned.shift))
    if not found:
        return Alignment((), np.inf, 0.0)
    index = np.array([aligned.row for aligned in found])
    there = _interpolated(np.array([aligned.t + aligned.shift for aligned in found]), tare.t, tare.q)
    steps = np.linalg.norm(np.diff(run.q[rows], axis=0), axis=1)
    times = run.t[rows]
    alignment = Alignment(tuple(pieces), _rms(run.q[index] - there) / _amplitude(run.q[index]), 0.0)
    on = np.isfinite(alignment.tare_times(times))
    share = float(np.sum(steps[on[1:] & on[:-1]]) / np.sum(steps))
    return Alignment(alignment.pieces, alignment.deviation, share)


def same_motion(
    run: Recording, tare: Recording, tolerance: float = TOLERANCE, least: float = LEAST
) -> Alignment | None:
    """How a run lies in a tare along the same motion, or None where the tare shows another motion.

    The measure is the rms distance in q after alignment, relative to the rms amplitude of the motion: the motion is the
    same if it is at most `tolerance` over at least `least` of the run's path. A log in which the arm hardly moves
    (0.05 rad rms in 4 s) shows no motion that could be the same.

    >>> t = np.arange(0, 6, 0.01)
    >>> q = np.column_stack([np.sin(t), np.cos(2.0 * t)])
    >>> dq = np.column_stack([np.cos(t), -2.0 * np.sin(2.0 * t)])
    >>> run = Recording(t[:400], q[150:550], dq[150:550], q[150:550])
    >>> found = same_motion(run, Recording(t, q, dq, q))
    >>> round(found.pieces[0].shift, 6), round(found.coverage, 2)
    (1.5, 1.0)

    Args:
        run: the log to find; its clock and rate are its own.
        tare: the log to find it in, longer or shorter.
        tolerance: largest relative distance.
        least: smallest share of the run's path.
    """
    if run.n != tare.n:
        return None
    alignment = align(run, tare, tolerance)
    return alignment if alignment.coverage >= least and alignment.deviation <= tolerance else None


def _interpolated(at: NDArray, t: NDArray, x: NDArray) -> NDArray[np.float64]:
    """x (N, n) at other times (M, n); constant beyond its ends. What it costs does not depend on N."""
    k = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    share = np.clip((at - t[k - 1]) / (t[k] - t[k - 1]), 0.0, 1.0)[:, None]
    return (1.0 - share) * x[k - 1] + share * x[k]


def _rms(x: NDArray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _amplitude(q: NDArray) -> float:
    return _rms(q - q.mean(axis=0))
