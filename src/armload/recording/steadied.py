"""Velocities with less noise: what positions and velocities around a moment say of it together.

Within `AROUND` of a sample a joint's motion is a cubic in time, and both channels tell its coefficients,

    q(t + s) = c_0 + c_1·s + c_2·s²/2 + c_3·s³/6 + e_q,      dq(t + s) = c_1 + c_2·s + c_3·s²/2 + e_dq

by least squares, weighted by how noisy each is; c_1 is the velocity. A velocity's noise is in both sides of the
regression, as momentum of arm and payload: the slower a log is sampled, the less of it the lag takes away, and what
hardly turns seems to have less inertia than it has, surely.

A log without velocities has those that its positions tell alone: the same without dq.

Sources: local regression, Cleveland, J. Am. Stat. Assoc. 74, 1979 (here of two channels, all of a window alike); bias
by noise of the regressor: Fuller, Measurement Error Models, 1987.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.recording.recording import GAP, Recording
from armload.recording.spooled import blocks, parts_of

# [s] to either side: a cubic follows a motion of 2 Hz within 1 % there, and at 100 Hz a third of the noise is left
# (test_velocities_told_by_both_channels_have_a_third_of_the_noise_and_all_of_the_motion). With 0.05 s half is, and one
# in six sound logs of a Gen3 stays doubted
AROUND = 0.075
# samples to either side at least, where there are no velocities: five points tell a cubic and its error
STEPS = 2.1
_POWER = np.add.outer(np.arange(4), np.arange(4))  # of s in the normal equations' matrix
_FACTORIAL = np.array([1.0, 1.0, 2.0, 6.0])
_OF_BOTH = np.outer(_FACTORIAL, _FACTORIAL)
_QUIET = 1e-9  # [rad] noise of a channel at least: a joint that stands shows none
_HELD = 1e-9  # of the weight of one sample: holds what too few samples around do not tell


def steadied(recording: Recording) -> Recording:
    """The same log with the velocities that its positions and velocities tell together; none is told across a gap."""
    precision = precision_of(_noise(recording.q), _noise(recording.dq))
    return recording.with_velocities(_velocities(recording, precision, AROUND))


def with_velocities_of_positions(recording: Recording) -> Recording:
    """The same log with the velocities that its positions tell; none is told across a gap, a lone sample has 0."""
    still = replace(recording, dq=np.zeros_like(recording.q))
    precision = positions_alone(recording.n)
    around = max(AROUND, STEPS / recording.rate)
    note = (
        f"{recording.source}: velocities are told by the positions within {around:.2g} s of each moment, and by the "
        "times, which must be those of the samples"
    )
    return replace(still.with_velocities(_velocities(still, precision, around)), notes=(*recording.notes, note))


def _velocities(
    recording: Recording, precision: tuple[NDArray[np.float64], NDArray[np.float64]], around: float
) -> Iterator[NDArray[np.float64]]:
    """dq a block of samples at a time; around: [s] to either side that tell each."""
    t, n = recording.t, recording.n
    pieces = np.r_[0, np.cumsum(np.diff(t) > GAP)]
    reach = int(np.max(np.searchsorted(t, t + around, side="right") - np.arange(len(t)))) - 1
    for part in blocks(len(t)):
        first, stop = max(part.start - reach, 0), min(part.stop + reach, len(t))
        q, dq = recording.q[first:stop], around * recording.dq[first:stop]
        rows = np.arange(part.start, part.stop)
        moments, q_sums, dq_sums = np.zeros((7, len(rows))), np.zeros((4, len(rows), n)), np.zeros((3, len(rows), n))
        for away in range(-reach, reach + 1):
            k = np.clip(rows + away, 0, len(t) - 1)
            s = (t[k] - t[part]) / around
            power = ((k == rows + away) & (np.abs(s) <= 1.0) & (pieces[k] == pieces[rows])).astype(float)
            for p in range(7):  # Σ sᵖ, Σ sᵖ·q and Σ sᵖ·dq over what is near
                moments[p] += power
                if p < 4:
                    q_sums[p] += power[:, None] * q[k - first]
                if p < 3:
                    dq_sums[p] += power[:, None] * dq[k - first]
                power = power * s
        yield told(moments, q_sums, dq_sums, precision) * (AROUND / around)


def precision_of(q_std: NDArray[np.float64], dq_std: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """One over the variance (n,) of the noise in q and in dq·`AROUND` [1/rad²]."""
    of_q, of_dq = np.maximum([q_std, AROUND * dq_std], _QUIET) ** -2.0
    return of_q, of_dq


def positions_alone(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same where nothing but the positions tells."""
    return np.ones(n), np.full(n, _HELD)


def told(
    moments: NDArray[np.float64],
    q_sums: NDArray[np.float64],
    dq_sums: NDArray[np.float64],
    precision: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """c_1 (R, n) [rad/s] of R moments, by least squares; s is in units of `AROUND`.

    Args:
        moments: Σ sᵖ (7, R) over the samples near each. q_sums: Σ sᵖ·q (4, R, n). dq_sums: Σ sᵖ·dq·`AROUND` (3, R, n).
        precision: as of `precision_of`.
    """
    (of_q, of_dq), (_, count, n) = precision, q_sums.shape
    b = np.zeros((count, n, 4))
    A = np.zeros((count, n, 4, 4)) + (_HELD * (of_q + of_dq))[:, None, None] * np.diag([0.0, 0.0, 1.0, 1.0])
    A += of_q[:, None, None] * (moments.T[:, _POWER] / _OF_BOTH)[:, None]
    A[:, :, 1:, 1:] += of_dq[:, None, None] * (moments.T[:, _POWER[:3, :3]] / _OF_BOTH[:3, :3])[:, None]
    for i in range(4):
        b[:, :, i] += of_q * q_sums[i] / _FACTORIAL[i]
        if i:
            b[:, :, i] += of_dq * dq_sums[i - 1] / _FACTORIAL[i - 1]
    return np.array(np.linalg.solve(A, b[..., None])[:, :, 1, 0] / AROUND, dtype=float)


def _noise(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation (n,) of white noise in a smooth signal (N, n): its third differences have 20 times the power.

    0 where there are too few samples to tell.
    """
    thirds = [np.diff(part, 3, axis=0) for part in parts_of(x) if len(part) > 3]
    if not thirds:
        return np.zeros(x.shape[1])
    return np.sqrt(sum((d**2).sum(axis=0) for d in thirds) / sum(map(len, thirds)) / 20.0)
