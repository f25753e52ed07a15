"""The parser of every command: errors of one sentence, help as wide as the terminal, values that begin with a minus."""

from __future__ import annotations

import argparse
import shutil
import textwrap
from typing import NoReturn

from armload.errors import UsageError

# options whose value may begin with a minus sign: argparse would take "-1,0,-9.7" for an option
_SIGNED = ("--gravity", "--mass", "--from", "--at", "--box", "--floor", "--centre", "--com")
_HELP = 110  # characters of a line of --help, at most


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one sentence without usage, and whose help keeps its line breaks."""

    def __init__(self, **settings) -> None:
        lines = (settings.get("description") or "").split("\n")  # which argparse leaves as wide as they are
        settings["description"] = "\n".join(x if x.startswith(" ") else textwrap.fill(x, _width()) for x in lines)
        super().__init__(allow_abbrev=False, formatter_class=_Help, **settings)

    def print_help(self, file=None) -> None:
        """Print the help; unlike argparse, do not hide that it cannot be written."""
        print(self.format_help(), end="", file=file)

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(f"{message.replace('argument ', '', 1)}; see '{self.prog} --help'")


class _Help(argparse.RawDescriptionHelpFormatter):
    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=28, width=_width())


def _width() -> int:
    """Of a line of help: as a narrow terminal is, less argparse's own margin; elsewhere, as in a pipe, `_HELP`."""
    return min(shutil.get_terminal_size((_HELP + 2, 24)).columns - 2, _HELP)


def attach_values(arguments: list[str]) -> list[str]:
    """Write `--gravity VALUE` as `--gravity=VALUE`, so that the value may begin with a minus sign.

    >>> attach_values(["log.csv", "--gravity", "-1,0,-9.7", "--json"])
    ['log.csv', '--gravity=-1,0,-9.7', '--json']
    """
    out: list[str] = []
    for argument in arguments:
        if out and out[-1] in _SIGNED and not argument.startswith("--"):
            out[-1] += f"={argument}"
        else:
            out.append(argument)
    return out
