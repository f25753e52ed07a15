"""The command line, `armload identify LOG --robot panda` and the rest: it reads, calls, prints and computes nothing."""

from armload.app.cli.entry import main

__all__ = ["main"]
