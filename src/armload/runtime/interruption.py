"""Ctrl-C held back: while an arm moves, compiled code runs, or modules load that would swallow it, and from processes
that are ended by the one that began them; other signals that end as it does."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from types import FrameType

Handler = Callable[[int, FrameType | None], object]
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

    SIGHUP is ignored where it was (nohup): the program is to outlive its terminal, also while an arm moves. The others
    are noted all the same: what a shell runs in the background ignores Ctrl-C, but whoever sends it wants the arm to
    stop.
    """
    interruption = Interruption()
    ignored = (signal.SIGHUP,) if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN else ()
    try:
        with _handled([number for number in _SIGNALS if number not in ignored], interruption.heard):
            yield interruption
    finally:
        if interruption.name is not None:
            raise KeyboardInterrupt


@contextmanager
def put_off() -> Iterator[None]:
    """Within, what would interrupt is only noted; who handles it hears of it at the end.

    For compiled code with threads of its own: a Python that ends while they work ends by SIGSEGV. A signal that is
    ignored stays so, and one that ends the process at once does.
    """
    heard: list[int] = []
    handlers: dict[int, Handler] = {n: handler for n in _SIGNALS if callable(handler := signal.getsignal(n))}
    try:
        with _handled(handlers, lambda number, _: heard.append(number)):
            yield
    finally:
        for number in heard:
            handlers[number](number, None)


@contextmanager
def _handled(numbers: Iterable[int], handler: Handler) -> Iterator[None]:
    """Within, a handler hears of signals; in another thread than the main one, where they do not come, nothing does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, other in before.items():
            signal.signal(number, other)


@contextmanager
def unheard_by_processes() -> Iterator[None]:
    """Within, processes and threads that are begun never hear Ctrl-C, nor SIGHUP; whoever begins them does at the end.

    A terminal sends them to every process of a command. The first of them ends the others, which would only print where
    each of them was; and the trackers of their resources, which are to outlive them, would be missed.
    """
    from multiprocessing import resource_tracker

    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()  # it unblocks Ctrl-C where it is begun
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def ended_by_sigterm() -> AbstractContextManager[None]:
    """Within, SIGTERM, by which a service or a container is stopped, ends as Ctrl-C does: what is left to do is done.

    In another thread than the main one, where signals do not come, nothing is changed.
    """
    return _ended_by(signal.SIGTERM, once=False)


def ended_by_hangup() -> AbstractContextManager[None]:
    """The same of SIGHUP, a terminal that is closed; where it is ignored (nohup), it goes on being so.

    Only the first one counts: the shell passes on what the terminal has sent, and would break off what is being ended.
    """
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        return nullcontext()
    return _ended_by(signal.SIGHUP, once=True)


@contextmanager
def _ended_by(number: signal.Signals, once: bool) -> Iterator[None]:
    def interrupt(*_: object) -> None:
        if once:
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt

    with _handled([number], interrupt):
        yield
