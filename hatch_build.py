"""Puts the kernels (`armload.runtime.kernels`) into a wheel, compiled; an editable install compiles them when needed.

    python hatch_build.py FOLDER | --here

compiles the libraries named in `kernels.LIBRARIES` for the signatures in `src/armload/runtime/kernels.json`, which
`tests/record_kernels.py` writes. The compiler is numba's (`numba.pycc`), with the settings that a checkout uses
(`kernels.settings`); linking needs a C++ compiler. Where ARMLOAD_PURE_WHEEL is set, a wheel without libraries is built,
which needs numba where it is installed. `--here` compiles the library for this processor only and prints its folder,
whose name changes with any source: the tests set ARMLOAD_KERNELS to it.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

if sys.version_info < (3, 11):  # noqa: UP036  pip builds a clone's wheel before it asks what Python the wheel is for
    sys.exit(f"armload needs Python 3.11 or newer, and this is Python {platform.python_version()}")

ROOT = Path(__file__).resolve().parent
PURE = "ARMLOAD_PURE_WHEEL"

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # run as a script, without hatchling
    BuildHookInterface = object


class Kernels(BuildHookInterface):
    """Adds the libraries to the wheel and names the platform in its file name."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable" or self.target_name != "wheel" or os.environ.get(PURE):
            return
        for library in kept(ROOT / "build"):
            build_data["force_include"][str(library)] = f"armload/{library.name}"
        build_data["pure_python"], build_data["infer_tag"] = False, True


def kept(folder: Path, names: list[str] | None = None) -> list[Path]:
    """The libraries of this source and Python, compiled where they are not there: pip asks for a wheel twice."""
    sources = [
        Path(__file__),
        *sorted((ROOT / "src" / "armload").rglob("*.py")),
        ROOT / "src/armload/runtime/kernels.json",
    ]
    key = hashlib.sha256(repr((sys.version, platform.machine(), version("numba"), names)).encode())
    for path in sources:
        key.update(path.read_bytes())
    place = folder / f"kernels-{key.hexdigest()[:16]}"
    if not place.is_dir():
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix="compiling-") as name:
            compile_all(Path(name), names)
            try:
                Path(name).rename(place)
                Path(name).mkdir()  # which is removed now
            except OSError:
                if not place.is_dir():  # else another process was first
                    raise
    return sorted(place.glob("_kernels_*.so"))


def compile_all(folder: Path, names: list[str] | None = None) -> list[Path]:
    """Compile each library in a process of its own, for its processor: all that a wheel holds where none is named."""
    sys.path.insert(0, str(ROOT / "src"))
    from armload.runtime.kernels import FOLDER, LIBRARIES

    names = names or (list(LIBRARIES) if platform.machine() == "x86_64" else ["_kernels_any"])
    running = []
    for name in names:
        cpu = LIBRARIES[name][0] or "generic"
        settings = {"NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(folder / name)}
        path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
        command = [sys.executable, str(Path(__file__).resolve()), "--one", name, str(folder)]
        running.append(subprocess.Popen(command, env=os.environ | settings | {"PYTHONPATH": path, FOLDER: ""}))
    if any(process.wait() for process in running):
        without = f"{PURE}=1 pip install '.[jit]' does without them"
        raise RuntimeError(f"the kernels could not be compiled (is there a C++ compiler?); {without}")
    return sorted(folder.glob("_kernels_*.so"))


def compile_one(name: str, folder: Path) -> None:
    """Write the library NAME.SUFFIX into the folder."""
    warnings.simplefilter("ignore")  # pycc says that something is to follow it one day
    import numba.pycc.compiler
    from numba.core.cpu import FastMathOptions
    from numba.pycc import CC

    from armload.runtime import kernels

    library = CC(name, "armload.runtime.kernels")
    library.output_dir, library.target_cpu = str(folder), kernels.LIBRARIES[name][0]
    options: dict[Any, dict[str, Any]] = {}
    for dispatcher, signatures in _wanted():
        options[dispatcher.py_func] = dispatcher.targetoptions
        for k, types in enumerate(signatures):
            library.export(kernels.symbol(dispatcher.py_func, k), types)(dispatcher.py_func)
    compile_extra = numba.pycc.compiler.compile_extra

    def with_options(typing: Any, target: Any, function: Any, types: Any, result: Any, flags: Any, **rest: Any) -> Any:
        """As numba's own, which takes no options of a function."""
        flags, asked = flags.copy(), options[function]
        flags.error_model, flags.release_gil = asked["error_model"], asked["nogil"]
        if asked.get("fastmath"):
            flags.fastmath = FastMathOptions(asked["fastmath"])
        return compile_extra(typing, target, function, types, result, flags, **rest)

    numba.pycc.compiler.compile_extra = with_options
    library.compile()


def for_this_processor() -> str:
    """The library that this processor runs."""
    sys.path.insert(0, str(ROOT / "src"))
    from armload.runtime import kernels

    return next(name for name, (_, needed) in kernels.LIBRARIES.items() if needed <= kernels._processor())


def _wanted() -> Iterator[tuple[Any, list[tuple[Any, ...]]]]:
    """Each kernel that Python calls, and what it is compiled for."""
    sys.path.insert(0, str(ROOT / "src"))
    from armload.runtime import kernels

    for path, signatures in kernels.signatures().items():
        module, _, function = path.rpartition(".")
        dispatcher = getattr(import_module(f"armload.{module}"), function)
        yield dispatcher, [tuple(_numba_type(kind) for kind in kinds) for kinds in signatures]


def _numba_type(kind: Any) -> Any:
    from numba import types

    if isinstance(kind, list):
        return types.Tuple([_numba_type(one) for one in kind])
    name, _, axes = kind.partition("[")
    base = types.boolean if name == "bool" else getattr(types, name)
    return types.Array(base, axes.count(":"), "C") if axes else base


if __name__ == "__main__":
    if sys.argv[1] == "--one":
        compile_one(sys.argv[2], Path(sys.argv[3]))
    elif sys.argv[1] == "--here":
        try:
            print(kept(ROOT / "build", [for_this_processor()])[0].parent)
        except RuntimeError as error:
            sys.exit(f"{error}: each process waits for numba")
    else:
        print(*compile_all(Path(sys.argv[1])), sep="\n")
