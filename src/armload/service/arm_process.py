"""One arm's own process: reads its source, identifies, saves its state, and says every tenth of a second what it knows.

Started by `Service` as `python -m armload.service.arm_process`. The first line of standard input says what to do, or
what to be ready for ({"ready": …}, see `ready`; a later line then says what to do). When standard input ends, the
process saves and ends, however whoever started it has ended. Standard output has one JSON object per line: an answer
(with "told", when it was made on the monotonic clock), or {"note": …}.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

from armload.arms import Arm
from armload.devices import Detached, Reader, Steadied, controller_of
from armload.devices.reader import columns_of
from armload.devices.recorder import next_free
from armload.errors import ArmloadError
from armload.identification.tare_age import age_of, in_words
from armload.online import OnlineEstimate
from armload.posterior import load_profile
from armload.recording import check_own_measurements, read_recording
from armload.runtime.atomic import kept_alone
from armload.runtime.compiling import COMPILING, compiling
from armload.runtime.finite import finite
from armload.service.absence import Absence
from armload.service.catching_up import CatchingUp
from armload.service.feedback import Feedback
from armload.service.ready import ready
from armload.service.reconnecting import Reconnecting
from armload.service.saved_state import CHANGED, SavedState
from armload.service.session import TICK, Session
from armload.service.settings import ArmSettings
from armload.service.unknown import Unknown, Why, why_unknown

SAVE_EVERY = 60.0  # [s] of what a kill may cost; saving takes the stream a tenth of a second
_ENDS = 15.0  # [s] the process of a service that was killed may take to save and end: seconds on busy cores


class ArmProcess:
    """The run of one process.

    Args:
        settings: of the arm. every: [s] between two lines of the service, which leaves out some above `TICK`.
        readers: that were started ahead. since: [s] for which the service has run, its processes together.
    """

    def __init__(self, settings: ArmSettings, every: float, readers: Sequence[Reader] = (), since: float = 0.0) -> None:
        # alarms, and whoever asks the endpoint, need to know at any moment
        self.settings, self.every, self._reader = settings, min(every, TICK), None
        # of the files as they are now: one written anew is not what the stream goes by
        self.state = SavedState(settings.state, lambda text: self.note(text))
        self._told = -float("inf")
        self._line, self._late = threading.Lock(), CatchingUp()
        self._since = 0.0 if settings.replays else since  # what its tare has, as every replay begins its log anew
        self.arm = self._made_arm()
        for reader in readers:
            if reader.ring.columns == columns_of(self.arm.n):
                self._reader = reader
            else:
                reader.end(0.0)
        comes = "://" in settings.source
        self.source = Reconnecting(self._opens, said=self.note, name=settings.source, n=self.arm.n, comes=comes)
        self.session: Session | None = None
        self._feedback: Feedback | None = None

    def run(self) -> None:
        """Until the source or standard input ends."""
        path = self.state.path  # which another process would write over
        with self._speaking(), contextlib.nullcontext() if path is None else kept_alone(path, _ENDS):
            self.source.start()  # it is opened while the state is read
            self.session = session = self._made_session()
            saved = time.monotonic()
            try:
                if self.settings.apply is not None:
                    self._feedback = self._made_feedback()
                absence = Absence()
                for _ in session.estimates():
                    now = time.monotonic()
                    if (gone := absence.ended(session.sample, now)) is not None:
                        self.note(f"no sample for {in_words(gone)}, {CHANGED}: begun anew")
                        session.reset()
                    if now - self._told >= 0.999 * self.every:
                        self._tell(session, now)
                    if now - saved >= SAVE_EVERY:
                        saved = now
                        self.state.save(session)
                if session.estimate is not None:
                    self._tell(session, time.monotonic())
                    self.state.save(session)
            finally:
                if self._feedback is not None:
                    self._feedback.close()
                session.close()

    def note(self, text: str) -> None:
        """A sentence for whoever reads the log of the service."""
        self._write({"note": text})

    @contextlib.contextmanager
    def _speaking(self) -> Iterator[None]:
        """Within the block something is said while the loop says nothing: before the first answer, and compiling."""
        ended = threading.Event()

        def speak() -> None:
            while not ended.wait(TICK):
                now, session = time.monotonic(), self.session
                if session is None:
                    self._say(None, self._beginning())
                elif session.estimate is None or (now - self._told > 2.0 * TICK and compiling()):
                    self._tell(session, now)

        self._say(None, self._beginning())
        threading.Thread(target=speak, daemon=True).start()
        try:
            yield
        finally:
            ended.set()

    def _beginning(self) -> Why:
        """Why there is no answer before there is a session."""
        if compiling():
            return Why(Unknown.COMPILING, COMPILING)
        return Why(Unknown.STARTING, "the source is being opened")

    def _tell(self, session: Session, now: float) -> None:
        self._told = now
        source, estimate = self.source, session.as_of_now()
        link = source.link(before=self.state.continued)  # since it was saved the payload may have been exchanged
        if source.answering:  # how long that took is in its lag
            link = link._replace(heard=now)
        compiles = self._late.why(None if estimate is None else estimate.lag, now)
        why = why_unknown(estimate, link, now, session.identifier.trouble, session.doubt, compiles)
        if self._feedback is not None and estimate is not None and session.sample is not None:
            self._feedback.offer(estimate, session.sample.q, why is None, session.identifier.doubts)
        self._say(estimate, why)

    def _say(self, estimate: OnlineEstimate | None, why: Why | None) -> None:
        source, now = self.source, time.monotonic()
        head = {
            "arm": self.settings.name,
            "robot": self.arm.name,
            "told": now,
            "known": why is None,
            "unknown": None if why is None else why.reason.value,
            "why": None if why is None else why.text,
            "source": source.name,
            "connection": source.state,
            "connections": source.connections,
            "lost": source.lost,
            "saved": self.state.age(now),
            "arm_changed": None if self.session is None else self.session.identifier.arm_changed,
        }
        if self._feedback is not None:
            head["applied"] = self._feedback.applied()
        if estimate is None:
            self._write({**head, "age": None, "lag": None, "mass": None})
            return
        self._write({**head, **estimate.to_dict()})

    def _write(self, fields: dict[str, Any]) -> None:
        data = (json.dumps(finite(fields), allow_nan=False) + "\n").encode()
        with self._line, contextlib.suppress(BrokenPipeError):
            while data:
                data = data[os.write(1, data) :]

    def _opens(self) -> Detached:
        settings = self.settings
        record = None if settings.record is None else next_free(settings.record)
        more: dict[str, Any] = {} if settings.rate is None else {"rate": settings.rate}
        reader, self._reader = self._reader, None
        return Detached(settings.source, self.arm, record=record, speed=1.0, loop=settings.loop, reader=reader, **more)

    def _made_arm(self) -> Arm:
        bare = self.settings.bare_arm()
        tool = self.settings.tool_on(bare)
        if tool is None:
            return bare
        from armload.identification import with_tool

        return with_tool(bare, tool)

    def _made_feedback(self) -> Feedback:
        bare = self.settings.bare_arm()
        controller = controller_of(self.settings.source, bare, lambda: self.source.present)
        feedback = Feedback(bare, controller, self.settings.mounted_on(bare), self.note)
        feedback.start()
        return feedback

    def _made_session(self) -> Session:
        settings = self.settings
        profile = None if settings.profile is None else load_profile(settings.profile)
        known = settings.known_on(self.arm)
        identifier = self.state.restored(self.arm, settings.method, profile, known=known, every=self.every)
        tare = None if settings.tare is None else read_recording(settings.tare, self.arm)
        if tare is not None and settings.replays:
            check_own_measurements(read_recording(settings.source, self.arm), tare)
        began = time.time() if "://" in settings.source else None
        age, aged = age_of(tare, began, settings.tare_age, self._since)
        for note in aged if identifier is None else ():  # a state that goes on has its tare's age
            self.note(note)
        source = Steadied(self.source) if settings.steady else self.source
        about = (tare, settings.method, self.note, profile, identifier)
        return Session(source, self.arm, *about, known=known, every=self.every, tare_age=age)


def main() -> None:
    """Read the order, run, and end when standard input does."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # go to the whole group: whoever started this decides
        signal.signal(number, signal.SIG_IGN)
    readers: Sequence[Reader] = ()
    try:
        if not (line := _line()):
            return
        order = json.loads(line)
        if "ready" in order:
            readers = ready(order["ready"])
            if not (line := _line()):  # nobody needed it
                return
            order = json.loads(line)
        facts = order["arm"]
        facts["gravity"] = None if facts["gravity"] is None else tuple(facts["gravity"])
        process = ArmProcess(ArmSettings(**facts), order["every"], readers, order.get("since", 0.0))

        def listen() -> None:
            while os.read(0, 1 << 12):
                pass
            process.source.close()

        threading.Thread(target=listen, daemon=True).start()
        process.run()
    except (ArmloadError, OSError) as error:
        data = json.dumps({"error": str(error)}) + "\n"
        with contextlib.suppress(BrokenPipeError):
            os.write(1, data.encode())
        sys.exit(2)


def _line() -> bytes:
    line = b""
    while not line.endswith(b"\n") and (more := os.read(0, 1)):
        line += more
    return line


if __name__ == "__main__":
    main()
