"""What the scripts of this folder share: their options, the file of a result with what it rests on, tables on pages."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armload.lab.experiment import provenance, write_json
from armload.runtime.atomic import replacing

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"


def options(about: str | None, **defaults: Any) -> argparse.Namespace:
    """The options of a script, --name for each default, whose type it takes.

    False is a flag that is not set; a tuple stands for as many values as it has.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in defaults.items():
        flag = f"--{name.replace('_', '-')}"
        if default is False:
            parser.add_argument(flag, action="store_true")
        elif isinstance(default, tuple):
            parser.add_argument(flag, type=type(default[0]), nargs=len(default), default=default)
        else:
            parser.add_argument(flag, type=type(default), default=default, help=f"(default: {default})")
    return parser.parse_args()


def cases_of(name: str, every: Iterable[str], named: str, between: str = ";") -> tuple[list[str], dict[str, Any]]:
    """The cases that are to be measured, and what results/NAME.json holds of those that are not.

    Args:
        every: case there is. named: some of them, `between` one and the next; empty: all, and nothing is kept.
    """
    chosen, file = set(named.split(between)), RESULTS / f"{name}.json"
    kept = json.loads(file.read_text(encoding="utf-8"))["cases"] if named and file.exists() else {}
    return [case for case in every if not named or case in chosen], kept


PLACES = ("--out", "--cells", "--work")  # options that name a folder on this machine


def write(name: str, result: dict[str, Any], indent: int | None = 1) -> None:
    """Write results/NAME.json, with what it rests on: the command, but for where it worked. No indent: one line."""
    typed = [word for k, word in enumerate(sys.argv) if word not in PLACES and sys.argv[k - 1] not in PLACES]
    command = " ".join(["python", f"benchmarks/{Path(typed[0]).name}", *typed[1:]])
    content = provenance(command) | result
    path = write_json(RESULTS / f"{name}.json", content, indent)
    if indent is not None:
        print(json.dumps(content, indent=indent))
    print(f"wrote {path.relative_to(ROOT)}")


def say(text: str) -> None:
    """What is being done, at once."""
    print(text, flush=True)


def mean_and_spread(values: Any) -> list[float]:
    """Mean and standard deviation; 0 for a single value."""
    values = np.asarray(values, dtype=float)
    return [float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else 0.0]


def rounded(mean: float, spread: float) -> str:
    """Mean ± spread, to two digits of the spread."""
    places = 2 if spread <= 0.0 else max(0, 1 - int(np.floor(np.log10(spread))))
    return f"{mean:.{places}f} ± {spread:.{places}f}"


def two_digits(x: float) -> str:
    """To two digits, without an exponent: 270, 1.3, 0.85."""
    return f"{float(f'{x:.2g}'):g}"


def markdown_table(columns: Sequence[str], align: str, rows: Sequence[Sequence[str]]) -> str:
    """Rows as Markdown; align: a letter for each column, l or r."""
    rule = "|" + "".join({"l": "---|", "r": "---:|"}[letter] for letter in align)
    first, *rest = (f"| {' | '.join(row)} |" for row in (columns, *rows))
    return "\n".join([first, rule, *rest])


def write_table(page: Path, name: str, text: str) -> None:
    """Put a table between its marks on a page."""
    marks = f"<!-- {name} -->", f"<!-- /{name} -->"
    old = page.read_text(encoding="utf-8")
    new, count = re.subn(
        f"{re.escape(marks[0])}.*?{re.escape(marks[1])}", f"{marks[0]}\n{text}\n{marks[1]}", old, flags=re.DOTALL
    )
    if count != 1:
        raise SystemExit(f"{page} has {count} places {marks[0]} … {marks[1]}: expected one")
    with replacing(page) as temporary:
        temporary.write_text(new, encoding="utf-8")
