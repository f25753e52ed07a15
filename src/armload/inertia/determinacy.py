"""What a log itself tells, as against what was known before: one rule for answers, bounds and live estimates."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Z95 = 1.959963984540054  # half-width of a normal 95 % interval, in standard deviations
# times that a parameter's half-width must shrink to count as determined: nine tenths of what is known then come from
# the log. A convention (test_undetermined_parameters_carry_the_interval_of_what_was_known_before)
SHRINK = 3.0
# [standard deviations] of mass above zero before something counts as held: one empty arm in a thousand holds something
# (test_an_empty_arm_holds_nothing_and_a_light_payload_is_held_with_a_tare)
HELD = 3.0
# of `held_probability`, below which what was held is held no more: the most that a log which just determines the mass
# says of a mass of zero (test_nothing_is_held_any_more_where_a_log_determines_a_mass_of_zero)
DROPPED = 1.0 / (1.0 + SHRINK)
LIGHTEST_HELD = 1e-3  # [kg] less is nothing: a log that is compared with itself leaves so much of rounding


def determined(
    std: NDArray[np.float64],
    before: NDArray[np.float64],
    unlearned: NDArray[np.float64] | None = None,
    weak: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Which parameters (10,) the data determine.

    Args:
        std: standard deviation of the estimate (10,).
        before: the same before the data; of a method without a prior, what anybody knows of a payload.
        unlearned: standard deviation without the learned prior, of a method that has one: bodies of a family are alike,
            so that such a prior derives the rest from the mass, which is no evidence of the log. weak: standard
            deviation before the data, for `unlearned`.
    """
    out = std <= before / SHRINK
    if unlearned is not None and weak is not None:
        out = out & (unlearned <= weak / SHRINK)
    return out


def held(mass: float, std: float, determined: bool) -> bool:
    """Whether anything is there at all, by its mass [kg] and the standard deviation of it."""
    return bool(determined and mass > max(HELD * std, LIGHTEST_HELD))


def held_probability(mass: float, std: float, payloads: float) -> float:
    """Probability that anything is there, if that is as likely beforehand as that nothing is.

    What is there has a mass above zero, |x| of x ~ N(0, s²), so that with σ² = std², s² = payloads² and v² = σ² + s²
    the odds are 2·N(mass; 0, v²)·Φ(mass·s/(σ·v)) to N(mass; 0, σ²). A mass below zero says no more than zero does.

    Args:
        mass: the estimate [kg]. std: its standard deviation [kg]. payloads: how heavy payloads are beforehand [kg].
    """
    mass, all_of_it = max(mass, 0.0), math.hypot(std, payloads)
    room = math.log(std / all_of_it) + 0.5 * mass**2 * (std**-2 - all_of_it**-2)
    room += math.log(math.erfc(-mass * payloads / (math.sqrt(2.0) * std * all_of_it)))  # 2·Φ(x) = erfc(−x/√2)
    return 1.0 / (1.0 + math.exp(-min(max(room, -700.0), 700.0)))
