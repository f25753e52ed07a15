"""With how many decimals a number is shown."""

from __future__ import annotations

import math

_MOST = 6


def decimals(size: float) -> int:
    """How many show two digits of a size, in its unit: of an uncertainty, or of the largest of several values.

    Six at most, as where the size is 0 or no number; none where it is infinite.

    >>> decimals(0.15), decimals(0.0042), decimals(7.5), decimals(0.0)
    (2, 4, 1, 6)
    """
    if not size > 0.0:
        return _MOST
    return 0 if size == math.inf else min(max(1 - math.floor(math.log10(size)), 0), _MOST)
