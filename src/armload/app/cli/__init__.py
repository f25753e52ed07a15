"""The command line, `armload identify LOG --robot panda` and the rest: it reads, calls, prints and computes nothing."""

from armload.app.cli.entry import main
from armload.app.cli.headless import line_of, lines

__all__ = [
    "line_of",
    "lines",
    "main",
]
