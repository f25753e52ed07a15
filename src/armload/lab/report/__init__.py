"""Report: figures of a comparison, one self-contained HTML file, the same sections as Markdown."""

from armload.lab.report.answer_section import answer_section
from armload.lab.report.comparison_report import default_report
from armload.lab.report.html import ReportError, Section, render, write_report
from armload.lab.report.log_report import log_report
from armload.lab.report.markdown import markdown, write_markdown

__all__ = [
    "ReportError",
    "Section",
    "answer_section",
    "default_report",
    "log_report",
    "markdown",
    "render",
    "write_markdown",
    "write_report",
]
