"""The same sections as the HTML report, as a page of Markdown: text and tables, no figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from armload.lab.report.html import Section, write_whole
from armload.lab.report.shown import Table


def write_markdown(path: str | Path, sections: Sequence[Section], title: str, note: str = "") -> Path:
    """Write sections as Markdown; an existing file is replaced whole, or kept if something fails.

    Args:
        path: the file to write; its folder must exist.
        sections: their figures are left out.
        title: heading of the page. note: a paragraph below it.

    Raises:
        ReportError: the file cannot be written.
    """
    lines = [f"# {title}", "", *([note, ""] if note else [])]
    for section in sections:
        lines += [f"## {section.title}", "", section.text.strip(), ""]
        lines += [markdown(table) for table in section.tables]
    return write_whole(path, "\n".join(lines).rstrip() + "\n", "the page")


def markdown(table: Table) -> str:
    """A table as Markdown: title, rows, note."""
    if not table.rows:
        return f"**{table.title}**\n\n{table.note}\n"
    rows = [table.columns, ["---"] * len(table.columns), *table.rows]
    lines = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows]
    return f"**{table.title}**\n\n" + "\n".join(lines) + f"\n\n{table.note}\n"
