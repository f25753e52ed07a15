"""The command line (`cli`) and the page of a live robot (`page`)."""

from armload.app.cli import main

__all__ = ["main"]
