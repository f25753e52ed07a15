"""Writes src/armload/runtime/kernels.json: the arguments with which Python calls each kernel, for compiling a wheel.

    python -m pytest -p record_kernels -m "" tests/inertia tests/posterior …     (PYTHONPATH=tests, without -n)

runs the tests and adds what they called. An array that is not in C order, or of a type that is not in `_TYPES` of
`armload.runtime.kernels`, is compiled for when it comes: it is printed, to be mended where it is handed over.
"""

import inspect
import json
from typing import Any

import numpy as np

import armload.runtime.kernels as kernels

_NAMES = {"float64", "float32", "int64", "int32", "bool"}
_original = kernels._just_in_time
_seen: dict[str, list[Any]] = json.loads(kernels.SIGNATURES.read_text()) if kernels.SIGNATURES.exists() else {}
_odd: set[str] = set()


class Recorder:
    """A kernel that notes what it is called with."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        self.py_func, self.compiled, self.signature = (
            function,
            _original(function, options),
            inspect.signature(function),
        )
        self.targetoptions = self.compiled.targetoptions
        self.__doc__ = function.__doc__

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        bound = self.signature.bind(*arguments, **named)
        bound.apply_defaults()
        try:
            kinds = [_kind(x) for x in bound.args]
            known = _seen.setdefault(kernels.name_of(self.py_func), [])
            if kinds not in known:
                known.append(kinds)
        except ValueError as odd:
            _odd.add(f"{kernels.name_of(self.py_func)}: {odd}")
        return self.compiled(*bound.args)

    @property
    def _numba_type_(self) -> Any:
        return self.compiled._numba_type_


def _kind(x: Any) -> Any:
    if isinstance(x, tuple):
        return [_kind(one) for one in x]
    if isinstance(x, np.ndarray):
        if not x.flags.c_contiguous or x.dtype.name not in _NAMES:
            raise ValueError(f"{x.dtype.name} array of {x.ndim} dimensions, strides {x.strides}")
        return f"{x.dtype.name}[{', '.join(':' * x.ndim)}]"
    if isinstance(x, bool | np.bool_):
        return "bool"
    if isinstance(x, int | np.integer):
        return "int64"
    if isinstance(x, float | np.floating):
        return "float64"
    raise ValueError(f"a {type(x).__name__}")


def pytest_sessionfinish() -> None:
    kernels.SIGNATURES.write_text(
        "{\n" + ",\n".join(f"  {json.dumps(k)}: {json.dumps(_seen[k])}" for k in sorted(_seen)) + "\n}\n"
    )
    for line in sorted(_odd):
        print("compiled for when it comes:", line)


kernels._just_in_time = Recorder  # type: ignore[assignment]
