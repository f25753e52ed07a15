"""A source whose reader lives in its own process, so that neither can delay or end the other.

`read_once` of Franka's Python client holds the interpreter while it waits: next to a busy thread it falls to 655
samples per second. So the reader has a process of its own and puts samples into a ring in shared memory
(`devices.ring`); it also writes the record, where one is asked for. A byte through a pipe wakes whoever waits for a
sample; the pipe's end says that the reader is gone, at once and whatever ended it. The other way round the reader's
standard input ends with this process. The shared memory has no name and needs no clearing away.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.devices.as_json import arm_to_json, parameters_to_json, payloads_to_json
from armload.devices.franka.source import FrankaStatus
from armload.devices.reader import Reader, columns_of
from armload.devices.ring import RingReader
from armload.devices.source import Source
from armload.errors import SourceError, SourceSetupError
from armload.inertia import InertialParameters
from armload.recording import Sample

_TO_START = 60.0  # [s] to import what is needed, and to open what is no robot
# [s] until a robot has taken the connection: it needs milliseconds, two lost packets cost three seconds. The clients
# wait a minute and longer. The limit is here, and nothing tries the robot's port beforehand, because a Franka takes one
# connection at a time: it may still be busy with the trial when the client comes. What is broken off is the client's
# own connection, as when any client is ended.
_TO_CONNECT = 10.0
_TO_OBEY = 10.0  # [s]
_TO_END = 3.0  # [s]
TO_REST = 6.0  # [s] a moving arm may take to come to rest, which is longer than any braking time that is tried


class Refused(SourceError):
    """What a reader was asked for and did not do; sent: the robot was told all the same (`SentError`)."""

    def __init__(self, message: str, sent: bool) -> None:
        super().__init__(message)
        self.sent = sent


class Detached(Source):
    """Any source of `open_source`, read in another process.

    A consumer that is slower than the source loses the oldest samples of the ring (`lost` counts them); the record has
    them all. Files and simulators therefore run on the clock: speed None (as fast as possible) is refused.

    Args:
        spec: what to open, see `open_source`.
        arm: whose samples they are.
        record: a `.csv` or `.mcap` file to keep every sample in (`Recorder`), written by the reader's process.
        capacity: samples the ring holds.
        twin: the same source, opened here and never run, where it knows the truth (a simulator).
        reader: one that was started ahead; None, or one that does not fit: another is started.
        options: of `open_source`, as JSON can hold them.

    Attributes:
        process: the reader's process.

    Raises:
        SourceError: the source cannot be opened; the message is the reader's. SourceSetupError: and never can be, as
            it was asked for.
    """

    _moves = False  # whether the process moves the arm, too

    def __init__(
        self,
        spec: str,
        arm: Arm,
        *,
        record: str | Path | None = None,
        capacity: int = 8192,
        twin: Source | None = None,
        reader: Reader | None = None,
        **options: Any,
    ) -> None:
        if options.get("speed", 1.0) is None:
            raise SourceError(
                f"{spec} as fast as possible would overrun the ring of its reader: give a speed, or read it in this "
                "process (detached=False)"
            )
        self.name = spec
        self._closed, self._closing = False, threading.RLock()  # held until its reader has ended
        self._twin = twin
        self._waiting = threading.Lock()  # held while the ring and the pipes are in use
        columns = columns_of(arm.n, self._moves)
        if reader is None or not reader.fits(columns, capacity):
            reader = Reader(columns, capacity)
        self._spawned, self._ring, self._wake, self._status = reader, reader.ring, reader.wake, reader.status
        self._reader = RingReader(reader.ring)
        self._received = b""
        self._listening = threading.Lock()  # held while events are read
        self._arrived: float | None = None
        self._left, self._leaves = 0, False  # samples left out because newer ones were asked for; whether that is asked
        self._last: dict[str, Any] | None = None  # how it ended
        self._calls = 0
        if options.get("payloads"):
            options["payloads"] = payloads_to_json(options["payloads"])
        kept = None if record is None else str(record)
        order = {"spec": spec, "arm": arm_to_json(arm), "options": options, "record": kept, "moves": self._moves}
        self._spawned.send(order, self.name)
        connecting = False
        try:
            event = self._event(_TO_START)
            if connecting := event["event"] == "connecting":
                event = self._event(_TO_CONNECT, event["message"])
            if event["event"] != "ready":
                kind = SourceSetupError if event.get("never") else SourceError
                raise kind(event.get("message", f"{spec} ended before its first sample"))
        except BaseException:
            if connecting:  # the client holds the reader's interpreter: it cannot hear that it should end
                self.process.kill()
            self.close()
            raise
        self.name, self.n, self.rate, self.speed = event["name"], event["n"], event["rate"], event["speed"]
        self.notes, self.epoch, self.paced = tuple(event["notes"]), event["epoch"], event["paced"]

    @property
    def process(self) -> subprocess.Popen[bytes]:
        """The reader's process."""
        return self._spawned.process

    @property
    def lost(self) -> int:
        """Samples this process was too slow to take, and those left out by `leave`."""
        return self._reader.lost + self._left

    def leave(self) -> None:
        """Go on with the newest sample: what waits is left out, and counted among the lost."""
        self._leaves = True

    def __iter__(self) -> Iterator[Sample]:
        return (sample for sample in self.ticking(None) if sample is not None)

    def ticking(self, tick: float | None) -> Iterator[Sample | None]:
        """The samples as they come, and None whenever none has come for `tick` seconds; tick None: never.

        Raises:
            SourceError: the reader ended, or its source was lost.
        """
        n = self.n
        while True:
            silent = False
            with self._waiting:
                if self._closed:
                    return
                rows = self._reader.read()
                if not len(rows):
                    silent = tick is not None and not select.select([self._wake], [], [], tick)[0]
                    if not silent and not os.read(self._wake, 1 << 16) and self._reader.next >= self._ring.written:
                        return self._raise_error_of_end()
            if silent:
                yield None
            for k, row in enumerate(rows):
                self._note(row[3 * n + 1 :])
                yield Sample(float(row[0]), row[1 : n + 1], row[n + 1 : 2 * n + 1], row[2 * n + 1 : 3 * n + 1])
                if self._leaves:
                    self._leaves = False
                    self._left += len(rows) - k - 1
                    with self._waiting:
                        self._left += 0 if self._closed else self._reader.leave()
                    break

    def _note(self, beside: NDArray[np.float64]) -> None:
        """Keep what comes beside a sample."""
        self._arrived = float(beside[0])

    def arrived(self) -> float | None:
        """When the sample handed on last came to the reader; one clock runs for all processes of a machine."""
        return self._arrived

    def read_once(self) -> FrankaStatus:
        """See `FrankaSource.read_once`; waits for the answer.

        Raises:
            SourceError: the source is no Franka robot, or did not answer.
        """
        return FrankaStatus(*self._call("read_once"))

    def set_load(self, mass: float, com: ArrayLike, inertia: ArrayLike) -> None:
        """See `FrankaSource.set_load`, over the reader's connection: a robot takes no second one.

        Raises:
            SourceError: the source has no load to set, the robot refused it, or did not answer.
        """
        self._call("set_load", float(mass), np.ravel(com).tolist(), np.ravel(inertia).tolist())

    @property
    def simulated(self) -> bool:
        """Whether the source is a simulator."""
        return self._twin is not None

    def hold(self, payload: InertialParameters, t: float | None = None) -> float:
        """See `Simulator.hold`, from the next sample on; the twin holds it, too.

        Raises:
            SourceError: the source is no simulator, or did not answer.
        """
        t = float(self._call("hold", parameters_to_json(payload)))
        if self._twin is not None:
            self._twin.hold(payload, t)
        return t

    def truth(self, t: float) -> InertialParameters | None:
        """What the source knows."""
        return None if self._twin is None else self._twin.truth(t)

    def close(self) -> None:
        """End the reader's process and let go of the memory; whoever closes it meanwhile waits for that, too."""
        with self._closing:
            if self._closed:
                return
            self._closed = True
            self._spawned.end(_TO_END + self._moves * TO_REST)
            with self._waiting:  # whoever waited for a sample has seen the pipe end
                self._spawned.release()

    def _raise_error_of_end(self) -> None:
        """Read events up to the last; SourceError if that is an error."""
        try:
            while self._last is None:
                self._event(_TO_END)
        except SourceError:
            if self._closed:  # it was made to end
                return
            raise
        if self._last["event"] == "error" and not self._closed:
            raise SourceError(self._last["message"])

    def _call(self, method: str, *arguments: Any) -> Any:
        self._calls += 1
        number = self._calls
        self._spawned.send({"call": method, "number": number, "arguments": arguments}, self.name)
        event = self._event(_TO_OBEY)
        while event is not self._last and event.get("number") != number:  # a call that was given up is answered late
            event = self._event(_TO_OBEY)
        if event["event"] == "refused":
            raise Refused(event["message"], event["sent"])
        if event["event"] != "answer":
            raise SourceError(event.get("message", f"{self.name} ended before it answered"))
        return event["value"]

    def _event(self, seconds: float, silent: str | None = None) -> dict[str, Any]:
        """The reader's next event; after the last one, the last one again. silent: the error if none comes."""
        until = time.monotonic() + seconds
        with self._listening:
            if self._last is not None:
                return self._last
            while b"\n" not in self._received:
                left = until - time.monotonic()
                if left <= 0 or not select.select([self._status], [], [], left)[0]:
                    raise SourceError(silent or f"the reader of {self.name} did not answer within {seconds:.0f} s")
                received = os.read(self._status, 1 << 16)
                if not received:
                    how = self.process.wait()
                    ended = f"was killed by signal {-how}" if how < 0 else f"ended with exit code {how}"
                    raise SourceError(f"the reader of {self.name} {ended}: open the source again")
                self._received += received
            line, self._received = self._received.split(b"\n", 1)
            event = json.loads(line)
            if event["event"] in ("ended", "error"):
                self._last = event
            return event
