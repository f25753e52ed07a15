"""How functions are compiled: each once for each machine, and whoever waits for it is told.

`kernel` is numba's `njit` with what all of armload's compiled functions share. They divide as numpy does (x/0 is ±inf
or nan: a test of each divisor costs branches), leave the interpreter alone, and are kept on disk. Compiling takes
seconds, so they do without what numba compiles slowly: an assignment to a slice (`a[:] = b`) brings along the text of
its error and costs a second, a whole-array function (`a.sum()`) a tenth, where a loop costs nothing.
"""

from __future__ import annotations

import logging
from typing import Any

from numba import njit
from numba.core import event

COMPILING = "compiling for this machine, which is done once and takes a while"


class _Listener(event.Listener):
    """Logs once in each process that something of armload is compiled; what is found on disk is not."""

    told = False

    def on_start(self, event: event.Event) -> None:
        compiled: Any = event.data
        if not self.told and compiled["dispatcher"].py_func.__module__.startswith("armload."):
            self.told = True
            logging.getLogger("armload").info(COMPILING)

    def on_end(self, event: event.Event) -> None:
        pass


def kernel(function: Any = None, **options: Any) -> Any:
    """A compiled function, `@kernel` or `@kernel(fastmath=…)`.

    Arguments are arrays that can be written, in C order, and numbers: for others it is compiled once more.
    """
    settings: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    compiled: Any = njit(**settings, **options)
    return compiled if function is None else compiled(function)


event.register("numba:compile", _Listener())
