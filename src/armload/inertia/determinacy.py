"""What a log itself tells, as against what was known before: one rule for answers, bounds and live estimates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Z95 = 1.959963984540054  # half-width of a normal 95 % interval, in standard deviations
SHRINK = 3.0  # a parameter counts as determined if its half-width shrinks at least so much
# for a method without a prior: 95 % half-width below 50 g, 5 g·m, 5e-3 kg·m²
SMALL = np.array([0.05] + [0.005] * 3 + [0.005] * 6)
HELD = 3.0  # standard deviations of mass above zero before something counts as held
LIGHTEST_HELD = 1e-3  # [kg] less is nothing: a log that is compared with itself leaves so much of rounding


def determined(
    std: NDArray[np.float64],
    before: NDArray[np.float64] | None,
    alone: NDArray[np.float64] | None = None,
    weak: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Which parameters (10,) the data determine.

    Args:
        std: standard deviation of the estimate (10,).
        before: the same before the data; None: the method has no prior.
        alone: standard deviation without a learned prior, of a method that has one: a family's bodies are alike, what
            follows from the mass alone the log has not told. weak: standard deviation before, for `alone`.
    """
    out = Z95 * std <= SMALL if before is None else std <= before / SHRINK
    if alone is not None and weak is not None:
        out = out & (alone <= weak / SHRINK)
    return out


def held(mass: float, std: float, determined: bool) -> bool:
    """Whether anything is there at all, by its mass [kg] and the standard deviation of it."""
    return bool(determined and mass > max(HELD * std, LIGHTEST_HELD))
