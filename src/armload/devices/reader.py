"""The reader's process as its starter sees it: the ring, the pipes and the process, before it is told what to open."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from typing import Any

from armload.devices.ring import Ring
from armload.errors import SourceError


def columns_of(n: int, moves: bool = False) -> int:
    """Numbers of a sample in the ring: t, q, dq, tau, when it arrived, and of a mover how many movements ended."""
    return 2 + 3 * n + moves


class Reader:
    """A reader (`devices.reader_process`) that waits for its order; importing what it needs takes most of its start.

    Args:
        columns: numbers of a sample in the ring (`columns_of`). capacity: samples the ring holds.

    Attributes:
        process: it. ring: what it writes. wake: descriptor that can be read once a sample has come. status: of events.
    """

    def __init__(self, columns: int, capacity: int = 8192) -> None:
        self.ring = Ring.create(columns, capacity)
        self.wake, wake = os.pipe()
        self.status, status = os.pipe()
        theirs = (self.ring.descriptor, wake, status)
        # Ctrl-C goes to the whole group, and the one who started the reader decides: it is blocked for the reader, even
        # before its first line. A signal that comes meanwhile is ours when the mask is taken off
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "armload.devices.reader_process", *map(str, theirs)],
                stdin=subprocess.PIPE,
                stdout=2,  # what a vendor's client prints must not mix with our own output
                pass_fds=theirs,
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            os.close(wake)
            os.close(status)

    def fits(self, columns: int, capacity: int) -> bool:
        """Whether it still waits, and its ring is such a one."""
        return self.process.poll() is None and (self.ring.columns, self.ring.capacity) == (columns, capacity)

    def send(self, order: dict[str, Any], name: str) -> None:
        """Give it an order; name: of the source, for the message.

        Raises:
            SourceError: it has ended.
        """
        stdin = self.process.stdin
        assert stdin is not None
        try:
            stdin.write((json.dumps(order) + "\n").encode())
            stdin.flush()
        except (OSError, ValueError):
            raise SourceError(f"the reader of {name} has ended: open the source again") from None

    def end(self, seconds: float) -> None:
        """End its standard input, which ends it; kill it if it has not ended after so many seconds."""
        stdin = self.process.stdin
        assert stdin is not None
        with contextlib.suppress(OSError):
            stdin.close()
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def release(self) -> None:
        """Let go of ring and pipes, once it has ended and nobody reads them any more."""
        os.close(self.wake)
        os.close(self.status)
        self.ring.close()
