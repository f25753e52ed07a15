"""A connection that is listened to for so long, and no longer: byte by byte the other side could hold it for ever."""

from __future__ import annotations

import io
import socket
import time
from typing import Any


class InTime(io.RawIOBase):
    """What comes over a connection within so many seconds [s] in all, whatever its pauses.

    Args:
        connection: which stays open. patience: [s] from now on.

    Raises:
        TimeoutError: by a read that takes longer.
    """

    def __init__(self, connection: socket.socket, patience: float) -> None:
        self._connection, self._until = connection, time.monotonic() + patience

    def readable(self) -> bool:
        """It is."""
        return True

    def readinto(self, buffer: Any) -> int:
        """What has come; 0 at the end."""
        left = self._until - time.monotonic()
        if left <= 0.0:
            raise TimeoutError("timed out")
        self._connection.settimeout(left)
        return self._connection.recv_into(buffer)
