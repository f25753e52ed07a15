"""What armload can do without: the packages of its extras, and what to say where one is missing.

The sentence names the packages themselves, so that it holds for a wheel, a clone and an index alike.
"""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from importlib.metadata import PackageNotFoundError, requires

# module: (package, extra of pyproject.toml that installs it)
MODULES = {
    "mujoco": ("mujoco", "lab"),
    "scipy": ("scipy", "lab"),
    "sklearn": ("scikit-learn", "lab"),
    "jax": ("jax", "lab"),
    "joblib": ("joblib", "lab"),
    "trimesh": ("trimesh", "lab"),
    "matplotlib": ("matplotlib", "lab"),
    "jinja2": ("jinja2", "lab"),
    "pyarrow": ("pyarrow", "parquet"),
    "distributed": ("distributed", "cluster"),
    "aiohttp": ("aiohttp", "cluster"),  # logs behind HTTP, through fsspec
    "h5py": ("h5py", "hdf5"),
    "viser": ("viser", "live"),
    "numba": ("numba", "jit"),
    "rosbags": ("rosbags", "bags"),
    "mcap": ("mcap", "bags"),
    "paho": ("paho-mqtt", "mqtt"),
    "ruamel": ("rosbags", "bags"),  # which brings it: YAML
    "pylibfranka": ("pylibfranka", "franka"),
    "panda_py": ("panda-python", "panda"),
    "rtde_receive": ("ur-rtde", "ur"),
    "rtde_control": ("ur-rtde", "ur"),
}
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_BELOW = re.compile(r"python_version\s*<\s*[\"'](\d+)\.(\d+)[\"']")


def install(module: str, extra: str | None = None) -> str:
    """How to install the extra that a module belongs to, or the one of several that is named, as words of a sentence.

    >>> install("viser").startswith("pip install ")
    True
    """
    package, its = MODULES[module.partition(".")[0]]
    wanted = _required(extra or its) or {package: ""}
    below = _BELOW.search(wanted.get(package, ""))
    command = "pip install " + " ".join(shlex.quote(name) for name in _specifiers(wanted))
    if below is not None and sys.version_info >= (limit := tuple(map(int, below.groups()))):
        here = ".".join(map(str, sys.version_info[:2]))
        return f"{command}, with a Python below {'.'.join(map(str, limit))} (this one is {here})"
    return command


def missing(error: ModuleNotFoundError) -> str | None:
    """A sentence on a module that is not installed, if it belongs to an extra."""
    module = (error.name or "").partition(".")[0]
    if module not in MODULES:
        return None
    return f"this needs {MODULES[module][0]}, which is not installed: {install(module)}"


def require(*modules: str) -> None:
    """See that modules of an extra are there, before the work that needs them begins.

    Raises:
        ModuleNotFoundError: one is not installed; the sentence says how to install it.
    """
    for module in modules:
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(missing(error) or str(error), name=error.name) from None


def _required(extra: str) -> dict[str, str]:
    """Requirements of an extra by package, from the metadata of what is installed; empty if it is not to be had."""
    try:
        lines = requires("armload") or []
    except PackageNotFoundError:
        return {}
    ours = [line for line in lines if re.search(rf"extra\s*==\s*[\"']{extra}[\"']", line)]
    return {match.group(): line for line in ours if (match := _NAME.match(line)) is not None}


def _specifiers(wanted: dict[str, str]) -> list[str]:
    """What pip is given of each requirement, without what follows the semicolon."""
    return [line.partition(";")[0].strip().replace(" ", "") or name for name, line in wanted.items()]
