"""How much processor time a design and the nudge of a given path take.

    python benchmarks/design_time.py [--repeats 3]

The design is `armload motion design --time 3` with all joints about the pose of `designed_motions.py`, a process of its
own with everything that it imports. The nudge is `enrich` of the pick and place of 6 s given there (5 mm, 2°), after a
tare of 20 s elsewhere, `quick` and in a process that has imported what it needs: what a task that goes on has to pay;
and `armload motion enrich` of the same as a command, which is not quick. Processor seconds, the least of the repeats:
what a busy machine adds is not the program's. Writes benchmarks/results/design_time.json and the table in
docs/motion.md.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from designed_motions import POSES, _around, elsewhere, place
from script import ROOT, markdown_table, options, write, write_table

from armload.arms import arm
from armload.excitation import Criterion, enrich
from armload.motion import PathMotion, save_motion

NAMES = {"panda": "Panda, 7 joints", "ur10e": "UR10e, 6 joints"}


def of_command(*arguments: str) -> float:
    """Processor seconds of one `armload` command, on one core."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    one_core = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-m", "armload", *arguments], capture_output=True, check=True, env=one_core)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measured(name: str, folder: Path, repeats: int) -> dict[str, float]:
    """Of one arm."""
    robot, pose = arm(name), "=".join(["--from", ",".join(map(str, POSES[name]))])
    path, tare = PathMotion.of(place(robot), name="pick"), elsewhere(robot)
    save_motion(folder / "pick.json", path)
    save_motion(folder / "tare.json", tare)
    constraints, criterion = _around(robot), Criterion(robot, tare)
    heaviest = f"{constraints.payload.mass:g}" if constraints.payload is not None else "1"
    common = ["--robot", name, "--payload", heaviest, "--out", str(folder / "out.json")]
    nudge = ["motion", "enrich", str(folder / "pick.json"), "--tare", str(folder / "tare.json"), *common]
    enrich(path, constraints, criterion, quick=True)  # compiles, where that has not been done
    times: dict[str, list[float]] = {"design": [], "nudge": [], "nudge_command": []}
    for _ in range(repeats):
        times["design"].append(of_command("motion", "design", pose, "--time", "3", *common))
        began = time.process_time()
        enrich(path, constraints, criterion, quick=True)
        times["nudge"].append(time.process_time() - began)
        times["nudge_command"].append(of_command(*nudge, "--travel", "10", "--speed", "3"))
    return {what: round(min(each), 2) for what, each in times.items()}


def table(found: dict[str, dict[str, float]]) -> str:
    """A row for each arm."""
    columns = ["processor seconds", "`motion design`, 3 s", "nudge of a path of 6 s", "`motion enrich`, the same"]
    rows = [[NAMES[name], *(f"{each[what]:.1f}" for what in each)] for name, each in found.items()]
    return markdown_table(columns, "lrrr", rows)


def main() -> None:
    """Measure, table."""
    asked = options(__doc__, repeats=3)
    with tempfile.TemporaryDirectory() as folder:
        found = {name: measured(name, Path(folder), asked.repeats) for name in NAMES}
    write("design_time", {"arms": found})
    print(table(found))
    write_table(ROOT / "docs" / "motion.md", "design time", table(found))


if __name__ == "__main__":
    main()
