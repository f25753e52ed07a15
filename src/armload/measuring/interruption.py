"""Ctrl-C while an arm moves: the arm is stopped first, and the interruption comes when it is at rest."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from armload.devices.mover import Mover

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stopped_first(mover: Mover) -> Iterator[None]:
    """Within, Ctrl-C (SIGINT), SIGTERM and SIGHUP only stop the arm; KeyboardInterrupt is raised at the end.

    In another thread than the main one, where signals do not come, nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []

    def stop(number: int, _: FrameType | None) -> None:
        heard.append(number)
        mover.stop(f"interrupted by {signal.Signals(number).name}")

    before = {number: signal.signal(number, stop) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if heard:
            raise KeyboardInterrupt
