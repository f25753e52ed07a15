"""The same sections as the HTML report, as a page of Markdown; figures become pictures beside it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from armload.errors import ReportError
from armload.lab.report.html import Section, write_whole
from armload.lab.report.shown import Table
from armload.lab.report.style import look
from armload.runtime.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 100  # of pictures


def write_markdown(
    path: str | Path, sections: Sequence[Section], title: str, note: str = "", pictures: str = ""
) -> Path:
    """Write sections as Markdown; an existing file is replaced whole, or kept if something fails.

    Args:
        path: the file to write; its folder must exist.
        sections: see `write_report`.
        title: heading of the page. note: a paragraph below it.
        pictures: where their figures go, from the page's folder, without number and ending ("pictures/paper" makes
            pictures/paper-1.png, …); empty: they are left out.

    Raises:
        ReportError: the file cannot be written.
    """
    lines = [f"# {title}", "", *([note, ""] if note else [])]
    count = 0
    for section in sections:
        lines += [f"## {section.title}", "", section.text.strip(), ""]
        lines += [markdown(table) for table in section.tables]
        for figure, caption in section.figures if pictures else ():
            count += 1
            link = f"{pictures}-{count}.png"
            _write_picture(Path(path).parent / link, figure)
            lines += [f"![{_first_sentence(caption)}]({link})", "", f"*{caption}*", ""]
    return write_whole(path, "\n".join(lines).rstrip() + "\n", "the page")


def markdown(table: Table) -> str:
    """A table as Markdown: title, rows, note."""
    if not table.rows:
        return f"**{table.title}**\n\n{table.note}\n"
    rows = [table.columns, ["---"] * len(table.columns), *table.rows]
    lines = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows]
    return f"**{table.title}**\n\n" + "\n".join(lines) + f"\n\n{table.note}\n"


def _first_sentence(caption: str) -> str:
    """What stands for a picture where it cannot be seen: the caption up to its first full stop or colon."""
    return re.split(r"(?<!Fig)[.:](?: |$)", caption)[0]


def _write_picture(path: Path, figure: Figure) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, look():
            figure.savefig(temporary, format="png", dpi=_DPI, metadata={"Software": None})
    except OSError as error:
        raise ReportError(
            f"the picture cannot be written to {path}: {error.strerror}; name a page in a folder you can write to"
        ) from None
