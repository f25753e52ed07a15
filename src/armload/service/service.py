"""Several arms, one supervised process each; what they say goes on, with its true age, and alarms are made of it."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from armload.arms import arm, rated_mass
from armload.service.alarms import Alarm, Alarms
from armload.service.backoff import Backoff, Reasons
from armload.service.mqtt import Mqtt
from armload.service.settings import ArmSettings, ServiceSettings
from armload.service.spare import Spare, order
from armload.service.unknown import Unknown
from armload.service.webhook import Webhook

HUNG = 10.0  # [s] without a line after which an arm's process is killed: it speaks ten times a second
HUNG_COMPILING = 300.0  # [s] the same until its first answer: on a slow machine compiling takes minutes
_LOOK = 0.1  # [s] between two looks at the processes
_BEGINNING = (Unknown.STARTING, Unknown.COMPILING)  # of an arm whose start a spare process would slow down
_TO_END = 6.0  # [s] a process may take to save and end: its reader may take three

Listener = Callable[[dict[str, Any]], None]


class Service:
    """All arms of the settings, until `close`.

    An arm's process that ends, or says nothing for 10 s, is started again at once, then after 0.1, 0.2, … 5 s, and goes
    on from its saved state. What it needs not know: other arms, the endpoint, alarms.

    Args:
        settings: arms, and whom to tell. note: called with each sentence for a log.

    Attributes:
        processes: of each arm, by its name, while it runs.
        error: why the service cannot go on; None: it does.
    """

    def __init__(self, settings: ServiceSettings, note: Callable[[str], None] | None = None) -> None:
        self.settings, self._log = settings, note or (lambda _: None)
        self.names = [arm.name for arm in settings.arms]
        self.error: str | None = None
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._alarms = {a.name: Alarms(a.name, _rating(a), a.com_range) for a in settings.arms}
        self._answers = {a.name: _starting(a) for a in settings.arms}
        self._began = time.monotonic()
        self._lines = dict.fromkeys(self.names, -math.inf)  # when the last line of each was of [s, monotonic]
        self._heard = dict.fromkeys(self.names, time.monotonic())
        self._noted = dict.fromkeys(self.names, "")  # the last sentence of each
        self._restarts = dict.fromkeys(self.names, 0)
        self._ended: set[str] = set()
        self._spare = Spare(settings.arms, settings.spare)
        self._listeners: list[Listener] = []
        self._hung: dict[str, subprocess.Popen[bytes]] = {}  # the last that was ended because it said nothing
        self._state, self._gone = threading.RLock(), threading.Event()
        self._receivers: list[Webhook | Mqtt] = []  # of alarms
        if settings.webhook is not None:
            self._receivers.append(Webhook(settings.webhook, settings.headers))
        if settings.mqtt is not None:
            self._receivers.append(Mqtt(settings.mqtt))
        self._threads = [
            threading.Thread(target=self._keep, args=(a,), name=f"armload-{a.name}", daemon=True) for a in settings.arms
        ]

    def run(self, duration: float | None = None) -> None:
        """Until all sources have ended, `close`, or so many seconds [s] have passed."""
        for thread in self._threads:
            thread.start()
        until = None if duration is None else time.monotonic() + duration
        while not self._gone.wait(_LOOK) and len(self._ended) < len(self.names):
            if self.error is not None or (until is not None and time.monotonic() > until):
                break
            self._look()
            if all(self.answer(name)["unknown"] not in _BEGINNING for name in self.names):
                self._spare.prepare()

    def stop(self) -> None:
        """Make `run` return; from any thread."""
        self._gone.set()

    def close(self) -> None:
        """Let all processes save and end."""
        self._gone.set()
        self._spare.close()
        for process in list(self.processes.values()):
            _hang_up(process)
        until = time.monotonic() + _TO_END
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, until - time.monotonic()))
        for process in list(self.processes.values()):
            process.kill()
        for receiver in self._receivers:
            receiver.close()

    def answer(self, name: str) -> dict[str, Any]:
        """An arm's newest answer, as old as it is now."""
        with self._state:
            return self._as_of_now(dict(self._answers[name]), name)

    @contextmanager
    def heard_by(self, listener: Listener) -> Iterator[None]:
        """Within the block a listener hears every line: answers, and alarms (which have "alarm"). It must not wait."""
        with self._state:
            self._listeners.append(listener)
        try:
            yield
        finally:
            with self._state:
                self._listeners.remove(listener)

    # ------------------------------------------------------------------ one arm's process

    def _keep(self, settings: ArmSettings) -> None:
        """Keep an arm's process running."""
        backoff, reasons, name = Backoff(), Reasons(), settings.name
        while not self._gone.is_set():
            began = time.monotonic()
            with self._state:
                self._heard[name] = began
            how = self._one_life(settings)
            if how is None or self._gone.is_set():
                break
            wait = backoff.failed(time.monotonic() - began)
            if reasons.due(how, wait, time.monotonic()):
                self._note(name, f"its process {how}; it is started again in {wait:.1f} s")
            with self._state:
                self._restarts[name] += 1
                # "t" says that it has answered, and compiling need not be waited for
                self._answers[name] = {**self._answers[name], "t": None, **_unknown(f"its process {how}")}
            self._gone.wait(wait)
        self._ended.add(name)

    def _one_life(self, settings: ArmSettings) -> str | None:
        """One process, from its start to its end: how it ended, if it is to be started again."""
        name = settings.name
        try:
            process = self._started(settings)
        except OSError as error:  # too many processes at present, say
            return f"cannot be started ({error.strerror})"
        try:
            error = self._listen(process, name)
        finally:
            _hang_up(process)
            code = process.wait()
            self.processes.pop(name, None)
        if error is not None:
            if self._gone.is_set():  # as it was ended
                return None
            with self._state:
                answered = self._answers[name].get("t") is not None
            if not answered and self._restarts[name] == 0:  # later it may be a file that is being written anew
                self.error = f"{name}: {error}"
                return None
            return f"{'ended' if answered else 'cannot begin'}: {error}"
        if code == 0:
            return None
        return f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"

    def _started(self, settings: ArmSettings) -> subprocess.Popen[bytes]:
        process = self.processes[settings.name] = self._spare.take()
        since = time.monotonic() - self._began
        order(process, {"arm": settings.to_dict(), "every": self.settings.every, "since": since})
        if self._gone.is_set():
            _hang_up(process)
        return process

    def _listen(self, process: subprocess.Popen[bytes], name: str) -> str | None:
        """Pass on what a process says until it ends; what it cannot begin with, if that is why."""
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                try:
                    said = json.loads(line)
                except ValueError:  # cut off by a kill
                    continue
                if not isinstance(said, dict):  # something that a library prints
                    continue
                if "error" in said:
                    return said["error"]
                with self._state:
                    self._heard[name] = time.monotonic()
                if "note" in said:
                    self._note(name, said["note"])
                else:
                    self._take(name, said)
        return None

    # ------------------------------------------------------------------ answers

    def _take(self, name: str, said: dict[str, Any]) -> None:
        with self._state:
            self._answers[name] = said
            self._tell(name, said["told"])

    def _tell(self, name: str, of: float) -> None:
        """Look for alarms, and pass on the answer, as it is `of` [s, monotonic], if a line is due; the last one is."""
        answer = self.answer(name)
        for alarm in self._alarms[name].look(answer, time.monotonic()):
            self._alarm(alarm)
        if answer.get("connection") != "ended" and of - self._lines[name] < 0.999 * self.settings.every:
            return
        self._lines[name] = of
        for listener in self._listeners:
            listener(answer)

    def _note(self, name: str, text: str) -> None:
        """A sentence about an arm for the log."""
        self._noted[name] = text
        self._log(f"{name}: {text}")

    def _alarm(self, alarm: Alarm) -> None:
        message = {**alarm.to_dict(), "time": time.time()}
        why = "" if alarm.text in self._noted[alarm.arm] else f": {alarm.text}"  # why a source is lost is noted already
        self._log(f"{alarm.arm}: {alarm.kind} {message['state']}{why}")
        for listener in self._listeners:
            listener(message)
        for receiver in self._receivers:
            receiver.post(message)

    def _as_of_now(self, answer: dict[str, Any], name: str) -> dict[str, Any]:
        """The answer with what has passed since it was made; of a process that is silent nothing is known."""
        since = max(0.0, time.monotonic() - answer.pop("told"))
        for key in ("age", "lag", "saved"):
            answer[key] = None if answer.get(key) is None else answer[key] + since
        if since > 1.0 and answer["unknown"] not in (Unknown.STARTING, Unknown.COMPILING, Unknown.SOURCE_ENDED):
            answer |= _unknown(f"its process has said nothing for {since:.1f} s")
        return {**answer, "restarts": self._restarts[name], "alarms": sorted(self._alarms[name].raised)}

    def _look(self) -> None:
        """Speak for processes that do not, and end those that hang."""
        for name in self.names:
            with self._state:
                silent = time.monotonic() - self._heard[name]
                if silent < 2.0 * _LOOK or name in self._ended:
                    continue
                self._tell(name, time.monotonic())
                first = self._answers[name].get("t") is None
            process = self.processes.get(name)
            if silent > (HUNG_COMPILING if first else HUNG) and process not in (None, self._hung.get(name)):
                self._hung[name] = process  # it may take its time to go
                self._note(name, f"its process has said nothing for {silent:.0f} s and is ended")
                process.kill()


def _hang_up(process: subprocess.Popen[bytes]) -> None:
    """End a process's standard input, at which it saves and ends."""
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.close()


def _rating(settings: ArmSettings) -> float:
    if settings.rating is not None:
        return settings.rating
    return float(rated_mass(arm(settings.robot, settings.frame)))


def _starting(settings: ArmSettings) -> dict[str, Any]:
    """What is said of an arm before its process says anything."""
    head = {"arm": settings.name, "robot": settings.robot, "told": time.monotonic()}
    rest = {"connection": "connecting", "connections": 0, "lost": 0, "saved": None, "arm_changed": None}
    rest |= {"age": None, "lag": None, "mass": None}
    return {**head, **_unknown("its process is being started"), "source": settings.source, **rest}


def _unknown(why: str) -> dict[str, Any]:
    return {"known": False, "unknown": Unknown.STARTING.value, "why": why}
