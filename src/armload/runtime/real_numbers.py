"""Arrays of real numbers, of whatever is given as such: what numpy would cast with a loss is refused."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# kinds of arrays that numpy makes floats of and that are none: complex numbers, dates, time spans, records
_OTHERS = "cMmV"


def reals(values: ArrayLike) -> NDArray[np.float64]:
    """The values as an array of floats; an array of floats itself is not copied.

    Raises:
        ValueError: they are not real numbers, or not as many in each row, or some are masked; its text is what was
            found, as the object of a sentence.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    try:
        given = np.asanyarray(values)
        if np.ma.is_masked(given):
            found = "an array with masked values"
        elif given.dtype.kind in _OTHERS:
            found = f"{given.dtype}"
        else:
            return np.asarray(given, dtype=float)
    except OverflowError:
        found = "a number that is too large"
    except (TypeError, ValueError):
        found = f"a {type(values).__name__} of something else"
    raise ValueError(found)


def own_reals(values: ArrayLike, what: str, error: type[Exception]) -> NDArray[np.float64]:
    """A copy of the values as an array of floats that nobody can write to; `what` is what a sentence calls them.

    Raises:
        error: they are not real numbers.
    """
    try:
        own = np.array(reals(values), order="C")
    except ValueError as found:
        raise error(f"{what} is {found}: expected real numbers, as many in each row and none masked") from None
    own.setflags(write=False)
    return own
