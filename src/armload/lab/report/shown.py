"""A table of text that says what it rests on; the command line, the report and the terminal draw it their own way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from armload.errors import ReportError
from armload.inertia import NAMES

# Errors are shown in g, g·m and g·m² (= 10⁻³ kg·m²): SI × 1000, so that no column is full of zeros.
SHOWN_SCALE = 1e3
SHOWN_UNITS = ("g", *["g·m"] * 3, *["g·m²"] * 6)
GROUPS = {"mass": slice(0, 1), "first moment": slice(1, 4), "inertia": slice(4, 10)}


def parameter_columns() -> tuple[str, ...]:
    """Column heads of the ten parameters with the units errors are shown in: "m [g]", …"""
    return tuple(f"{name} [{unit}]" for name, unit in zip(NAMES, SHOWN_UNITS, strict=True))


def short(value: float, digits: int = 3) -> str:
    """Three significant digits (or as many as asked for), but no exponent and nothing below a thousandth.

    >>> [short(x) for x in (12345.6, 12.345, 0.01234, 2.8e-5, float("inf"))]
    ['12346', '12.3', '0.0123', '0.000', '∞']
    """
    if not np.isfinite(value):
        return "–" if np.isnan(value) else "∞" if value > 0 else "-∞"
    if value == 0.0:
        return "0"
    if abs(value) < 1e-3:
        return f"{value:.3f}"
    return f"{value:.0f}" if abs(value) >= 10**digits - 0.5 else f"{value:.{digits}g}"


@dataclass(frozen=True)
class Table:
    """Rows of text under column heads; iterating gives the rows.

    title: what is shown. columns: heads, units included. rows: cells. note: what it rests on (split, seeds, spread).
    baselines: indices of the rows that are baselines, to be set apart. prose: of the columns that hold sentences.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str
    baselines: tuple[int, ...] = ()
    prose: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ReportError(f"table {self.title!r} has rows that do not fit its {len(self.columns)} columns")

    def __iter__(self) -> Iterator[tuple[str, ...]]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __str__(self) -> str:
        lines = [self.columns, *self.rows]
        widths = [max(len(row[k]) for row in lines) for k in range(len(self.columns))]
        text = ["  ".join([row[0].ljust(widths[0]), *_right(row[1:], widths[1:])]).rstrip() for row in lines]
        rule = "-" * max(len(line) for line in text)
        return "\n".join([self.title, rule, text[0], rule, *text[1:], rule, self.note])


def _right(cells: tuple[str, ...], widths: list[int]) -> list[str]:
    return [cell.rjust(width) for cell, width in zip(cells, widths, strict=True)]
