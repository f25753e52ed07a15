"""What is written from the finished cells: summary (JSON), page, picture and tables (Markdown), report (HTML)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from armload.errors import ReportError
from armload.inertia import NAMES, UNITS
from armload.lab.benchmark.benchmark_page import APPENDIX, PAIRS, TITLE, command_of, sections
from armload.lab.benchmark.benchmark_run import Size
from armload.lab.benchmark.benchmark_tables import Results, losses
from armload.lab.benchmark.front import front, picture
from armload.lab.benchmark.measured import Measured, gather
from armload.lab.benchmark.population_figures import figures
from armload.lab.benchmark.populations import REPEAT
from armload.lab.benchmark.targets import verdicts
from armload.lab.experiment import listed, write_json
from armload.lab.report import write_markdown, write_report
from armload.lab.report.shown import GROUPS
from armload.lab.report.style import look
from armload.runtime.atomic import replacing

_NOTE = "Written by `{}`; every number on this page comes from its cells."
_rounded = partial(listed, digits=4)


def write_results(
    cells: Mapping[str, dict[str, Any]], size: Size, summary: str | Path, page: str | Path, report: str | Path
) -> dict[str, Path]:
    """Write the summary, the page and the report; each appears whole or not at all.

    Args:
        cells: finished cells by name (`run_benchmark`). size: how much was asked for.
        summary, page, report: the files to write; folders are made. Beside the page PAGE.md come its appendix
            PAGE_tables.md and its picture pictures/PAGE.png.

    Returns:
        what was written, by what it is.

    Raises:
        ReportError: nothing is measured yet, or a file cannot be written.
    """
    results = gather(cells, size)
    if not results:
        raise ReportError(f"nothing is measured yet: run `{command_of(size)}` until a part of it is finished")
    written = {"summary": Path(summary), "report": Path(report), **pages(page)}
    for path in written.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    numbers = summary_json(results, size)
    write_json(written["summary"], numbers, indent=None)
    write_front(numbers, written["page"])
    write_markdown(written["tables"], sections(results, size), APPENDIX, _NOTE.format(command_of(size)))
    first = front(numbers)
    first[0] = replace(first[0], figures=((picture(numbers), "Errors over time and coverage."),))
    write_report(written["report"], [*first, *sections(results, size, figures(results))], f"armload {TITLE.lower()}")
    return written


def pages(page: str | Path) -> dict[str, Path]:
    """The page's own path and those of what belongs to it, by what they are.

    >>> pages("docs/benchmark.md")["picture"].as_posix()
    'docs/pictures/benchmark.png'
    """
    page = Path(page)
    tables = page.with_name(f"{page.stem}_tables{page.suffix}")
    return {"page": page, "tables": tables, "picture": page.parent / "pictures" / f"{page.stem}.png"}


def write_front(numbers: Mapping[str, Any], page: str | Path) -> None:
    """Write the first page and its picture from the summary only; folders must exist.

    Raises:
        ReportError: a file cannot be written.
    """
    paths = pages(page)
    drawn = paths["picture"]
    try:
        with replacing(drawn) as temporary, look():
            picture(numbers).savefig(temporary, format="png", dpi=110, metadata={"Software": None})
    except OSError as error:
        raise ReportError(
            f"the picture cannot be written to {drawn}: {error.strerror}; name a page elsewhere"
        ) from None
    link = drawn.relative_to(paths["page"].parent).as_posix()
    write_markdown(paths["page"], front(numbers, link, paths["tables"].name), TITLE, _NOTE.format(numbers["command"]))


def summary_json(results: Results, size: Size) -> dict[str, Any]:
    """The benchmark as numbers [SI], ready for JSON; null: infinite, or not to be had from a single episode.

    populations: by name `episodes`, `seeds` and `methods`; of each method, (T, 10) by time and parameter, `mae`,
    `standard_error` over the episodes, `seed_spread` (standard deviation of the seeds' means), `coverage` of its 95 %
    intervals, `half_width`, where the bound was measured `efficiency`, and on the repeated payload `repeatability`.
    paired: `ratio`, `difference` and `standard_error` (T, 3) by group. targets: `targets.verdicts`. losses:
    `tables.losses`.
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
        "command": command_of(size),
        "robot": size.robot,
        "rate": size.rate,
        "times": list(size.times),
        "parameters": list(NAMES),
        "units": list(UNITS),
        "groups": list(GROUPS),
        "populations": {name: _population(m) for name, m in results.items()},
        "paired": paired,
        "targets": [_plain(target) for target in verdicts(results)],
        "losses": [_plain(loss) for loss in losses(results)],
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


def _plain(numbers: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _rounded(value) if isinstance(value, float) else value for name, value in numbers.items()}
