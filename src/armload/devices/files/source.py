"""A recording as a source: as it was, faster or slower, once or again and again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.devices.pace import Pace
from armload.devices.source import Source
from armload.errors import SourceError
from armload.inertia import InertialParameters
from armload.recording import ColumnSpec, Recording, Sample, read_recording


class Replay(Source):
    """The samples of a recording, in its own time.

    >>> log = Recording(np.arange(3) * 0.1, np.zeros((3, 1)), np.zeros((3, 1)), np.ones((3, 1)))
    >>> [round(sample.t, 3) for sample in Replay(log, speed=None)]
    [0.0, 0.1, 0.2]

    Args:
        recording: a recording, or the path of one (`read_recording`).
        arm: whose recording it is, where known: joints are checked and sorted.
        speed: 1: real time; 2: twice as fast; None: as fast as possible.
        loop: again from the start after the end, with times that go on: one sample time lies between end and start.
            The arm jumps there unless it ended where it began.
        payload: what the arm held, where known; returned by `truth`.
        topic: the topic of a bag.
        columns: of a table, where its header leaves them open (`ColumnSpec`).

    Raises:
        RecordingError: the file cannot be read.
        SourceError: the speed is not a positive number, or the torque is not the measured one.
    """

    def __init__(
        self,
        recording: Recording | str | Path,
        arm: Arm | None = None,
        *,
        speed: float | None = 1.0,
        loop: bool = False,
        payload: InertialParameters | None = None,
        topic: str | None = None,
        columns: ColumnSpec | Mapping[str, Any] | None = None,
    ) -> None:
        if not isinstance(recording, Recording):
            recording = read_recording(recording, arm, topic=topic, columns=columns)
        if recording.channel != "measured":
            raise SourceError(
                f"{recording.source} holds {recording.channel} torque: expected measured torque, gravity included"
            )
        self.recording = recording
        self.name = recording.source
        self.n = recording.n
        self.rate = recording.rate
        self.epoch = recording.epoch if recording.date is not None else -float(recording.t[0])
        self.loop = loop
        self._payload = payload
        self._pace = Pace(speed)
        self.speed = speed or 1.0

    def __iter__(self) -> Iterator[Sample]:
        lap = self.recording.duration + float(np.median(np.diff(self.recording.t)))
        turn = 0
        while True:
            for sample in self.recording:
                t = sample.t + turn * lap
                if not self._pace.wait(t):
                    return
                yield sample._replace(t=t) if turn else sample
            if not self.loop:
                return
            turn += 1

    def close(self) -> None:
        """End the replay; an iteration that waits ends at once."""
        self._pace.stop()

    def arrived(self) -> float | None:
        """When the sample handed on last was due; None without a clock."""
        return self._pace.due

    def truth(self, t: float) -> InertialParameters | None:  # noqa: ARG002
        """The payload given, at any time."""
        return self._payload
