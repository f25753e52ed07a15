"""How seldom a chi-squared variable goes beyond a value: in closed form, as its degrees of freedom are whole."""

from __future__ import annotations

import math


def beyond(x: float, k: int) -> float:
    """The probability that a chi-squared variable of k degrees of freedom exceeds x.

    With h = x/2 it is exp(-h) · Σ h^i / i! over 0 ≤ i < k/2 for an even k, and for an odd one
    erfc(√h) + exp(-h) · Σ h^(i+1/2) / Γ(i+3/2) over 0 ≤ i < (k-1)/2.

    Args:
        x: the variable's value, as it is squared already. k: 1 or more.

    >>> round(beyond(7.814727903251179, 3), 12)
    0.05
    """
    half, odd = max(x, 0.0) / 2.0, k % 2
    total, term = 0.0, math.exp(-half)
    if odd:
        total, term = math.erfc(math.sqrt(half)), term * math.sqrt(half) / math.gamma(1.5)
    for i in range(k // 2):
        total += term
        term *= half / (i + 1.0 + odd / 2.0)
    return min(total, 1.0)
