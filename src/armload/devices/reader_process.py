"""The reader's own process: takes samples from a source, keeps them, and puts them into the ring.

Started by `Detached` as `python -m armload.devices.reader_process RING WAKE STATUS` (three inherited file descriptors).
Its standard input brings one JSON object per line, first what to open, then commands; when it ends, so does the reader:
that is how it learns that whoever started it has ended, in whatever way. RING is the ring, WAKE a pipe that gets one
byte per sample, STATUS a pipe with one JSON object per event: connecting (to a robot; with what to say if nothing
follows), ready, ended, error, or what became of a command.

A sample is recorded before it is handed on: the record has every sample that was used.

Orders are looked for after each sample, by the thread that takes the samples: one of their own would wait for the
interpreter, which a client that holds it gives away for microseconds only. An arm would begin, and stop, seconds late.

Clients print of their own accord: what goes to the descriptors of standard output and standard error goes nowhere here,
unless ARMLOAD_TRACEBACK=1. What Python has to say, such as where a bug is, goes to the starter's standard error.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import select
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from armload.devices.as_json import arm_from_json, parameters_from_json, payloads_from_json
from armload.devices.detached import TO_REST
from armload.devices.opening import open_source, prepare
from armload.devices.recorder import Recorder
from armload.devices.remote_mover import RemoteMover
from armload.devices.ring import Ring
from armload.devices.source import Source
from armload.errors import ArmloadError, PayloadError, SentError, SourceError, SourceSetupError
from armload.runtime.extras import missing

_CALLS = ("read_once", "set_load", "hold")  # what may be asked of a source from outside
_WHO = {"read_once": "a Franka robot", "set_load": "a Franka robot", "hold": "a simulator"}
_ORDERS = ("begin", "stop", "whereabouts", "put")  # and of a mover
# what is wrong with an order itself, where an address names a file, too: no robot that comes later mends it
_NEVER = (SourceSetupError, PayloadError)
_PATIENCE = 1.0  # [s] a source may take to end before the process does
_PR_SET_PDEATHSIG = 1  # of prctl(2): the signal this process gets when the thread that started it ends


class _Orders:
    """JSON objects from a pipe, one a line.

    Attributes:
        ended: whether the other end is closed, and nothing will follow.
    """

    def __init__(self, descriptor: int) -> None:
        self.ended = False
        self._descriptor, self._heard = descriptor, bytearray()
        self._lines: deque[bytearray] = deque()
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)

    def first(self) -> dict[str, Any] | None:
        """Wait for one; None: there is none."""
        while not self._lines:
            if self.ended:
                return None
            self._read()
        return json.loads(self._lines.popleft())

    def waiting(self) -> Iterator[dict[str, Any]]:
        """Those that have come, without waiting."""
        while not self.ended and self._poll.poll(0):
            self._read()
        while self._lines:
            yield json.loads(self._lines.popleft())

    def _read(self) -> None:
        more = os.read(self._descriptor, 1 << 16)
        self.ended = not more
        self._heard += more
        if b"\n" in more:  # what has come of a long one is not copied at each look
            *lines, self._heard = self._heard.split(b"\n")
            self._lines += lines

    def end(self) -> None:
        """Wait until the other end is closed, whatever has not been read."""
        closed = select.poll()
        closed.register(self._descriptor, 0)
        closed.poll()


class _Reader:
    """One run of the process."""

    def __init__(self, ring: int, wake: int, status: int) -> None:
        self.ring = Ring(ring)
        self.wake = wake
        self.status = status
        self.orders = _Orders(sys.stdin.fileno())
        os.set_blocking(wake, False)

    def report(self, **event: Any) -> None:
        with contextlib.suppress(BrokenPipeError):
            os.write(self.status, (json.dumps(event) + "\n").encode())

    def run(self) -> None:
        if (order := self.orders.first()) is None:  # nobody needed it
            return
        arm, options = arm_from_json(order["arm"]), order["options"]
        if options.get("payloads"):
            options["payloads"] = payloads_from_json(options["payloads"])
        try:
            with contextlib.ExitStack() as stack:
                silent = prepare(order["spec"])
                if silent is not None:
                    self.report(event="connecting", message=silent)
                with contextlib.nullcontext() if silent is None else _ended_with_its_starter():
                    source = _opening(order["moves"])(order["spec"], arm, **options)
                stack.enter_context(source)
                record = order["record"]
                recorder = None
                if record is not None:
                    recorder = stack.enter_context(Recorder(record, source.n, arm, source.epoch))
                threading.Thread(target=self.watch, args=(source,), daemon=True).start()
                about = {"name": source.name, "n": source.n, "rate": source.rate, "speed": source.speed}
                self.report(event="ready", **about, notes=source.notes, epoch=source.epoch, paced=source.paced)
                try:
                    self.pass_on(source, recorder)
                except (ArmloadError, OSError) as error:  # a client may try for long to close a link that is lost
                    self.report(event="error", message=str(error), never=isinstance(error, _NEVER))
                    os.close(self.wake)
                    raise
            self.report(event="ended")
        except ModuleNotFoundError as error:
            if (sentence := missing(error)) is None:
                raise
            self.report(event="error", message=sentence, never=True)
        except (ArmloadError, OSError) as error:
            self.report(event="error", message=str(error), never=isinstance(error, _NEVER))

    def pass_on(self, source: Source, recorder: Recorder | None) -> None:
        row = np.empty(self.ring.columns)
        last = 2 + 3 * source.n
        for sample in source:
            arrived = source.arrived()
            arrived = time.monotonic() if arrived is None else arrived
            if recorder is not None:
                recorder.append(sample)
            row[0], row[last - 1] = sample.t, arrived
            row[1 : last - 1] = np.concatenate(sample[1:])
            if isinstance(source, RemoteMover):
                row[last] = source.ended
            self.ring.write(row)
            with contextlib.suppress(BlockingIOError, BrokenPipeError):  # nobody is waiting, or nobody is there
                os.write(self.wake, b".")
            for order in self.orders.waiting():
                self.obey(source, order)
            if self.orders.ended and not (isinstance(source, RemoteMover) and source.comes_to_rest()):
                return

    def obey(self, source: Source, command: dict[str, Any]) -> None:
        method = command["call"]
        try:
            allowed = _ORDERS if isinstance(source, RemoteMover) else _CALLS
            if method not in allowed or not hasattr(source, method):
                raise SourceError(f"{source.name} has no {method}: only {_WHO[method]} has")
            given = command["arguments"]
            if method == "hold":
                given = [parameters_from_json(x) for x in given]
            value = getattr(source, method)(*given)
            self.report(event="answer", number=command["number"], value=value)
        except ArmloadError as error:
            sent = isinstance(error, SentError)
            self.report(event="refused", number=command["number"], message=str(error), sent=sent)

    def watch(self, source: Source) -> None:
        """End the source once its starter has ended, should it wait for a sample, and the process if that does not."""
        self.orders.end()
        if isinstance(source, RemoteMover):  # the arm comes to rest first
            source.over.wait(TO_REST)
        watch = threading.Timer(_PATIENCE, os._exit, [0])  # the record needs no closing
        watch.daemon = True
        watch.start()
        with contextlib.suppress(SourceError):
            source.close()


def _opening(moves: bool) -> Callable[..., Source]:
    """What opens a source, or a mover as one."""
    if not moves:
        return partial(open_source, detached=False)
    from armload.devices.opening_movers import moved_here  # a reader starts without all that movements need

    return moved_here


@contextlib.contextmanager
def _ended_with_its_starter() -> Iterator[None]:
    """While a client connects it may hold the interpreter for a minute: Linux itself ends the reader meanwhile."""
    prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None
    if prctl is not None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        hung_up = select.poll()
        hung_up.register(sys.stdin.fileno(), 0)
        if hung_up.poll(0):  # it ended before it could be followed
            sys.exit()
    try:
        yield
    finally:
        if prctl is not None:
            prctl(_PR_SET_PDEATHSIG, 0)


def _silence_clients() -> None:
    """Keep Python's own standard error, and let the descriptors that compiled clients print to lead nowhere."""
    if os.environ.get("ARMLOAD_TRACEBACK", "") not in ("", "0"):
        return
    sys.stderr = os.fdopen(os.dup(2), "w", buffering=1, errors="backslashreplace")
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)


if __name__ == "__main__":
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # a closed terminal ends the starter, which stops the arm
    _silence_clients()
    _Reader(*map(int, sys.argv[1:4])).run()
