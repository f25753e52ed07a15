"""Ctrl-C held back: while an arm moves, until it is at rest; while modules load that would swallow it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """What was heard.

    Attributes:
        name: of the first signal; None: none came.
    """

    name: str | None = None

    def heard(self, number: int, _: FrameType | None) -> None:
        """Take note of a signal."""
        self.name = self.name or signal.Signals(number).name


@contextmanager
def held_back() -> Iterator[Interruption]:
    """Within, Ctrl-C (SIGINT), SIGTERM and SIGHUP are only noted; KeyboardInterrupt is raised at the end.

    In another thread than the main one, where signals do not come, nothing is changed.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    before = {number: signal.signal(number, interruption.heard) for number in _SIGNALS}
    try:
        yield interruption
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if interruption.name is not None:
            raise KeyboardInterrupt


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """Within, SIGTERM, by which a service or a container is stopped, ends as Ctrl-C does: what is left to do is done.

    In another thread than the main one, where signals do not come, nothing is changed.
    """

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
