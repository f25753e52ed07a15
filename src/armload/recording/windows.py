"""Short windows of a log: averages over them compare signals without differentiating any."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.recording.recording import Recording

_WIDTH = 0.25  # [s] long against sensor noise and lag, short against the motion
_GAP = 0.05  # [s] a step longer than this, and than 3 median steps, is a gap


class Windows(NamedTuple):
    """First and last row of each window (W,); windows do not overlap and none spans a gap."""

    first: NDArray[np.intp]
    last: NDArray[np.intp]


def windows(recording: Recording) -> Windows:
    """The log cut into windows of a quarter of a second, or of one sample time where that is longer."""
    t = recording.t
    step = np.diff(t)
    median = float(np.median(step))
    width = max(_WIDTH, median)
    count = int(min((t[-1] - t[0]) / width, len(t) - 1))
    edges = np.unique(np.searchsorted(t, t[0] + width * np.arange(count + 1) - 0.5 * median))
    first, last = edges[:-1], edges[1:]
    broken = np.r_[0, np.cumsum(step > max(_GAP, 3.0 * median))]  # gaps up to each row
    whole = broken[first] == broken[last]
    return Windows(first[whole], last[whole])


def integrals(recording: Recording, signal: NDArray[np.float64], parts: Windows) -> NDArray[np.float64]:
    """∫ signal dt over each window (W, n), trapezoidal rule; signal (N, n)."""
    area = 0.5 * (signal[1:] + signal[:-1]) * np.diff(recording.t)[:, None]
    total = np.vstack([np.zeros(signal.shape[1]), np.cumsum(area, axis=0)])
    return total[parts.last] - total[parts.first]
