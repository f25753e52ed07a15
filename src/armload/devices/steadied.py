"""A source whose velocities are told by its positions, too: each sample comes later, with less noise."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from armload.devices.source import Source
from armload.errors import ArmloadError
from armload.inertia import InertialParameters
from armload.recording import GAP, Recording, Sample, Steadying, steadied


class Steadied(Source):
    """Another source's samples with `recording.steadied` velocities, `AROUND` = 75 ms after they came.

    For robots whose velocities are differences of coarse positions, seldom sampled or late: there the noise of the
    velocity, which is in both sides of the regression, looks like a change of payload. What is no sample is handed on
    as it came, in its turn; all that is held back is, once no sample has come for `GAP`.

    Args:
        source: whose they are; closed with it.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self._arrived: float | None = None
        self._came: Sample | None = None

    @property
    def name(self) -> str:  # type: ignore[override]
        """The source's, as are the next four: of one that is opened again they change."""
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
    def epoch(self) -> float | None:  # type: ignore[override]
        """Of the source."""
        return self.source.epoch

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """What is made of what comes."""
        return self.source.notes

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
        steadying, lost, heard = Steadying(self.n), None, time.monotonic()
        try:
            for sample in samples:
                if sample is not None:
                    heard, ready = time.monotonic(), steadying.take(sample, (sample, self.source.arrived()))
                else:
                    ready = steadying.flush() if (time.monotonic() - heard) * self.speed > GAP else []
                for out, (self._came, self._arrived) in ready:
                    yield out
                if sample is None:
                    yield None
        except ArmloadError as error:  # what has come is handed on first
            lost = error
        for out, (self._came, self._arrived) in steadying.flush():
            yield out
        if lost is not None:
            raise lost

    def as_it_came(self, sample: Sample) -> Sample:
        """With the velocities that the robot told."""
        return self._came or sample

    def as_handed_on(self, log: Recording) -> Recording:
        """With steadied velocities."""
        return steadied(log)

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
