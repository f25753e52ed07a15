"""What is written from the finished cells: the summary (JSON), the page (Markdown), the report (HTML)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from armload.errors import ReportError
from armload.inertia import NAMES, UNITS
from armload.lab.benchmark.benchmark_page import COMMAND, PAIRS, TITLE, sections
from armload.lab.benchmark.benchmark_run import Size
from armload.lab.benchmark.benchmark_tables import Results
from armload.lab.benchmark.measured import Measured, gather
from armload.lab.benchmark.population_figures import figures
from armload.lab.benchmark.populations import REPEAT
from armload.lab.benchmark.targets import verdicts
from armload.lab.experiment import listed, write_json
from armload.lab.report import write_markdown, write_report
from armload.lab.report.shown import GROUPS

_rounded = partial(listed, digits=4)


def write_results(
    cells: Mapping[str, dict[str, Any]],
    size: Size,
    summary: str | Path,
    page: str | Path,
    report: str | Path,
) -> dict[str, Path]:
    """Write the summary, the page and the report; each appears whole or not at all.

    Args:
        cells: finished cells by name (`run_benchmark`). size: how much was asked for.
        summary, page, report: the files to write; folders are made.

    Returns:
        what was written, by what it is.

    Raises:
        ReportError: nothing is measured yet, or a file cannot be written.
    """
    results = gather(cells, size)
    if not results:
        raise ReportError(f"nothing is measured yet: run `{COMMAND}` until a part of it is finished")
    written = {"summary": Path(summary), "page": Path(page), "report": Path(report)}
    for path in written.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    write_json(written["summary"], summary_json(results, size), indent=None)
    note = f"Written by `{COMMAND}`; every number on this page comes from its cells."
    write_markdown(written["page"], sections(results, size), TITLE, note)
    write_report(written["report"], sections(results, size, figures(results)), f"armload {TITLE.lower()}")
    return written


def summary_json(results: Results, size: Size) -> dict[str, Any]:
    """The benchmark as numbers [SI], ready for JSON; null: infinite, or not to be had from a single episode.

    populations: by name `episodes`, `seeds` and `methods`; of each method, (T, 10) by time and parameter, `mae`,
    `standard_error` over the episodes, `seed_spread` (standard deviation of the seeds' means), `coverage` of its 95 %
    intervals, `half_width`, where the bound was measured `efficiency`, and on the repeated payload `repeatability`.
    paired: `ratio`, `difference` and `standard_error` (T, 3) by group. targets: `targets.verdicts`.
    """
    paired = [
        {
            "a": a,
            "b": b,
            "population": name,
            "ratio": _rounded(m.ratio(a, b)),
            "difference": _rounded(m.paired(a, b)[0]),
            "standard_error": _rounded(m.paired(a, b)[1]),
        }
        for a, b in PAIRS
        for name, m in results.items()
        if a in m.rows and b in m.rows
    ]
    return {
        "command": COMMAND,
        "robot": size.robot,
        "rate": size.rate,
        "times": list(size.times),
        "parameters": list(NAMES),
        "units": list(UNITS),
        "groups": list(GROUPS),
        "populations": {name: _population(m) for name, m in results.items()},
        "paired": paired,
        "targets": [{k: _rounded(v) if isinstance(v, float) else v for k, v in t.items()} for t in verdicts(results)],
    }


def _population(m: Measured) -> dict[str, Any]:
    numbers = {
        "mae": m.absolute.mean(axis=1),
        "standard_error": m.standard_error(m.absolute),
        "seed_spread": m.seed_spread(m.absolute),
        "coverage": m.coverage,
        "half_width": m.half_width.mean(axis=1),
    }
    if m.efficiency is not None:
        numbers["efficiency"] = m.efficiency
    if m.population.name == REPEAT:
        numbers["repeatability"] = m.repeatability
    methods = {}
    for i, row in enumerate(m.rows):
        methods[row] = {name: _rounded(values[i]) for name, values in numbers.items()}
        methods[row]["wall_s"] = _rounded(float(np.median(m.comparison.wall[i])))
        methods[row] |= {"refused": m.refused[row]} if row in m.refused else {}
        methods[row] |= {"trained": m.trained[row]} if row in m.trained else {}
    return {"episodes": m.runs, "seeds": list(m.comparison.seeds), "prior": m.comparison.prior, "methods": methods}
