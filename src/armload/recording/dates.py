"""Times that are written as dates: cells such as `2026-03-02 14:05:09.123456+01:00`, or a column of that type."""

from __future__ import annotations

import re
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from armload.errors import RecordingError

# Nanoseconds since 1970 in 64 bits reach from September 1677 to April 2262: these are the whole years between.
FIRST_YEAR, LAST_YEAR = 1678, 2261
EXPECTED = f"a date of the years {FIRST_YEAR} to {LAST_YEAR} such as 2026-03-02T14:05:09.123Z"
_DATE = re.compile(
    r"([0-9]{4}-[0-9]{2}-[0-9]{2}[T ][0-9]{2}:[0-9]{2}:[0-9]{2})(?:[.,]([0-9]{1,9}))?(.*)", re.IGNORECASE
)


def nanoseconds(cell: str) -> int | None:
    """Time since 1970 [ns] of a date (ISO 8601), exactly; without a zone it is UTC. None: it is none of these years.

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
    if not FIRST_YEAR <= date.year <= LAST_YEAR:
        return None
    date = date.replace(tzinfo=date.tzinfo or UTC)
    return round(date.timestamp()) * 1_000_000_000 + int((found[2] or "").ljust(9, "0"))


def nanoseconds_of(dates: NDArray, what: str) -> NDArray[np.int64]:
    """Time since 1970 [ns] of dates (N,) of NumPy's own type; what: they are, in a message.

    Raises:
        RecordingError: one is of another year (`FIRST_YEAR` to `LAST_YEAR`), or is none.
    """
    years = dates.astype("datetime64[Y]").astype(np.int64) + 1970
    if (other := np.flatnonzero((years < FIRST_YEAR) | (years > LAST_YEAR))).size:
        raise RecordingError(f"{what}, row {other[0]}, is {dates[other[0]]}: expected {EXPECTED}")
    return dates.astype("datetime64[ns]").astype(np.int64)
