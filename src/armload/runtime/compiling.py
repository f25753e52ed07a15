"""Whether this process compiles functions at present, as numba says: whatever needs them waits meanwhile."""

from __future__ import annotations

import logging
import math
import threading
import time
from functools import cache
from typing import Any

COMPILING = "compiling for this machine, which is done once and takes a while"
_AFTER = 1.0  # [s] after it, what has waited is still late, or the next function is compiled


class Compilations:
    """Those of a process that are under way; threads may compile at once, and one function while another is.

    >>> compilations = Compilations()
    >>> compilations.begin()
    >>> compilations.under_way
    True
    """

    def __init__(self) -> None:
        self._lock, self._count, self._ended = threading.Lock(), 0, -math.inf

    def begin(self) -> None:
        """A function is compiled from now on."""
        with self._lock:
            self._count += 1

    def end(self) -> None:
        """It is compiled."""
        with self._lock:
            self._count, self._ended = self._count - 1, time.monotonic()

    @property
    def under_way(self) -> bool:
        """Whether a function is compiled, or was within the last second."""
        return self._count > 0 or time.monotonic() - self._ended < _AFTER


_ours = Compilations()


def compiling() -> bool:
    """Whether a function of armload is compiled in this process, or was within the last second."""
    return _ours.under_way


@cache
def notice_compiling() -> None:
    """Hear of numba what it compiles of armload, and log it once; what is found on disk is not compiled."""
    from numba.core import event

    class Listener(event.Listener):
        logged = False

        def on_start(self, event: Any) -> None:
            if _of_armload(event):
                _ours.begin()
                if not self.logged:
                    self.logged = True
                    logging.getLogger("armload").info(COMPILING)

        def on_end(self, event: Any) -> None:
            if _of_armload(event):
                _ours.end()

    event.register("numba:compile", Listener())


def _of_armload(event: Any) -> bool:
    return event.data["dispatcher"].py_func.__module__.startswith("armload.")
