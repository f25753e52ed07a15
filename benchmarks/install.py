"""What `pip install armload` brings, and what a command costs with nothing else installed.

    python benchmarks/install.py [--repeats 5]

Builds the wheel, installs it without extras in an empty virtual environment (from the package index), and measures

    size     of what was installed, by distribution: bytes of the files, and bytes the file system gives them [MB]
    command  processor time (user and system) and wall time of identify, export and live --headless, as multiples of
             `python -c "import numpy, pinocchio"` in the same run

of two simulated logs as in the README (6 s at 1 kHz, with a tare of 20 s), and of a real Panda's where
ARMLOAD_REAL_DATA names its folder. "first" is with no compiled function on disk, "again" the median of the repeats
after it, with their range. The environment's own pip is not counted.

Written to benchmarks/results/install.json and docs/install.md. About five minutes.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from importlib.metadata import Distribution, distributions
from pathlib import Path
from statistics import median
from typing import Any

from script import ROOT, markdown_table, options, say, write, write_table

_REFERENCE = ["-c", "import numpy, pinocchio"]
_SHOWN = 5.0  # [MB] a distribution that is smaller is counted in the sum only
_NOT_OURS = {"pip", "setuptools"}  # the environment's own
_PAGE = ROOT / "docs" / "install.md"
_REAL = "panda_unloaded_1khz.csv"


def main() -> None:
    asked = options(__doc__, repeats=5)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = _installed(folder)
        result: dict[str, Any] = {"size_MB": _sizes(python)}
        say(f"installed: {result['size_MB']['total']}")
        for log, arguments in _logs(folder).items():
            say(log)
            result[log] = _measured(python, folder / log, arguments, asked.repeats)
    write("install", result)
    show(result)


def show(result: dict[str, Any]) -> None:
    """Write the page's tables."""
    sizes = result["size_MB"]
    rows = [[name, *(f"{x:.0f}" for x in size)] for name, size in sizes["distributions"].items()]
    rows.append(["all, the smaller ones too", *(f"{x:.0f}" for x in sizes["total"])])
    write_table(_PAGE, "size", markdown_table(("package", "bytes of the files", "allocated"), "lrr", rows))
    rows = []
    for log in (name for name in ("simulated", "real") if name in result):
        for command in ("identify", "export", "live"):
            one = result[log][command]
            times = [f"{one[when][what]:.1f}" for when in ("first", "again") for what in ("cpu", "wall")]
            rows.append([f"`{command}`, {log}", *times])
    columns = ("command", "first: CPU", "first: wall", "again: CPU", "again: wall")
    write_table(_PAGE, "time", markdown_table(columns, "lrrrr", rows))


def _installed(folder: Path) -> Path:
    """The Python of an environment that holds the wheel and what it requires."""
    say("building the wheel and installing it")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder / "wheel")]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = (folder / "wheel").glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
    python = folder / "venv" / "bin" / "python"
    pip = [str(python), "-m", "pip", "--disable-pip-version-check", "--quiet", "install"]
    subprocess.run([*pip, str(wheel)], check=True, cwd=folder)
    return python


def _sizes(python: Path) -> dict[str, Any]:
    """[apparent, allocated] of each larger distribution and of all, the bytecode pip compiled included."""
    (place,) = (python.parents[1] / "lib").glob("python*/site-packages")
    found = {d.metadata["Name"]: _size(d) for d in distributions(path=[str(place)])}
    ours = {name: size for name, size in found.items() if name not in _NOT_OURS}
    total = [round(sum(size[k] for size in ours.values()), 1) for k in range(2)]
    large = {name: size for name, size in sorted(ours.items(), key=lambda x: -x[1][0]) if size[0] >= _SHOWN}
    return {"columns": ["apparent", "allocated"], "total": total, "distributions": large}


def _size(distribution: Distribution) -> list[float]:
    paths = {Path(str(file.locate())) for file in distribution.files or ()}
    stats = [path.lstat() for path in paths if path.is_file()]
    return [round(sum(s.st_size for s in stats) / 1e6, 1), round(sum(512 * s.st_blocks for s in stats) / 1e6, 1)]


def _logs(folder: Path) -> dict[str, list[str]]:
    """What is identified, by name: the arguments of `armload identify` and `armload live`."""
    made = folder / "logs"
    subprocess.run([sys.executable, str(ROOT / "examples" / "simulate_two_logs.py"), str(made)], check=True)
    logs = {"simulated": [str(made / "loaded.csv"), "--robot", "panda", "--tare", str(made / "empty.csv")]}
    real = os.environ.get("ARMLOAD_REAL_DATA")
    if real is not None:
        logs["real"] = [str(Path(real) / _REAL), "--robot", "panda"]
    return logs


def _measured(python: Path, folder: Path, arguments: list[str], repeats: int) -> dict[str, Any]:
    """Times of the commands, as multiples of the reference's median, which is given in seconds."""
    folder.mkdir()
    held = folder / "held.json"
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ARMLOAD"))}
    armload = ["-m", "armload"]
    commands = {
        "identify": [*armload, "identify", *arguments, "--json"],
        "export": [*armload, "export", str(held), "--to", "franka"],
        "live": [*armload, "live", *arguments, "--headless", "--speed", "max"],
    }

    def run(command: list[str], cache: str) -> tuple[float, float]:
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        done = subprocess.run(
            [str(python), *command],
            env=kept | {"NUMBA_CACHE_DIR": str(folder / cache)},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=True,
        )
        wall, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        if command[2:3] == ["identify"]:
            held.write_bytes(done.stdout)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall

    run(_REFERENCE, "none")  # the files are in memory from here on
    first = {name: run(command, name) for name, command in commands.items()}
    again: dict[str, list[tuple[float, float]]] = {name: [] for name in ["reference", *commands]}
    for _ in range(repeats):
        again["reference"].append(run(_REFERENCE, "none"))
        for name, command in commands.items():
            again[name].append(run(command, name))
    unit = [median(times[k] for times in again["reference"]) for k in range(2)]
    result: dict[str, Any] = {"reference_s": dict(zip(("cpu", "wall"), (round(u, 3) for u in unit), strict=True))}
    for name in commands:
        columns = {what: [times[k] / unit[k] for times in again[name]] for k, what in enumerate(("cpu", "wall"))}
        result[name] = {
            "first": {what: round(first[name][k] / unit[k], 1) for k, what in enumerate(("cpu", "wall"))},
            "again": {what: round(median(values), 1) for what, values in columns.items()},
            "again_range": {what: [round(min(v), 1), round(max(v), 1)] for what, v in columns.items()},
        }
    return result


if __name__ == "__main__":
    main()
