"""What `make test` takes on a fresh clone: the set-up, and then lint, kernels, types and tests.

    python benchmarks/suite.py [--revision HEAD]

Clones this repository at that revision into a temporary folder and runs there what a user runs, without a cache of
Python, numba or pytest:

    make .venv/.stamp    the virtual environment, from what pip finds or has kept of the packages
    make test            lint, types, kernels and the tests, with two workers

wall time [s], and processor time [s], user and system, of all their processes. Beside them stands how many processes
wanted a core in the five minutes before (the load average): only on an idle machine the wall times mean something. The
real logs are those of ARMLOAD_REAL_DATA, or of shared/data beside this checkout.

Written to benchmarks/results/suite.json. The sum of the wall times is what `structure.py --test-seconds` takes.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from script import ROOT, options, say, write

STEPS = {"set-up": ["make", ".venv/.stamp"], "make test": ["make", "test"]}
_OURS = ("ARMLOAD_", "NUMBA_", "PYTEST_", "PYTHON", "VIRTUAL_ENV", "OMP_", "OPENBLAS_")


def main() -> None:
    asked = options(__doc__, revision="HEAD")
    revision = git("rev-parse", "--short", asked.revision)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(_OURS)}
    environment["ARMLOAD_REAL_DATA"] = os.environ.get("ARMLOAD_REAL_DATA", str(ROOT.parent / "shared" / "data"))
    result: dict[str, Any] = {
        "revision": revision,
        "load_before": round(os.getloadavg()[1], 2),
    }
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder) / "armload"
        git("clone", "--quiet", str(ROOT), str(clone))
        git("-C", str(clone), "checkout", "--quiet", "--detach", revision)
        for name, command in STEPS.items():
            say(name)
            result[name] = timed([*command, f"PYTHON={sys.executable}"], clone, environment)
    result["wall_s"] = round(sum(result[name]["wall_s"] for name in STEPS), 1)
    write("suite", result)


def git(*arguments: str) -> str:
    """What git prints, run in this checkout."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def timed(command: list[str], folder: Path, environment: dict[str, str]) -> dict[str, float]:
    """Wall and processor time [s] of a command that must succeed, its children's included."""

    def spent() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    began, before = time.perf_counter(), spent()
    subprocess.run(command, cwd=folder, env=environment, check=True)
    return {"wall_s": round(time.perf_counter() - began, 1), "cpu_s": round(spent() - before, 1)}


if __name__ == "__main__":
    main()
