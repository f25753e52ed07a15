"""Where tasks run: processes of this machine, through joblib, or the workers of a Dask cluster.

No scheduler or queue of our own: joblib or Dask gives out tasks one by one; what comes back comes as it is finished.
A process that is killed costs the tasks that were running: they are given out again, at last each alone. Dask is asked
itself, as joblib's backend for it keeps the number of workers that there were at first, runs everything here where
that was one, and waits for ever for a scheduler that is gone. Processes of joblib end with the one that began them,
which joblib leaves open: they would finish their tasks beside those of whoever goes on, and wait for minutes.
"""

from __future__ import annotations

import logging
import os
import queue
import re
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from armload.errors import ClusterError, UsageError
from armload.runtime.interruption import unheard_by_processes

# times that a task may lose its process: once beside others, whose fault it may have been, and once alone
ATTEMPTS = 3
_ADDRESS = re.compile(r"(tcp|tls|ucx)://\S+:\d+$")
_WAIT = 30.0  # [s] for a cluster to answer
_NO_WORKER = 300.0  # [s] without any worker: a queue of a batch system takes minutes
_ALONE = 1.0  # [s] after which a process looks whether the one that began it is there
_LOOK = 5.0  # [s] after which it is looked whether the scheduler is there, where nothing is finished meanwhile
_GONE = "the cluster is gone: nothing that was finished is lost; start it and run the same command again to go on"
_NONE: Any = object()

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Engine:
    """Something that runs tasks.

    jobs: how many processes, where there is no cluster. client: of a Dask cluster. patience: [s] without any worker,
        after which none is waited for.
    """

    jobs: int
    client: Any = None
    patience: float = _NO_WORKER

    def each(self, work: Callable[[T], R], items: Callable[[], Iterable[T]]) -> Iterator[tuple[T, R | None]]:
        """Each item and what work(item) is, in the order in which they are finished; None: its process was killed.

        Args:
            work: a function that can be sent to another process.
            items: gives what is not done yet, whenever it is asked.

        Raises:
            ClusterError: the scheduler of the cluster is gone, or it has no worker.
        """
        if self.client is not None:
            killed: list[T] = []
            yield from self._spread(work, items(), killed)
            for item in killed:
                again: list[T] = []
                yield from self._spread(work, [item], again)
                yield from ((one, None) for one in again)
            return
        if self.jobs == 1:  # here and now, and without joblib
            for item in items():
                yield item, work(item)
            return
        for _ in range(ATTEMPTS - 1):
            try:
                yield from self._run(work, items(), self.jobs)
                return
            except _terminated():
                continue
        for item in items():  # each alone, in a process that it shares with no other
            try:
                yield from self._run(work, [item], 2)
            except _terminated():
                yield item, None

    def _run(self, work: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[tuple[T, R]]:
        from joblib import Parallel, delayed

        parallel: Any = Parallel  # its annotations are narrower than what it takes
        how: dict[str, Any] = {"pre_dispatch": jobs, "batch_size": 1, "return_as": "generator_unordered"}
        how |= {"initializer": _end_with, "initargs": (os.getpid(),)}  # not with its first task: some never get one
        with warnings.catch_warnings():
            # joblib says so when a process of its pool has ended; what was lost is given out again
            warnings.filterwarnings("ignore", message=".*A worker stopped while some jobs were given.*")
            # and of an interruption, that its tasks were cancelled
            warnings.filterwarnings("ignore", message=".*adjusting the input task iterator.*")
            with ExitStack() as stack:
                with unheard_by_processes():  # begins them
                    found = parallel(n_jobs=jobs, **how)(delayed(_with_item)(work, item) for item in items)
                    stack.callback(found.close)
                yield from found

    def _spread(self, work: Callable[[T], R], items: Iterable[T], killed: list[T]) -> Iterator[tuple[T, R]]:
        """As `each`, on the cluster; those whose worker was killed again and again come to stand in `killed`.

        Two for each core of the workers there are at the time are given out, so that none waits for the next.
        """
        from distributed.scheduler import KilledWorker  # type: ignore[import-not-found]

        left, running = iter(items), {}
        try:
            more = True
            while more or running:
                room = 2 * self._cores() - len(running)
                while more and room > 0:
                    item = next(left, _NONE)
                    more, room = item is not _NONE, room - 1
                    if more:
                        with _gone():
                            running[self.client.submit(partial(work, item), pure=False)] = item
                if not running:
                    continue
                for future in self._finished(list(running)):
                    item = running.pop(future)
                    try:
                        found = self._result(future)
                    except KilledWorker:
                        killed.append(item)
                        continue
                    yield item, found
        finally:
            with suppress(Exception):  # of tasks that nobody waits for any more
                self.client.cancel(list(running))

    def _cores(self) -> int:
        """Of all workers there are; waits for one."""
        until = time.monotonic() + self.patience
        while True:
            with _gone():
                if cores := sum(self.client.ncores().values()):
                    return cores
            if time.monotonic() > until:
                raise ClusterError(
                    f"the cluster has had no worker for {self.patience / 60.0:.2g} minutes: start one, and run the "
                    "same command again to go on"
                )
            time.sleep(0.2)

    def _finished(self, running: list[Any]) -> list[Any]:
        """Those of some futures that have ended; waits for one, and looks whether the scheduler is there."""
        import distributed  # type: ignore[import-not-found]

        with _gone(), suppress(TimeoutError):
            distributed.wait(running, _LOOK, "FIRST_COMPLETED")
        ended = [future for future in running if future.done()]
        if self.client.status != "running" or any(future.cancelled() for future in ended):
            raise ClusterError(_GONE)
        return ended

    def _result(self, future: Any) -> Any:
        """What a task found, or what it raised."""
        while future.status != "error":
            with _gone(), suppress(TimeoutError):
                return future.result(_LOOK)
            if self.client.status != "running":
                raise ClusterError(_GONE)
        return future.result()  # raises, and asks nobody


@contextmanager
def engine(jobs: int = 1, cluster: str | None = None) -> Iterator[Engine]:
    """What runs tasks, for the time of a `with` block.

    Args:
        jobs: processes of this machine.
        cluster: None, or Dask: `local` (as many workers as `jobs`, one thread each) or the address of a scheduler,
            such as tcp://10.0.0.1:8786, whose workers have armload and see the same files.

    Raises:
        UsageError: another address, or a cluster that does not answer.
        ClusterError: the scheduler is gone, or it has no worker.
        ModuleNotFoundError: Dask is not installed.
    """
    if cluster is None:
        try:
            yield Engine(jobs)
        finally:
            _end_processes()
        return
    if cluster != "local" and not _ADDRESS.match(cluster):
        raise UsageError(
            f"--cluster {cluster!r}: expected local, or the address of a scheduler such as tcp://HOST:8786"
        )
    import dask.config  # type: ignore[import-not-found]
    import distributed  # type: ignore[import-not-found]

    if cluster == "local":
        settings = {"n_workers": jobs, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
        settings["silence_logs"] = logging.CRITICAL  # of its workers, what is wrong with them is said in one sentence
        # Dask asks malloc to trim at 64 kB, which has every array of some size mapped and unmapped anew; tasks run in a
        # thread there, which has an arena of malloc of its own that is trimmed as eagerly: let there be one
        spawned = dict(dask.config.get("distributed.nanny.pre-spawn-environ", {}))
        spawned.pop("MALLOC_TRIM_THRESHOLD_", None)
        spawned["MALLOC_ARENA_MAX"] = "1"
        # and it looks at the stack of each task a hundred times a second, for its dashboard
        of_workers = {"distributed.nanny.pre-spawn-environ": spawned, "distributed.worker.profile.enabled": False}
        with dask.config.set(of_workers), unheard_by_processes():
            made: Any = distributed.LocalCluster(**settings)
    else:
        made = cluster
    try:
        client = distributed.Client(made, timeout=_WAIT, set_as_default=True)
    except (OSError, TimeoutError) as error:
        raise UsageError(
            f"--cluster {cluster}: no scheduler answers there ({error}); start one, or name another"
        ) from None
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)  # what it would say of a scheduler that is gone is said in one sentence
    try:
        with client:
            yield Engine(jobs, client)
    finally:
        if cluster == "local":
            made.close()
        logger.setLevel(before)


@contextmanager
def _gone() -> Iterator[None]:
    """What Dask raises where its scheduler is gone, as one error."""
    from distributed.client import ClosedClientError  # type: ignore[import-not-found]

    try:
        yield
    except TimeoutError:  # which is an OSError
        raise
    except (OSError, CancelledError, ClosedClientError):
        raise ClusterError(_GONE) from None


def _end_processes() -> None:
    """End the processes of joblib: left to the end of Python, an interruption meanwhile would be a traceback."""
    loky = sys.modules.get("joblib.externals.loky.reusable_executor")  # to ask it for its pool would make one
    pool: Any = getattr(loky, "_executor", None)
    if pool is None:
        return
    with suppress(queue.Empty):  # what still waits to be given out: its thread would end by a KeyError, and print it
        while True:
            pool._work_ids.get(block=False)
    pool.shutdown(kill_workers=True)


def _with_item(work: Callable[[T], R], item: T) -> tuple[T, R]:
    return item, work(item)


def _end_with(parent: int) -> None:
    """End this process once the one that began it has ended, whatever it is doing, or waiting for."""

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(_ALONE)
        os._exit(1)

    threading.Thread(target=look, name="armload-parent", daemon=True).start()


def _terminated() -> type[BaseException]:
    """What joblib raises where the process of a task was killed."""
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    return TerminatedWorkerError
