"""The axis of time of a survey's figures: dates, or the order of logs where not all say when they were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from armload.lab.report.style import whole
from armload.survey.rows import ANSWERED

# of dates, whose axis tells years, months, days, hours, minutes or seconds
_FORMS = ("%Y", "%Y-%m", "%m-%d", "%H:%M", "%H:%M", "%H:%M:%S")
_ROUND = ("%Y", "%Y-%m", "%m-%d", "%m-%d", "%H:%M", "%H:%M")  # the first of a year, of a month, …; midnight is a day


def are_dated(rows: Sequence[dict[str, Any]]) -> bool:
    """Whether all answered logs say when they were recorded: one axis cannot show days and the order of logs."""
    return all(row["date"] is not None for row in rows if row["status"] == ANSWERED)


def times_of(rows: Sequence[dict[str, Any]], dated: bool) -> np.ndarray:
    """When rows were recorded, to the millisecond, or their number where logs are not all dated."""
    if not dated:
        return np.arange(1.0, len(rows) + 1.0)
    return np.array([int(1e3 * row["date"]) for row in rows], dtype="datetime64[ms]")


def mark(ax: Any, x: np.ndarray, most: int) -> None:
    """Few dates on an axis, and short ones; of logs without dates, whole numbers."""
    if x.dtype.kind == "M":
        from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

        # asked for three ticks of two to three days it would have to take hours, too many for a panel, and warns of it
        ax.xaxis.set_major_locator(locator := AutoDateLocator(minticks=2, maxticks=most))
        ax.xaxis.set_major_formatter(
            ConciseDateFormatter(locator, formats=_FORMS, zero_formats=_ROUND, show_offset=False)
        )
    else:
        whole(ax.xaxis, most)


def time_label(rows: Sequence[dict[str, Any]], dated: bool, what: str = "logs") -> str:
    """What an axis of time says of itself: ticks have room for neither the year nor, within a day, the day.

    Args:
        rows: what is drawn. dated: by when it was recorded, or else in its order. what: is drawn.
    """
    if not dated:
        return f"{what} in order: not all logs say when they were recorded"
    days = [datetime.fromtimestamp(row["date"], UTC).strftime("%Y-%m-%d") for row in rows if row["status"] == ANSWERED]
    first, last = min(days), max(days)
    return f"date (UTC), {first}" if first == last else f"date (UTC), {first} to {last}"
