"""How long `armload reproduce taie2024 --quick` takes, from nothing, in a folder of its own.

    python benchmarks/study_quick.py            writes benchmarks/results/study_quick.json

The time that it is to stay under is a wall clock's; on a machine with other work to do, the processor's says more.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from script import ROOT, write

COMMAND = "import sys; from armload.app import main; sys.exit(main())"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        before, started = os.times(), time.perf_counter()
        call = [sys.executable, "-c", COMMAND, "reproduce", "taie2024", "--quick", "--out", folder]
        subprocess.run(call, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        wall, after = time.perf_counter() - started, os.times()
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    write("study_quick", {"wall_s": round(wall, 1), "processor_s": round(processor, 1)})


if __name__ == "__main__":
    main()
