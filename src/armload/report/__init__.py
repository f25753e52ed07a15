"""Report: figures of a comparison and one self-contained HTML file."""

from armload.report.html import ReportError, Section, render, write_report
from armload.report.log import log_report
from armload.report.sections import default_report

__all__ = ["ReportError", "Section", "default_report", "log_report", "render", "write_report"]
