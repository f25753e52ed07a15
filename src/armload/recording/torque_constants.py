"""Torque per motor current, from what a controller itself wants of both.

A Universal Robots controller logs beside the measured current the moment that its model asks of each joint, and the
current that it expects for it (RTDE: `target_moment`, `target_current`). With friction as such a model has it,

    i* = tau*/K + a·sign(dq) + b·dq,

K [N·m/A] is the slope's inverse. Both are the controller's own: the line fits nearly exactly, or something else is in
the current, and then the joint is refused. A joint that neither moves nor carries anything, such as the base of an arm
at rest, tells nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.errors import RecordingError

# [rad/s] below which a joint rests, and above which friction has the sign of its velocity; between them it is left out
_RESTS, _TURNS = 1e-3, 2e-2
# relative: what the line may leave of the current, and the standard deviation of its slope. Intervals allow for a scale
# that is off by as much (`Correction.gain_std`)
_FITS, _KNOWN = 0.02, 0.005


def controller_constants(
    moment: NDArray[np.float64], current: NDArray[np.float64], dq: NDArray[np.float64], where: str
) -> NDArray[np.float64]:
    """Joint torque per motor current (n,) [N·m/A].

    Args:
        moment, current: (N, n) that the controller wants [N·m, A]. dq: (N, n) velocity [rad/s]. where: the file, for
            messages.

    Raises:
        RecordingError: of some joints the log does not tell it.
    """
    found = [_slope(moment[:, j], current[:, j], dq[:, j]) for j in range(moment.shape[1])]
    unknown = [j + 1 for j, slope in enumerate(found) if slope is None]
    if unknown:
        raise RecordingError(
            f"{where}: the torque per motor current of joint(s) {', '.join(map(str, unknown))} does not follow from "
            "target_moment and target_current: expected them to lie on one line, over moments that differ; log while "
            "every joint moves, or give the constants, which a note lists where another log of this arm tells them, "
            f'with --columns "torque_constants=K1 … K{len(found)}"'
        )
    return 1.0 / np.array(found, dtype=float)


def _slope(moment: NDArray[np.float64], current: NDArray[np.float64], dq: NDArray[np.float64]) -> float | None:
    """1/K [A/(N·m)] of one joint; None: the log does not tell it."""
    speed = np.abs(dq)
    clear = ((speed < _RESTS) | (speed > _TURNS)) & np.isfinite(moment) & np.isfinite(current)
    columns = [moment, np.sign(dq) * (speed > _TURNS), dq * (speed > _TURNS)]
    X = np.column_stack([column[clear] for column in columns])
    X, i = X[:, np.ptp(X, axis=0) > 0.0] if len(X) else X, current[clear]
    if len(X) <= X.shape[1] or not X.shape[1] or np.ptp(moment[clear]) == 0.0:
        return _ratio(moment[clear], i)
    constants, *_ = np.linalg.lstsq(X, i, rcond=None)
    left = float(np.mean((i - X @ constants) ** 2))
    std = np.sqrt(left * np.linalg.pinv(X.T @ X)[0, 0])
    size = float(np.mean(i**2))
    usable = constants[0] > 0.0 and left <= _FITS**2 * size and std <= _KNOWN * constants[0]
    return float(constants[0]) if usable else None


def _ratio(moment: NDArray[np.float64], current: NDArray[np.float64]) -> float | None:
    """1/K of a joint that carries the same throughout."""
    if not len(moment) or not moment.any():
        return None
    ratio = float(current @ moment / (moment @ moment))
    return ratio if ratio > 0.0 and np.mean((current - ratio * moment) ** 2) <= _FITS**2 * np.mean(current**2) else None
