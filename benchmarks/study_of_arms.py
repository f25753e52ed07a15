"""What the studies behind docs/why.md share: arm after arm measured, then a table on the page, a figure and a JSON."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from script import RESULTS, ROOT, options, say, write, write_table

from armload import arm
from armload.arms import Arm
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key

PAGE = ROOT / "docs" / "why.md"
Rows = list[dict[str, Any]]


class Study(NamedTuple):
    """A study of simulated Pandas, one for each seed.

    name: of the script, its result and its figure. mark: where its table stands on the page. seeds: how many arms.
    conditions: said in the JSON. measure: of an arm and a seed, rows and, of at least one seed, curves for the figure,
    ready for JSON. summarise: rows → summary. table: summary → Markdown. draw: of summary, rows, curves and a file.
    """

    name: str
    mark: str
    seeds: int
    conditions: dict[str, Any]
    measure: Callable[[Arm, int], tuple[Rows, dict[str, Any]]]
    summarise: Callable[[Rows], Rows]
    table: Callable[[Rows], str]
    draw: Callable[[Rows, Rows, dict[str, Any], Path], None]

    @property
    def command(self) -> str:
        return f"python benchmarks/{self.name}.py"

    @property
    def result(self) -> Path:
        return RESULTS / f"{self.name}.json"

    @property
    def figure(self) -> Path:
        return ROOT / "docs" / "pictures" / f"{self.name}.png"

    def run(self) -> None:
        """As the command line says; arms that were measured are kept in out/."""
        asked = options(sys.modules["__main__"].__doc__, seeds=self.seeds, jobs=1, quick=False)
        code = source_key(), source_key(ROOT / "benchmarks")
        count = 2 if asked.quick else asked.seeds
        tasks = [Task.of_one(f"arm-{k}", key_of(code, k), _measured, self.measure, k) for k in range(count)]
        cells = run_tasks(tasks, ROOT / "out" / self.name, jobs=asked.jobs, say=say).values()
        rows, curves = [row for cell in cells for row in cell["rows"]], [c["curves"] for c in cells if c["curves"]]
        summary = self.summarise(rows)
        print(self.table(summary))
        if asked.quick:
            return
        self.figure.parent.mkdir(exist_ok=True)
        self.draw(summary, rows, curves[0], self.figure)
        result = {
            "cpu_s": round(sum(cell["cpu_s"] for cell in cells), 1),
            "conditions": self.conditions,
            "summary_mean_and_standard_deviation": summary,
            "rows": rows,
        }
        write(self.name, result)
        write_table(PAGE, self.mark, self.table(summary))


def _measured(measure: Callable[[Arm, int], tuple[Rows, dict[str, Any]]], seed: int) -> dict[str, Any]:
    started = time.process_time()
    rows, curves = measure(arm("panda"), seed)
    return {"rows": rows, "curves": curves, "cpu_s": time.process_time() - started}
