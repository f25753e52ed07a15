"""What is written from the finished cells: the page, the summary, the report."""

from __future__ import annotations

from pathlib import Path

from armload.lab.experiment import Cells, write_json
from armload.lab.study.claims import evaluate
from armload.lab.study.study_page import html_report, pages, summary_json, write_pages


def write_results(
    cells: Cells, summary: str | Path, page: str | Path, report: str | Path, quick: bool = False
) -> dict[str, Path]:
    """Write the summary (JSON), the page and its appendix (Markdown) and the report (HTML); each appears whole.

    Args:
        cells: finished cells by name (`run_study`, `load_cells`).
        summary, page, report: the files to write; folders are made.
        quick: whether the cells are of reduced size, so that page and report say first that verdicts mean nothing.

    Returns:
        what was written, by what it is.
    """
    written = {"summary": Path(summary), "report": Path(report), **pages(page)}
    for path in written.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    claims = evaluate(cells)
    write_json(written["summary"], summary_json(cells, claims))
    write_pages(cells, claims, page, quick)
    html_report(cells, claims, written["report"], quick)
    return written
