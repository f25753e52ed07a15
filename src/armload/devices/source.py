"""Where samples come from, live or recorded: one interface, so that a robot, a simulator and a file are exchangeable.

with open_source("run.csv", arm) as source:
    for sample in source:
        estimate = identifier.update(*sample)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from types import TracebackType
from typing import Self

from armload.inertia import InertialParameters
from armload.recording import Sample


class Source(ABC):
    """A stream of samples (t, q, dq, tau) of one arm.

    Iterating blocks until the next sample is there and ends when the source has ended. What a source hands on is what
    the robot said: times may jump and values may be missing (NaN); whoever uses it decides what a bad sample means.

    Attributes:
        name: what messages call it (a path, an address).
        n: joints.
        rate: nominal samples per second [Hz].
    """

    name: str
    n: int
    rate: float

    @abstractmethod
    def __iter__(self) -> Iterator[Sample]:
        """The samples as they come.

        Raises:
            SourceError: the connection was lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of the robot or the file; nothing happens the second time."""

    def truth(self, t: float) -> InertialParameters | None:  # noqa: ARG002
        """The payload at time t, where the source knows it (a simulator does)."""
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
