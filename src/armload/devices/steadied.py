"""A source whose velocities are told by its positions, too: each sample comes later, with less noise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from armload.devices.source import Source
from armload.errors import SourceError
from armload.inertia import InertialParameters
from armload.recording import Sample, Steadying


class Steadied(Source):
    """Another source's samples with `recording.steadied` velocities, `AROUND` = 75 ms after they came.

    For robots whose velocities are differences of coarse positions, seldom sampled or late: there the noise of the
    velocity, which is in both sides of the regression, looks like a change of payload. A tare is steadied by whoever
    reads it (`recording.steadied`). What is no sample is passed on as it came, in its turn.

    Args:
        source: whose they are; closed with it.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self._arrived: float | None = None
        self._came: Sample | None = None

    @property
    def name(self) -> str:  # type: ignore[override]
        """The source's, as are the next three: of one that is opened again they change."""
        return self.source.name

    @property
    def n(self) -> int:  # type: ignore[override]
        """Joints."""
        return self.source.n

    @property
    def rate(self) -> float:  # type: ignore[override]
        """Nominal samples per second [Hz]."""
        return self.source.rate

    @property
    def speed(self) -> float:  # type: ignore[override]
        """Seconds of samples that come in a second."""
        return self.source.speed

    @property
    def lost(self) -> int:
        """Samples that the source had to drop."""
        return int(getattr(self.source, "lost", 0))

    def __iter__(self) -> Iterator[Sample]:
        return (sample for sample in self._each(iter(self.source)) if sample is not None)

    def ticking(self, tick: float) -> Iterator[Sample | None]:
        """The same; None every `tick` seconds while none comes, after all that were held back."""
        return self._each(self.source.ticking(tick))

    def _each(self, samples: Iterator[Sample | None]) -> Iterator[Sample | None]:
        steadying, lost = Steadying(self.n), None
        try:
            for sample in samples:
                ready = steadying.flush() if sample is None else steadying.take(sample, (sample, self.source.arrived()))
                for out, (self._came, self._arrived) in ready:
                    yield out
                if sample is None:
                    yield None
        except SourceError as error:  # what has come is handed on first
            lost = error
        for out, (self._came, self._arrived) in steadying.flush():
            yield out
        if lost is not None:
            raise lost

    def as_it_came(self, sample: Sample) -> Sample:
        """With the velocities that the robot told."""
        return self._came or sample

    def arrived(self) -> float | None:
        """When the sample handed on last had come [s, monotonic]: it has waited since."""
        return self._arrived

    @property
    def simulated(self) -> bool:
        """Whether it is a simulator."""
        return self.source.simulated

    def hold(self, payload: Any, t: float | None = None) -> float:
        """As of the source."""
        return self.source.hold(payload, t)

    def truth(self, t: float) -> InertialParameters | None:
        """As of the source."""
        return self.source.truth(t)

    def close(self) -> None:
        """Let go of the source."""
        self.source.close()
