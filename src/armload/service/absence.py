"""How long no sample came, and whether the arm may be as on another day since."""

from __future__ import annotations

from armload.posterior.drift import SESSION
from armload.recording import Sample


class Absence:
    """The time between two samples of a stream, on this machine's monotonic clock."""

    def __init__(self) -> None:
        self._sample: Sample | None = None
        self._came = 0.0  # [s]

    def ended(self, sample: Sample | None, now: float) -> float | None:
        """For how long [s] no sample came before this one, where that is longer than a session lasts; else None.

        Args:
            sample: the newest that could be used; None before the first. now: [s].
        """
        if sample is None or sample is self._sample:
            return None
        first, gone = self._sample is None, now - self._came
        self._sample, self._came = sample, now
        return gone if not first and gone > SESSION else None
