"""A second thread for what must not hold a stream up."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from threading import Thread
from typing import Any

_Tasks = SimpleQueue[tuple[Future, Callable, tuple] | None]


class Worker:
    """One thread that does what it is given, in order; a program may end while it waits.

    It starts with the first task, and with the first after `stop`.
    """

    _tasks: _Tasks | None = None

    def __getstate__(self) -> dict[str, Any]:
        """For a copy: it has a thread of its own; whoever owns this one waits for what it does."""
        return {}

    def submit(self, task: Callable, *arguments: Any) -> Future:
        """Begin `task(*arguments)` after what was begun before."""
        if self._tasks is None:
            self._tasks = SimpleQueue()
            Thread(target=_work, args=(self._tasks,), name="armload-scales", daemon=True).start()
        future: Future = Future()
        self._tasks.put((future, task, arguments))
        return future

    def wait(self) -> None:
        """Wait until all that was begun is done."""
        if self._tasks is not None:
            self.submit(lambda: None).result()

    def stop(self) -> None:
        """Let the thread end once all is done."""
        if self._tasks is not None:
            self._tasks.put(None)
            self._tasks = None


def _work(tasks: _Tasks) -> None:
    while (given := tasks.get()) is not None:
        future, task, arguments = given
        try:
            future.set_result(task(*arguments))
        except BaseException as error:  # whoever waits for the result gets it
            future.set_exception(error)
        del given, future, task, arguments  # a thread that waits must keep nothing alive
