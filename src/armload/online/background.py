"""The watch's own thread: what must not hold a sample up is done there, in order."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from armload.posterior import PosteriorLeastSquares
from armload.posterior.worker import Worker


class Background:
    """A thread that is started when it is first needed."""

    def __init__(self) -> None:
        self._worker: Worker | None = None
        self._closing: Future[None] | None = None

    def submit(self, task: Callable, *arguments: Any) -> Future:
        """Begin `task(*arguments)` after what was begun before."""
        if self._worker is None:
            self._worker = Worker()
        return self._worker.submit(task, *arguments)

    def close_run(self, run: PosteriorLeastSquares) -> None:
        """Stop the thread of a run that is not wanted any more."""
        self._closing = self.submit(run.close)

    def wait(self) -> None:
        """Wait until the last such run is closed."""
        if self._closing is not None:
            self._closing.result()
            self._closing = None

    def stop(self) -> None:
        """Stop the thread; the next task starts another one."""
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
