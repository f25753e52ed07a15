"""Functions in machine code: compiled with the package where it was installed from a wheel, else when first called.

A wheel holds two libraries made by `hatch_build.py`, one for processors of the last ten years and one for any: nothing
is compiled then, and numba, which brings a whole LLVM, is not needed. In a checkout `kernel` is numba's `njit`, which
keeps on disk what it compiled; a message says that it compiles. Where ARMLOAD_KERNELS names a folder, a library is
looked for there too: `make test` compiles one of the sources as they are, so that processes of the tests start faster.

All kernels divide as numpy does (x/0 is ±inf or nan: a test of each divisor costs branches) and leave the interpreter
alone. Compiling takes seconds, so they do without what numba compiles slowly: an assignment to a slice (`a[:] = b`)
brings along the text of its error and costs a second, a whole-array function (`a.sum()`) a tenth, where a loop costs
nothing.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
from collections.abc import Callable
from functools import cache, cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from armload.runtime.compiling import notice_compiling

FOLDER = "ARMLOAD_KERNELS"  # the environment's: where else a library is looked for
SIGNATURES = Path(__file__).with_name("kernels.json")  # of each kernel, what it is compiled for ahead
LIBRARIES = {  # name: what the compiler calls the processor, and what /proc/cpuinfo must list for it; the best first
    "_kernels_v3": ("x86-64-v3", frozenset({"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"})),
    "_kernels_any": ("", frozenset[str]()),
}
_NUMBERS = {"float64": (float, int), "bool": (bool, np.bool_)}  # what Python may give; else any integer


def kernel(function: Any = None, **options: Any) -> Any:
    """A compiled function, `@kernel` or `@kernel(fastmath=…)`.

    Arguments are arrays that can be written, in C order, and numbers: for others it is compiled once more.
    """
    if function is None:
        return lambda function: kernel(function, **options)
    library = _library()
    return _just_in_time(function, options) if library is None else _Ahead(function, options, library)


def symbol(function: Callable[..., Any], k: int) -> str:
    """The name that a library gives the function compiled for its k-th signature."""
    return f"{name_of(function).replace('.', '_')}_{k}"


def name_of(function: Callable[..., Any]) -> str:
    """The function's name in `SIGNATURES`."""
    return f"{function.__module__.removeprefix('armload.')}.{function.__name__}"


def settings(options: dict[str, Any]) -> dict[str, Any]:
    """What numba is asked for, whenever it compiles."""
    return {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}


class _Ahead:
    """A function from a library, and numba's for arguments of other types than it was compiled for.

    The library does not check an array's type and order, so these are checked here in each call.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any], library: Any) -> None:
        self.py_func, self._options = function, options
        self.__doc__, self.__name__ = function.__doc__, function.__name__
        known = signatures().get(name_of(function), ())
        self._calls = [(_check(kinds), getattr(library, symbol(function, k))) for k, kinds in enumerate(known)]
        self._signature = inspect.signature(function)
        self._count = len(self._signature.parameters)  # asked for in each call

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if named or len(arguments) != self._count:
            bound = self._signature.bind(*arguments, **named)
            bound.apply_defaults()
            arguments = bound.args
        for fit, call in self._calls:
            if fit(*arguments):
                return call(*arguments)
        return self._compiled(*arguments)

    @cached_property
    def _compiled(self) -> Any:
        return _just_in_time(self.py_func, self._options)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes this for, in another kernel that calls it."""
        return self._compiled._numba_type_


def _check(kinds: list[Any]) -> Callable[..., bool]:
    """Whether arguments are of these kinds: one expression of them all costs a fifth of a loop, in each call."""
    known: dict[str, Any] = {"ndarray": np.ndarray}

    def one(x: str, kind: Any) -> str:
        if isinstance(kind, list):
            parts = [one(f"{x}[{k}]", part) for k, part in enumerate(kind)]
            return " and ".join([f"type({x}) is tuple and len({x}) == {len(kind)}", *parts])
        name, _, axes = kind.partition("[")
        if not axes:
            known[name] = _NUMBERS.get(name, (int, np.integer))
            return f"isinstance({x}, {name})"
        known[f"{name}_"] = np.dtype(name)
        shape = f"{x}.ndim == {axes.count(':')} and {x}.flags.c_contiguous"
        return f"type({x}) is ndarray and {x}.dtype == {name}_ and {shape}"

    names = [f"x{k}" for k in range(len(kinds))]
    return eval(f"lambda {', '.join(names)}: {' and '.join(map(one, names, kinds))}", known)


@cache
def signatures() -> dict[str, list[list[Any]]]:
    """Of each kernel that Python calls, what it is compiled for ahead: "float64[:, :]", "int64", a list for a tuple."""
    return json.loads(SIGNATURES.read_text())


@cache
def _library() -> Any:
    """The best library that this processor can run, None where there is none."""
    if os.environ.get(FOLDER):
        sys.modules["armload"].__path__.append(os.environ[FOLDER])
    for name, (_, needed) in LIBRARIES.items():
        if find_spec(f"armload.{name}") is not None and needed <= _processor():
            return import_module(f"armload.{name}")
    return None


@cache
def _processor() -> frozenset[str]:
    """What the processor can do, in Linux's words; empty where nothing says so."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        return frozenset()
    flags = next((line for line in lines if line.startswith("flags")), "")
    return frozenset(flags.partition(":")[2].split())


def _just_in_time(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    from numba import njit

    notice_compiling()
    return njit(**settings(options))(function)
