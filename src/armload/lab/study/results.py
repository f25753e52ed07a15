"""What is written from the finished cells: the page, the summary, the report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from armload.atomic import replacing
from armload.lab.study.claims import evaluate
from armload.lab.study.study_page import html_report, summary_json, write_page


def write_results(
    cells: dict[str, dict[str, Any]], summary: str | Path, page: str | Path, report: str | Path
) -> dict[str, Path]:
    """Write the summary (JSON), the page (Markdown) and the report (HTML); each appears whole or not at all.

    Args:
        cells: finished cells by name (`run_study`, `load_cells`).
        summary, page, report: the files to write; folders are made.

    Returns:
        what was written, by what it is.
    """
    written = {"summary": Path(summary), "page": Path(page), "report": Path(report)}
    for path in written.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    claims = evaluate(cells)
    with replacing(written["summary"]) as temporary:
        temporary.write_text(json.dumps(summary_json(cells, claims), indent=1, allow_nan=False) + "\n", "utf-8")
    write_page(cells, claims, written["page"])
    html_report(cells, claims, written["report"])
    return written
