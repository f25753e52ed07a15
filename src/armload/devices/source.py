"""Where samples come from, live or recorded: one interface, so that a robot, a simulator and a file are exchangeable.

with open_source("run.csv", arm) as source:
    for sample in source:
        estimate = identifier.update(*sample)
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, Self

from armload.errors import SourceError
from armload.inertia import InertialParameters
from armload.recording import Recording, Sample


class Source(ABC):
    """A stream of samples (t, q, dq, tau) of one arm.

    Iterating blocks until the next sample is there and ends when the source has ended. Samples are passed on as
    received: times may jump and values may be missing (NaN); the user decides what a bad sample means.

    Attributes:
        name: what messages call it (a path, an address).
        n: joints.
        rate: nominal samples per second [Hz].
        speed: seconds of samples that come in a second: 1 but for what is replayed slower or faster.
        notes: what is made of what comes, a sentence each.
        paced: whether its clock runs as fast as this machine's: simulated time does not.
        epoch: of a log, time since 1970 at t = 0 [s]; where it has no date, its first sample is at 0. None: samples are
            of now.
    """

    name: str
    n: int
    rate: float
    speed: float = 1.0
    notes: tuple[str, ...] = ()
    paced: bool = True
    epoch: float | None = None

    @abstractmethod
    def __iter__(self) -> Iterator[Sample]:
        """The samples as they come.

        Raises:
            SourceError: the connection was lost.
        """

    def ticking(self, tick: float) -> Iterator[Sample | None]:  # noqa: ARG002
        """The same; None every `tick` seconds while none comes, where the source can tell (`Detached`)."""
        yield from self

    @abstractmethod
    def close(self) -> None:
        """Let go of the robot or the file; nothing happens the second time."""

    def arrived(self) -> float | None:
        """When the sample handed on last had come to this machine, on its monotonic clock [s].

        None: it did not come, but was made when it was asked for, as of a file that is read as fast as possible.
        """
        return None

    def lag(self) -> float:
        """How old the sample handed on last is since it arrived, on the samples' clock [s]; 0 if it never did.

        What waits for a consumer that is too slow has arrived: in a queue, in the ring of `Detached`, or as a sample
        of a replay whose time has come.
        """
        arrived = self.arrived()
        return 0.0 if arrived is None else max(0.0, time.monotonic() - arrived) * self.speed

    def as_it_came(self, sample: Sample) -> Sample:
        """The sample handed on last, before anything was made of it."""
        return sample

    def as_handed_on(self, log: Recording) -> Recording:
        """A log of samples as they came, with what this source makes of them: a tare of its stream."""
        return log

    @property
    def simulated(self) -> bool:
        """Whether it is a simulator, whose payload can be changed (`hold`)."""
        return False

    def hold(self, payload: Any, t: float | None = None) -> float:  # noqa: ARG002
        """See `Simulator.hold`.

        Raises:
            SourceError: it is no simulator.
        """
        raise SourceError(f"{self.name} is no simulator: what it holds cannot be changed from here")

    def truth(self, t: float) -> InertialParameters | None:  # noqa: ARG002
        """The payload at time t, where the source knows it (a simulator does)."""
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
