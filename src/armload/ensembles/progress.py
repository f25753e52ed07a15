"""Progress of a long training, or of what it learns from, and a bar that shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple


class Progress(NamedTuple):
    """Where it stands: `done` of at most `total` steps (trees grown, epochs, or runs simulated), and a note."""

    label: str
    done: int
    total: int
    note: str = ""


Report = Callable[[Progress], None]


@contextmanager
def reporter(progress: bool | Report | None) -> Iterator[Report]:
    """The function that is told: silence (None, False), a bar on the standard error stream (True), or your own."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda _: None
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left:"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}"),
        )
        with Bar(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=300.0) as bar:
            tasks = {}

            def show(state: Progress) -> None:
                if state.label not in tasks:
                    tasks[state.label] = bar.add_task(state.label, total=state.total, note="")
                bar.update(tasks[state.label], completed=state.done, total=state.total, note=state.note)

            yield show
