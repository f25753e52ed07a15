"""One thread for the products of small matrices.

BLAS spreads each product over all cores, and the threads wait busily for each other: for matrices of a few hundred rows
that costs ten times the processor time where two cores have other work, and brings next to nothing where they have not.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Within, BLAS has one thread, in the whole process; sums then have the same order on any machine.

    For a whole function: `@one_thread()`.
    """
    with _libraries().limit(limits=1):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """Those that are loaded: to look for them takes milliseconds, so it is done once."""
    return ThreadpoolController()
