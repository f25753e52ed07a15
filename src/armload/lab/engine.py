"""Where tasks run: processes of this machine, or the workers of a Dask cluster, both through joblib.

No scheduler or queue of our own: joblib gives tasks out one by one, and what comes back comes as it is finished. A
process that is killed costs the tasks that were running: they are given out again, at last each alone.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from armload.errors import UsageError

# times that a task may lose its process: once beside others, whose fault it may have been, and once alone
ATTEMPTS = 3
_ADDRESS = re.compile(r"(tcp|tls|ucx)://\S+:\d+$")
_WAIT = 30.0  # [s] for a cluster to answer

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Engine:
    """Something that runs tasks. jobs: how many at a time, -1: as many as a cluster has workers. cluster: of Dask."""

    jobs: int
    cluster: str | None = None

    def each(self, work: Callable[[T], R], items: Callable[[], Iterable[T]]) -> Iterator[tuple[T, R | None]]:
        """Each item and what work(item) is, in the order in which they are finished; None: its process was killed.

        Args:
            work: a function that can be sent to another process.
            items: gives what is not done yet, whenever it is asked.
        """
        if self.jobs == 1 and self.cluster is None:  # here and now, and without joblib
            for item in items():
                yield item, work(item)
            return
        for _ in range(ATTEMPTS - 1):
            try:
                yield from self._run(work, items(), self.jobs)
                return
            except self._killed():
                continue
        for item in items():  # each alone, in a process that it shares with no other
            try:
                yield from self._run(work, [item], 2)
            except self._killed():
                yield item, None

    def _run(self, work: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[tuple[T, R]]:
        from joblib import Parallel, delayed

        parallel: Any = Parallel  # its annotations are narrower than what it takes
        ahead = jobs if jobs > 0 else "2*n_jobs"
        how: dict[str, Any] = {"pre_dispatch": ahead, "batch_size": 1, "return_as": "generator_unordered"}
        with warnings.catch_warnings():
            # joblib says so when a process of its pool has ended; what was lost is given out again
            warnings.filterwarnings("ignore", message=".*A worker stopped while some jobs were given.*")
            yield from parallel(n_jobs=jobs, **how)(delayed(_with_item)(work, item) for item in items)

    def _killed(self) -> type[BaseException]:
        """What is raised where the process of a task was killed."""
        if self.cluster is None:
            from joblib.externals.loky.process_executor import TerminatedWorkerError

            return TerminatedWorkerError
        from distributed.scheduler import KilledWorker  # type: ignore[import-not-found]

        return KilledWorker


@contextmanager
def engine(jobs: int = 1, cluster: str | None = None) -> Iterator[Engine]:
    """What runs tasks, for the time of a `with` block.

    Args:
        jobs: processes of this machine.
        cluster: None, or Dask: `local` (as many workers as `jobs`, one thread each) or the address of a scheduler,
            such as tcp://10.0.0.1:8786, whose workers have armload and see the same files.

    Raises:
        UsageError: another address, or a cluster that does not answer.
        ModuleNotFoundError: Dask is not installed.
    """
    if cluster is None:
        yield Engine(jobs)
        return
    if cluster != "local" and not _ADDRESS.match(cluster):
        raise UsageError(
            f"--cluster {cluster!r}: expected local, or the address of a scheduler such as tcp://HOST:8786"
        )
    import distributed  # type: ignore[import-not-found]
    from joblib import parallel_config

    if cluster == "local":
        settings = {"n_workers": jobs, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
        made: Any = distributed.LocalCluster(**settings)
    else:
        made = cluster
    try:
        client = distributed.Client(made, timeout=_WAIT, set_as_default=True)
    except (OSError, TimeoutError) as error:
        raise UsageError(
            f"--cluster {cluster}: no scheduler answers there ({error}); start one, or name another"
        ) from None
    try:
        with client, parallel_config("dask", n_jobs=-1):
            yield Engine(-1, cluster)
    finally:
        if cluster == "local":
            made.close()


def _with_item(work: Callable[[T], R], item: T) -> tuple[T, R]:
    return item, work(item)
