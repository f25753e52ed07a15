"""How long ago a tare was recorded, and by how much an arm may have changed since.

Offsets and friction are taken for a random walk: after d days they differ by √d daily deviations, 1 sigma
(`Correction.daily_std`).
"""

from __future__ import annotations

import re
from math import sqrt
from pathlib import Path

import numpy as np

from armload.errors import IdentificationError
from armload.posterior.drift import ALLOWED, SESSION
from armload.recording import Recording

DAY = 86400.0  # [s]
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": DAY, "w": 7 * DAY}


def drift_after(seconds: float) -> float:
    """By how many daily deviations an arm may differ after so many seconds; none in a session, at most `ALLOWED`."""
    return 0.0 if seconds <= SESSION else min(sqrt(seconds / DAY), ALLOWED)


def drift_since(tare: Recording, recording: Recording, age: float | None) -> tuple[float, tuple[str, ...]]:
    """By how many daily deviations the arm may differ from what it was at its tare, and what is to be said of it.

    Args:
        age: [s] as the user says; None: the logs' clocks tell, if both show the time of day. The files' dates change
            with every copy: where they are days apart, it is said and not believed.

    Raises:
        IdentificationError: an age that is no time.
    """
    if age is not None or (tare.date is not None and recording.date is not None):
        seconds, told = age_of(tare, recording.date, age)
        return drift_after(seconds), told
    dates = [_date(log) for log in (tare, recording)]
    if dates[0] is not None and dates[1] is not None and abs(dates[1] - dates[0]) > DAY:
        apart = in_words(abs(dates[1] - dates[0]))
        return 0.0, (f"the files' dates are {apart} apart: if the tare is that old, say --tare-age {apart}",)
    return 0.0, ()


def age_of(
    tare: Recording | None, began: float | None, age: float | None, since: float = 0.0
) -> tuple[float, tuple[str, ...]]:
    """How old the tare of a log or stream is [s], and what is to be said of it.

    Args:
        began: when the log or stream did [s since 1970]; None: nobody knows.
        age: [s] as the user says; None: the tare's clock tells, if it shows the time of day, else it is of the same
            session.
        since: [s] between that session, or when the user said so, and the beginning.

    Raises:
        IdentificationError: an age that is no time.
    """
    if age is not None:
        return checked_age(age) + since, ()
    if tare is None or tare.date is None or began is None:
        return since, ()
    seconds = abs(began - tare.date - tare.duration)
    told, when = f"is {in_words(seconds)} old", "since"
    if began < tare.date:
        told, when = f"was recorded {in_words(seconds)} after what it is the tare of", "in between"
    note = f"by the logs' clocks the tare {told}: offsets and friction may have changed {when}"
    return seconds, (note,) if drift_after(seconds) else ()


def checked_age(seconds: float) -> float:
    """An age that is a time.

    Raises:
        IdentificationError: it is none.
    """
    if isinstance(seconds, str):
        raise IdentificationError(f"the tare's age is {seconds!r}: expected seconds, such as 86400.0 for a day")
    if not (np.isfinite(seconds) and seconds >= 0.0):
        raise IdentificationError(f"the tare's age is {seconds:g} s: expected a time of 0 or more")
    return seconds


def seconds_of(text: str) -> float:
    """A time with its unit, in seconds.

    >>> seconds_of("1d"), seconds_of("90min")
    (86400.0, 5400.0)

    Raises:
        IdentificationError: it is no time.
    """
    found = re.fullmatch(r"\s*([0-9]*\.?[0-9]+(?:e[+-]?\d+)?)\s*(s|min|h|d|w)\s*", text)
    if found is None:
        raise IdentificationError(f"{text!r} is not a time: expected a number and s, min, h, d or w, such as 1d")
    return float(found[1]) * _UNITS[found[2]]


def in_words(seconds: float) -> str:
    """A time as `--tare-age` takes it, to three digits, without exponents.

    >>> [in_words(x) for x in (90.0, 5400.0, 36 * 3600.0, 3 * DAY, 1234 * DAY)]
    ['1.5min', '90min', '36h', '3d', '1230d']
    """
    for unit, size in (("d", DAY), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size or unit == "min":
            return f"{float(f'{seconds / size:.3g}'):.15g}{unit}"
    raise AssertionError


def _date(log: Recording) -> float | None:
    """When a log's file was last written [s since 1970]; None: it is no file."""
    try:
        return Path(log.source).stat().st_mtime
    except (OSError, ValueError):
        return None
