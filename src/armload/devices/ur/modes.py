"""What a UR arm says of itself that keeps it from following: its robot mode, its safety mode and its speed slider.

The numbers are those of RTDE ("Real-Time Data Exchange (RTDE) Guide": `robot_mode`, `safety_mode`,
`target_speed_fraction`).
"""

from __future__ import annotations

from typing import Any

FIELDS = ("robot_mode", "safety_mode", "target_speed_fraction")  # what `hindrance` reads
_RUNNING = 7  # robot mode of an arm that is switched on, its brakes released
_MODES = {
    -1: "without a controller",
    0: "disconnected",
    1: "waiting for its safety settings to be confirmed",
    2: "booting",
    3: "switched off",
    4: "switched on, but not started",
    5: "held by its brakes",
    6: "in backdrive",
    8: "updating its firmware",
}
_SAFE = (1, 2)  # safety modes in which a program moves the arm: normal and reduced
_STOPPED = {
    3: "a protective stop",
    4: "recovery mode",
    5: "a safeguard stop",
    6: "a system emergency stop",
    7: "an emergency stop",
    8: "a safety violation",
    9: "a safety fault",
}
_FULL = 0.999  # of the speed slider: 100 %, but for rounding


def hindrance(client: Any) -> str | None:
    """Why the arm would not follow its targets; None: nothing is said.

    Args:
        client: ur-rtde's receiving side, which gets `FIELDS`.
    """
    mode, safety, slider = client.getRobotMode(), client.getSafetyMode(), client.getTargetSpeedFraction()
    if safety not in _SAFE:
        return f"it is in {_STOPPED.get(safety, f'safety mode {safety}')}; end that on its pendant"
    if mode != _RUNNING:
        return f"it is {_MODES.get(mode, f'in robot mode {mode}')}; switch it on, and release its brakes"
    if not slider >= _FULL:
        return f"its speed slider is at {100.0 * slider:.0f} %; set it to 100 % on its pendant"
    return None
