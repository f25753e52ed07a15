"""What the studies behind docs/why.md share: arm after arm measured, then a table on the page, a figure and a JSON."""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from armload import __version__, arm
from armload.arms import Arm

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "why.md"
Rows = list[dict[str, Any]]


class Study(NamedTuple):
    """A study of simulated Pandas, one for each seed.

    about: for --help. command: that repeats it. result: the JSON. mark: where its table stands on the page.
    seeds: how many arms. conditions: said in the JSON.
    measure: of an arm and a seed, rows and, of at least one seed, curves for the figure.
    summarise: rows → summary. table: summary → Markdown. draw: of summary, rows and curves.
    """

    about: str
    command: str
    result: Path
    mark: str
    seeds: int
    conditions: dict[str, Any]
    measure: Callable[[Arm, int], tuple[Rows, dict[str, Any]]]
    summarise: Callable[[Rows], Rows]
    table: Callable[[Rows], str]
    draw: Callable[[Rows, Rows, dict[str, Any]], None]

    def run(self) -> None:
        """As the command line says."""
        parser = argparse.ArgumentParser(description=self.about, formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.add_argument("--seeds", type=int, default=self.seeds)
        parser.add_argument("--quick", action="store_true", help="two seeds, printed and not written")
        arguments = parser.parse_args()
        seeds = 2 if arguments.quick else arguments.seeds
        started, robot, rows, curves = time.process_time(), arm("panda"), [], {}
        for seed in range(seeds):
            mine, shown = self.measure(robot, seed)
            rows += mine
            curves = curves or shown
            print(f"arm {seed + 1} of {seeds}, {time.process_time() - started:.0f} s of CPU", flush=True)
        summary = self.summarise(rows)
        print(self.table(summary))
        if arguments.quick:
            return
        self.draw(summary, rows, curves)
        result = {
            "command": f"{self.command} --seeds {seeds}",
            "version": __version__,
            "cpu_s": round(time.process_time() - started, 1),
            "conditions": self.conditions,
            "summary_mean_and_standard_deviation": summary,
            "rows": rows,
        }
        self.result.write_text(json.dumps(result, indent=1, default=float) + "\n")
        write_table(PAGE, self.mark, self.table(summary))


def write_table(page: Path, name: str, text: str) -> None:
    """Put a table between its marks on a page."""
    marks = f"<!-- {name} -->", f"<!-- /{name} -->"
    old = page.read_text(encoding="utf-8")
    new, count = re.subn(
        f"{re.escape(marks[0])}.*?{re.escape(marks[1])}", f"{marks[0]}\n{text}\n{marks[1]}", old, flags=re.DOTALL
    )
    if count != 1:
        raise SystemExit(f"{page} has {count} places {marks[0]} … {marks[1]}: expected one")
    page.write_text(new, encoding="utf-8")
