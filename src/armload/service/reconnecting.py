"""A source that is opened again whenever it is lost, and never gets older than a second."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

from armload.devices import Detached, Source
from armload.errors import ArmloadError, SourceError, SourceSetupError, one_line
from armload.inertia import InertialParameters
from armload.recording import Sample
from armload.service.backoff import Backoff, Reasons
from armload.service.transit import Transit
from armload.service.unknown import Link

STALLED = 3.0  # [s] without a sample after which the connection counts as lost: two lost TCP packets cost three
BEGUN = 10.0  # [s] the same before its first: a simulator computes for a second, on a busy or small machine for several
BEHIND = 1.0  # [s] a sample may wait before the newest takes its place: saving a state takes a tenth


class Reconnecting(Source):
    """A source in a process of its own that is opened again after its reader was killed, a stall of 3 s, a lost robot.

    The waits between two trials are those of `Backoff`. Where the identifier is more than 1 s behind, it goes on with
    the newest sample, and those in between count as lost. A source that ends by itself, as a log does, has ended.

    Args:
        opens: opens the source.
        first: the connection to begin with; None: it is opened when samples are asked for.
        said: called with a sentence whenever it is lost and whenever it is there again.
        name, n, rate: what is known of it before it is open.
        comes: whether it may be there later, as a robot; a log that cannot be read at first never can.

    Attributes:
        state: "connecting", "streaming", "lost" or "ended". why: it was lost, one sentence; None while it streams.
        connections: how many there were. resumed: when the present one gave its first sample [s, monotonic].
        heard: since when a sample is waited for: the last was handed on, and answered [s, monotonic].
        answering: whether the last is not answered yet, so that nobody waits for another.
    """

    def __init__(
        self,
        opens: Callable[[], Detached],
        first: Detached | None = None,
        said: Callable[[str], None] | None = None,
        *,
        name: str = "",
        n: int = 0,
        rate: float = 0.0,
        comes: bool = True,
    ) -> None:
        self.name, self.n, self.rate, self.speed = name, n, rate, 1.0
        self.state, self.connections = "connecting", 0
        self.why: str | None = None
        self.resumed: float | None = None
        self.heard: float | None = None
        self.answering = False
        self._comes = comes
        self._opens, self._said = opens, said or (lambda _: None)
        self._source: Detached | None = None
        self._arrived: float | None = None
        self._trial: threading.Thread | None = None
        self._made: Detached | Exception | None = None  # by the trial
        self._lost, self._late, self._gone = 0, 0.0, threading.Event()
        self._transit, self._backoff, self._reasons = Transit(), Backoff(), Reasons()
        if first is not None:
            self._take(first)

    @property
    def lost(self) -> int:
        """Samples that were left out, over all connections."""
        return self._lost + (0 if self._source is None else self._source.lost)

    @property
    def present(self) -> Detached | None:
        """The present connection; None while there is none."""
        return self._source

    @property
    def process(self):
        """The present reader's process; None while there is none."""
        return None if self._source is None else self._source.process

    def link(self, before: int = 0) -> Link:
        """What is known of the connection, where `before` others came before the first."""
        return Link(self.state, self.why, self.connections + before, self.resumed, self.heard)

    def __iter__(self) -> Iterator[Sample]:
        return (sample for sample in self.ticking(1.0) if sample is not None)

    def start(self) -> None:
        """Begin to open the source, in a thread; `ticking` does so itself."""
        if self._source is not None or self._trial is not None:
            return

        def trial() -> None:
            try:
                self._made = self._opens()
            except Exception as error:  # a client's own, too: it is told, and tried again
                self._made = error

        self._trial = threading.Thread(target=trial, daemon=True)
        self._trial.start()

    def ticking(self, tick: float) -> Iterator[Sample | None]:
        """The samples of all connections, and None every `tick` seconds while there is none.

        Raises:
            ArmloadError: it cannot be opened at first, and does not come later.
        """
        while not self._gone.is_set():
            if self._source is None:
                yield from self._opened(tick)
                continue
            began, stopped = time.monotonic(), None
            try:
                for sample in self._source.ticking(tick):
                    if self._gone.is_set():
                        return
                    if sample is None:
                        silent = time.monotonic() - (began if self.heard is None else max(began, self.heard))
                        longest = BEGUN if self.resumed is None else STALLED
                        if silent > longest:
                            raise SourceError(f"{self.name} has sent nothing for {longest:g} s")
                        yield None
                        continue
                    self._noted(sample)
                    self.answering = True
                    yield sample
                    self.answering, self.heard = False, time.monotonic()
            except (ArmloadError, OSError) as error:
                stopped = _reason(error)
            if self._gone.is_set():
                return
            if stopped is None:
                self.state = "ended"
                return
            self.state, self.why = "lost", stopped
            wait = self._backoff.failed(0.0 if self.resumed is None else time.monotonic() - began)
            self._tell(stopped, wait, "opened")
            yield from self._let_go(wait, tick)

    def close(self) -> None:
        """End it; who waits for a sample sees its end."""
        self._gone.set()
        if self._source is not None:
            self._source.close()

    def arrived(self) -> float | None:
        """When the last sample left the robot, as far as the shortest way tells (`Transit`), monotonic [s]."""
        return self._arrived

    def truth(self, t: float) -> InertialParameters | None:
        """What the source knows."""
        return None if self._source is None else self._source.truth(t)

    def _take(self, source: Detached) -> None:
        self._source, self.connections = source, self.connections + 1
        self.name, self.n, self.rate, self.speed = source.name, source.n, source.rate, source.speed
        self.notes, self.resumed = source.notes, None

    def _noted(self, sample: Sample) -> None:
        assert self._source is not None
        now, arrived = time.monotonic(), self._source.arrived()
        assert arrived is not None
        if self.state != "streaming":
            if self.state == "lost" or self.connections > 1:
                self._said(f"{self.name} sends samples again")
            self.state, self.why, self.resumed = "streaming", None, now
        paced = self._source.paced
        self._late = self._transit.late(sample.t / self.speed, arrived) if paced else 0.0
        self.heard, self._arrived = now, arrived - self._late
        if now - arrived > BEHIND:
            self._source.leave()

    def _let_go(self, wait: float, tick: float) -> Iterator[None]:
        source, self._source = self._source, None
        assert source is not None
        self._lost += source.lost
        thread = threading.Thread(target=source.close, daemon=True)  # a reader that hangs takes 3 s
        thread.start()
        yield from _joined(thread, tick)
        yield from self._waited(wait, tick)

    def _opened(self, tick: float) -> Iterator[None]:
        """Open it beside, as that may take ten seconds."""
        self.start()
        assert self._trial is not None
        yield from _joined(self._trial, tick)
        made, self._trial, self._made = self._made, None, None
        if isinstance(made, Detached):
            if self._gone.is_set():
                made.close()
            self._take(made)
            self._transit = Transit()
        elif isinstance(made, ArmloadError) and not self.connections and self._never(made):
            raise made
        else:
            self.state, self.why = "lost", _reason(made)
            wait = self._backoff.failed(0.0)
            self._tell(self.why, wait, "tried")
            yield from self._waited(wait, tick)

    def _never(self, error: ArmloadError) -> bool:
        """Whether what could not be opened at first never can be: its client is not installed, or it is a log."""
        return not self._comes or isinstance(error, SourceSetupError)

    def _tell(self, why: str, wait: float, what: str) -> None:
        if self._reasons.due(why, wait, time.monotonic()):
            self._said(f"{why}; it is {what} again in {wait:.1f} s")

    def _waited(self, wait: float, tick: float) -> Iterator[None]:
        until = time.monotonic() + wait
        while (left := until - time.monotonic()) > 0 and not self._gone.wait(min(left, tick)):
            yield None


def _reason(error: Exception | None) -> str:
    """Why a source was lost, on one line, without the advice that is followed here."""
    why = "it cannot be opened" if error is None else one_line(error)
    return why.removesuffix(": open the source again")


def _joined(thread: threading.Thread, tick: float) -> Iterator[None]:
    """None every tick until a thread has ended."""
    while thread.is_alive():
        thread.join(tick)
        if thread.is_alive():
            yield None
