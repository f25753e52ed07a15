"""Short windows of a log: averages over them compare signals without differentiating any."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.recording.recording import Recording
from armload.recording.spooled import blocks

_WIDTH = 0.25  # [s] long against sensor noise and lag, short against the motion
_GAP = 0.05  # [s] a step longer than this, and than 3 median steps, is a gap


class Windows(NamedTuple):
    """First and last row of each window (W,); windows do not overlap and none spans a gap."""

    first: NDArray[np.intp]
    last: NDArray[np.intp]


def windows(recording: Recording) -> Windows:
    """The log cut into windows of a quarter of a second, or of one sample time where that is longer."""
    t, median = recording.t, 1.0 / recording.rate
    width = max(_WIDTH, median)
    count = int(min((t[-1] - t[0]) / width, len(t) - 1))
    edges = np.unique(np.searchsorted(t, t[0] + width * np.arange(count + 1) - 0.5 * median))
    first, last = edges[:-1], edges[1:]
    long = max(_GAP, 3.0 * median)
    gaps = [rows.start + np.flatnonzero(np.diff(t[rows.start : rows.stop + 1]) > long) for rows in blocks(len(t))]
    gaps = np.concatenate(gaps)  # the rows before them
    whole = np.searchsorted(gaps, first) == np.searchsorted(gaps, last)
    return Windows(first[whole], last[whole])


def integrals(
    recording: Recording, signal: Callable[[slice], NDArray[np.float64]], parts: Windows
) -> NDArray[np.float64]:
    """∫ signal dt over each window (W, n), trapezoidal rule; signal(rows) is what it is there (N, n)."""
    ends = np.stack([parts.first, parts.last])
    at = np.zeros((*ends.shape, recording.n))  # ∫ signal dt from the first row to the ends
    total = np.zeros((1, recording.n))
    for part in blocks(len(recording)):
        rows = slice(max(part.start - 1, 0), part.stop)
        x = signal(rows)
        area = 0.5 * (x[1:] + x[:-1]) * np.diff(recording.t[rows])[:, None]
        total = np.cumsum(np.vstack([total[-1:], area]), axis=0)
        here = (ends >= part.start) & (ends < part.stop)
        at[here] = total[ends[here] - rows.start]
    return at[1] - at[0]
