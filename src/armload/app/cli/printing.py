"""How answers look in a terminal: tables with units on stdout, notes and progress on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

    from armload.identification import Identification
    from armload.lab.evaluation import Table


def print_json(value: dict[str, Any]) -> None:
    """One JSON object on one line; a number that is not finite is a bug and raises ValueError."""
    print(json.dumps(value, allow_nan=False))


def finite(value: Any) -> Any:
    """Numbers, however nested in dictionaries and lists, with null for what is not finite."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_note(text: str) -> None:
    """One line on stderr, so that stdout holds the answer only."""
    print(f"armload: {' '.join(text.split())}", file=sys.stderr)


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

    return Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 180)


def print_table(result: Table) -> None:
    """A table of the evaluation, baselines set apart, and below it what it rests on."""
    rows = table(result.title, *result.columns)
    for k, cells in enumerate(result.rows):
        rows.add_row(*cells, end_section=k + 1 in result.baselines and k not in result.baselines)
    out = console()
    out.print(rows)
    out.print(result.note, markup=False)


def print_identification(result: Identification) -> None:
    """The ten parameters with their intervals, the body they make, and why this method was taken."""
    from armload.inertia import NAMES, UNITS

    out = console()
    rows = table(
        f"{result.robot}: payload about {result.frame}, relative to the {result.relative_to}",
        "parameter",
        "unit",
        "value",
        "95 % low",
        "95 % high",
        "",
        left=2,
    )
    for name, unit, value, low, high, known in zip(
        NAMES, UNITS, result.phi, result.phi_low, result.phi_high, result.determined, strict=True
    ):
        rows.add_row(name, unit, f"{value:+.5f}", f"{low:+.5f}", f"{high:+.5f}", "" if known else "undetermined")
    out.print(rows)
    com = ", ".join(f"{1000 * x:+.1f}" for x in result.com)
    moments = ", ".join(f"{result.inertia_com[k][k]:.6f}" for k in range(3))
    lines = [f"mass {result.mass:.4f} kg, centre of mass ({com}) mm"]
    lines.append(f"inertia about the centre of mass (Ixx, Iyy, Izz) = ({moments}) kg·m²")
    if not result.consistent:
        lines.append("no body can have these parameters")
    if not result.held:
        lines.append(result.why_not_held)
    lines.append(
        f"method {result.method}: {result.why}; intervals are {result.interval}; {result.n_samples} samples, "
        f"{result.duration:.2f} s"
    )
    out.print("\n".join(lines), markup=False)
