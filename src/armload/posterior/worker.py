"""A second thread for what must not hold a stream up."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from threading import Thread
from typing import Any


class Worker:
    """One thread that does what it is given, in order; a program may end while it waits."""

    def __init__(self) -> None:
        self._tasks: SimpleQueue[tuple[Future, Callable, tuple] | None] = SimpleQueue()
        Thread(target=self._run, name="armload-scales", daemon=True).start()

    def submit(self, task: Callable, *arguments: Any) -> Future:
        future: Future = Future()
        self._tasks.put((future, task, arguments))
        return future

    def stop(self) -> None:
        self._tasks.put(None)

    def _run(self) -> None:
        while (given := self._tasks.get()) is not None:
            future, task, arguments = given
            try:
                future.set_result(task(*arguments))
            except BaseException as error:  # whoever waits for the result gets it
                future.set_exception(error)
            del given, future, task, arguments  # a thread that waits must keep nothing alive
