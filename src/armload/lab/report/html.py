"""One self-contained HTML file from a list of sections: no script, nothing to load, readable on a phone."""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from armload.errors import ReportError
from armload.lab.report.shown import Table
from armload.lab.report.style import look
from armload.runtime.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# control characters, as the name of a file may have, of which XML has none (XML 1.0, 2.2): no browser would draw it
_NO_XML = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")


@dataclass(frozen=True)
class Section:
    """A part of a report: a heading, then text, tables and figures, each of them optional.

    title: the heading.
    text: paragraphs, an empty line between them; `code` and **bold** are understood, everything else is literal.
    tables: drawn after the text. figures: (figure, caption) pairs, drawn after the tables.
    """

    title: str
    text: str = ""
    tables: tuple[Table, ...] = ()
    figures: tuple[tuple[Figure, str], ...] = ()


def write_report(path: str | Path, sections: Sequence[Section], title: str = "armload report") -> Path:
    """Write the sections as one HTML file; an existing file is replaced whole, or kept if something fails.

    Args:
        path: the file to write; its folder must exist.
        sections: see `default_report`, whose list may be changed at will.
        title: heading of the page.

    Returns:
        The path.

    Raises:
        ReportError: the file cannot be written.
    """
    return write_whole(path, render(sections, title), "the report")


def write_whole(path: str | Path, text: str, what: str) -> Path:
    """Write a file that appears whole or not at all; raises `ReportError` where it cannot be written."""
    path = Path(path)
    try:
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ReportError(
            f"{what} cannot be written to {path}: {error.strerror}; name a file in a folder you can write to"
        ) from None
    return path


def render(sections: Sequence[Section], title: str = "armload report") -> str:
    """The HTML text of a report."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("armload.lab.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(paragraphs=_paragraphs, picture=_picture, anchor=_anchor, head=_head)
    return environment.get_template("report.html.j2").render(title=title, sections=sections)


def _paragraphs(text: str) -> str:
    """HTML of paragraphs with `code` and **bold**; anything else is escaped."""
    out = []
    for block in re.split(r"\n\s*\n", text.strip()):
        escaped = html.escape(" ".join(block.split()), quote=False)
        escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
        out.append("<p>" + re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", escaped) + "</p>")
    return "\n".join(out) if text.strip() else ""


def _head(column: str) -> str:
    """A column head with its unit on a line of its own."""
    name, bracket, unit = html.escape(column, quote=False).partition(" [")
    return f"{name}<br><span>[{unit}</span>" if bracket else name


def _picture(figure: Figure) -> str:
    """The figure as an SVG in a data URI: sharp at any size, and its ids do not meet those of another figure."""
    buffer = io.BytesIO()
    with look():
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    drawn = _NO_XML.sub("\ufffd".encode(), buffer.getvalue())
    return "data:image/svg+xml;base64," + base64.b64encode(drawn).decode("ascii")


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
