"""The shortest designed motion that reaches an accuracy on nine in ten arms, by its bound and what that comes to."""

from __future__ import annotations

from typing import Any

import numpy as np

from armload.errors import MotionError
from armload.excitation.accuracy import Accuracy
from armload.excitation.constraints import LONGEST, SHORTEST, Constraints
from armload.excitation.criterion import Criterion
from armload.excitation.optimisation import Design, design_motion
from armload.excitation.promise import of_gain, of_gain_in_words

_FIRST = 2.0  # [s] looked at first
_DESIGNS = 6  # at most
_CLOSE = 0.05  # of the time: shorter is not looked for any more


def design_until(
    constraints: Constraints,
    criterion: Criterion,
    accuracy: Accuracy,
    *,
    tare_time: float | None = None,
    **settings: Any,
) -> Design:
    """The shortest motion found whose promised half-widths are within the accuracy, to 5 % of its time.

    Half-widths fall with a power of the time; each design says where to look next. Arguments as of `design`.

    Raises:
        MotionError: as of `design`, or the accuracy is out of reach within a minute, or of any motion.
    """
    _check_gain(constraints, criterion, accuracy)
    low, high = SHORTEST, LONGEST
    best: Design | None = None
    seen: list[tuple[float, float]] = []  # log time, log of what is over
    time = _FIRST
    for _ in range(_DESIGNS):
        try:
            found = design_motion(constraints, criterion, time, tare_time=tare_time, **settings)
        except MotionError:
            if best is None:
                raise
            low, time = time, round(float(np.sqrt(time * high)), 2)  # too short for any motion
            if high <= low * (1.0 + _CLOSE):
                break
            continue
        over = accuracy.over(found.promised)
        seen.append((float(np.log(time)), float(np.log(over))))
        if over <= 1.0:
            best, high = found, time
        else:
            low = time
        if high <= low * (1.0 + _CLOSE) or low >= LONGEST or high <= SHORTEST:
            break
        if best is None and time * over > LONGEST:  # even if half-widths fell as 1/T
            break
        time = _next(seen, low, high, best is not None)
    if best is None:
        raise MotionError(
            f"the accuracy asked for is out of reach: after {time:.3g} s the half-widths that nine in "
            f"ten arms stay within are still {over:.3g} times too wide; "
            "allow a larger share or more joints, give --tare-time, or ask for less"
        )
    return best


def _check_gain(constraints: Constraints, criterion: Criterion, accuracy: Accuracy) -> None:
    """See that the torque's calibration leaves room for the accuracy.

    Raises:
        MotionError: it does not, with the payload of the range that it does for.
    """
    payload = constraints.payload
    assert payload is not None
    over = accuracy.over(of_gain(criterion, payload))
    if over >= 1.0:
        raise MotionError(
            f"the accuracy asked for is out of reach of any motion: {of_gain_in_words(criterion)}, which of payloads "
            f"up to {payload.mass:.3g} kg alone leaves {over:.3g} times as much; say how heavy the payload may be "
            f"(less than {payload.mass / over:.2g} kg would do), ask for less, or learn the gain with a known weight "
            "(armload profile --mass)"
        )


def _next(seen: list[tuple[float, float]], low: float, high: float, reached: bool) -> float:
    """Where the power law through the last two designs (slope −1 to begin with) meets the accuracy, a bit beyond."""
    (x, y), slope = seen[-1], -1.0
    if len(seen) > 1 and abs(x - seen[-2][0]) > 1e-3:
        slope = float(np.clip((y - seen[-2][1]) / (x - seen[-2][0]), -3.0, -0.3))
    guess = float(np.exp(x - y / slope)) * (1.0 + 0.4 * _CLOSE)
    if reached:  # within the bracket, not at its ends
        guess = float(np.clip(guess, low * (1.0 + 0.5 * _CLOSE), high / (1.0 + 0.5 * _CLOSE)))
    return round(float(np.clip(guess, SHORTEST, LONGEST)), 2)
