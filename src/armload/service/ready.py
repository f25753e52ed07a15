"""What a spare process does before it is needed: all that an arm's process would spend its first second on."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from armload.arms import arm
from armload.devices import Reader
from armload.devices.reader import columns_of
from armload.online import OnlineIdentifier

_SAMPLES, _STEP = 200, 0.005  # [s] between samples of a motion that nobody makes: a second of it, with two solutions
_SWING, _OMEGA = 0.2, 5.0  # [rad], [rad/s]


def ready(kinds: Iterable[dict[str, Any]]) -> list[Reader]:
    """Import, load and compute once what an arm of each kind needs.

    Args:
        kinds: {"robot": …, "frame": …, "method": …} each, as in `ArmSettings`.

    Returns:
        A reader that waits for its order, for each number of joints.
    """
    readers: dict[int, Reader] = {}
    for kind in kinds:
        made = arm(kind["robot"], kind["frame"])
        if made.n not in readers:
            readers[made.n] = Reader(columns_of(made.n))
        middle = np.clip(np.zeros(made.n), made.limits.position_low + _SWING, made.limits.position_high - _SWING)
        identifier = OnlineIdentifier(made, method=kind["method"])
        try:
            for k in range(_SAMPLES):
                t = _STEP * k
                swing = _SWING * np.sin(_OMEGA * t + np.arange(made.n))
                speed = _SWING * _OMEGA * np.cos(_OMEGA * t + np.arange(made.n))
                identifier.update(t, middle + swing, speed, made.torque(middle + swing))
        finally:
            identifier.close()
    return list(readers.values())
