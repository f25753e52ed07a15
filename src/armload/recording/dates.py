"""Times that are written as dates: cells such as `2026-03-02 14:05:09.123456+01:00`, or a column of that type."""

from __future__ import annotations

import re
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

_DATE = re.compile(
    r"([0-9]{4}-[0-9]{2}-[0-9]{2}[T ][0-9]{2}:[0-9]{2}:[0-9]{2})(?:[.,]([0-9]{1,9}))?(.*)", re.IGNORECASE
)


def nanoseconds(cell: str) -> int | None:
    """Time since 1970 [ns] of a date (ISO 8601), exactly; without a zone it is UTC. None: it is no date.

    >>> nanoseconds("1970-01-01T01:00:00.000000001+01:00")
    1
    """
    found = _DATE.fullmatch(cell.strip())
    if found is None:
        return None
    try:
        date = datetime.fromisoformat(found[1] + found[3].strip().upper())
    except ValueError:
        return None
    date = date.replace(tzinfo=date.tzinfo or UTC)
    return round(date.timestamp()) * 1_000_000_000 + int((found[2] or "").ljust(9, "0"))


def nanoseconds_of(dates: NDArray) -> NDArray[np.int64]:
    """Time since 1970 [ns] of dates (N,) of NumPy's own type."""
    return dates.astype("datetime64[ns]").astype(np.int64)
