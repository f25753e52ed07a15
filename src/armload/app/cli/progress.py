"""How far a long command is: a bar on a terminal, now and then a line elsewhere, both with the time that is left."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armload.app.cli.printing import counted, print_note

if TYPE_CHECKING:
    from armload.ensembles.progress import Progress, Report

_EVERY = 10.0  # [s] between two lines
_STEPS = {"trees": "tree", "networks": "epoch"}  # by the label of a training


@contextmanager
def progress_shown(what: str, then: str = "") -> Iterator[Callable[[int, int], None]]:
    """Called as show(done, total), again and again.

    Args:
        what: is counted, such as "log".
        then: what is done once all are.
    """
    if not sys.stderr.isatty():
        yield _Lines(what, then)
        return
    from armload.ensembles.progress import Progress, reporter

    with reporter(True) as report:
        yield lambda done, total: report(Progress(f"{what}s", done, total, "" if done < total else then))


def training_progress() -> bool | Report:
    """What shows the training of an ensemble in the same way; `fit(…, progress=…)` takes it."""
    if sys.stderr.isatty():
        return True
    lines: dict[str, _Lines] = {}

    def show(at: Progress) -> None:
        if at.done == 1 or at.label not in lines:  # each stage begins anew
            lines[at.label] = _Lines(_STEPS.get(at.label, "step"))
        lines[at.label](at.done, at.total)

    return show


class _Lines:
    """Progress as lines on stderr: at the beginning, at the end and every now and then."""

    def __init__(self, what: str, then: str = "") -> None:
        self._what, self._then = what, then
        self._first: tuple[int, float] | None = None
        self._last = 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if done == total:
            print_note(counted(total, self._what) + (f"; {self._then}" if self._then else ""))
        elif self._first is None or now - self._last >= _EVERY:
            print_note(f"{done} of {counted(total, self._what)}{self._left(done, total, now)}")
            self._last = now
        self._first = self._first or (done, now)

    def _left(self, done: int, total: int, now: float) -> str:
        """How long the rest takes at the pace since the first call: what was read back does not count."""
        if self._first is None or done <= self._first[0]:
            return ""
        seconds = (now - self._first[1]) * (total - done) / (done - self._first[0])
        return f", about {seconds / 60:.0f} min left" if seconds >= 90 else f", about {seconds:.0f} s left"
