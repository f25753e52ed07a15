"""How answers look in a terminal: tables with units on stdout, notes and progress on stderr."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from armload.app.cli.aside import Aside

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

    from armload.lab.evaluation import Table


def print_json(value: dict[str, Any]) -> None:
    """One JSON object on one line; a number that is not finite is a bug and raises ValueError."""
    print(json.dumps(value, allow_nan=False))


def write_json(path: str, value: dict[str, Any], indent: int | None = None) -> None:
    """One JSON object in a file that appears whole or not at all; UsageError where it cannot be written."""
    from armload.errors import UsageError
    from armload.runtime.atomic import replacing

    text = json.dumps(value, allow_nan=False, indent=indent) + "\n"
    try:
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(
            f"{path} cannot be written: {error.strerror or error}; name a file in a folder you can write to"
        ) from None


def counted(number: int, what: str) -> str:
    """A number of things.

    >>> counted(1, "log"), counted(2, "log")
    ('1 log', '2 logs')
    """
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


_aside: Aside[str] | None = None  # who writes the notes, where that is not whoever says them


def print_note(text: str) -> None:
    """One line on stderr, so that stdout holds the answer only; where it cannot be written, nothing ends for that."""
    (_write_note if _aside is None else _aside.put)(f"armload: {on_one_line(text)}")


def on_one_line(text: str) -> str:
    r"""A text as a terminal may show it: a name from a file that is nobody's friend must not colour, clear or forge.

    >>> print(on_one_line("log \x1b[2J.csv\nis none"))
    log \x1b[2J.csv is none
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in " ".join(text.split()))


def _write_note(line: str) -> None:
    with suppress(OSError):  # a log on a full disk
        print(line, file=sys.stderr, flush=True)


@contextmanager
def notes_aside() -> Iterator[None]:
    """Within, nobody who says a note waits for whoever reads stderr: a terminal that is held (Ctrl-S), a full pipe."""
    global _aside
    aside = _aside = Aside(_write_note)
    try:
        yield
    finally:
        _aside = None
        aside.close(1.0)


def drop_unwritten() -> None:
    """Drop what stdout still holds if it cannot be written, so that nothing tries to once more."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Show what is being done on a terminal; nothing where stderr is a file."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True).status(what) as status:
        yield lambda text: status.update(text)


def table(title: str, *columns: str, left: int = 1) -> RichTable:
    """A plain table: the first `left` columns left-aligned, the others right."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table as RichTable

    made = RichTable(title=escape(title), title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    for k, name in enumerate(columns):
        made.add_column(escape(name.replace(" [", "\n[")), justify="left" if k < left else "right")
    return made


def console() -> Console:
    """Where answers go; wide enough for any table if it is not a terminal."""
    from rich.console import Console

    class Answers(Console):
        def on_broken_pipe(self) -> None:
            """Leave it to the command's end: rich would end it with the exit code of a bug."""
            raise BrokenPipeError

    return Answers(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 180)


def print_table(result: Table) -> None:
    """A table of the evaluation, baselines set apart, and below it what it rests on."""
    from rich.markup import escape

    rows = table(result.title, *result.columns)
    for k, cells in enumerate(result.rows):
        rows.add_row(*map(escape, cells), end_section=k + 1 in result.baselines and k not in result.baselines)
    out = console()
    out.print(rows)
    out.print(result.note, markup=False)
