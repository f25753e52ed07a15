"""The base mounted another way than given: on a wall, on a ceiling, leaning by half a right angle.

Such a log looks like a wrong one of many kinds: joints exchanged, a sign turned, gravity taken out, another robot. Each
of these is named only where no other mounting explains the log better. A base that leans by less is found by the
estimate itself (`posterior.tilt`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError
from armload.identification.thresholds import MODEL_MISFIT, OTHER_FORM
from armload.identification.torque_scale import FEW_WINDOWS, TorqueScale, torque_scale
from armload.recording import Recording


def better_gravity(
    recording: Recording, arm: Arm, better: Callable[[TorqueScale], bool], gears: bool = False
) -> NDArray[np.float64] | None:
    """Gravity (3,) [m/s²] in the axes of the base that explains a log best, of those that explain it well enough.

    It is tried along each axis of the base and along the diagonals between them, 26 ways.

    Args:
        recording, arm: the log and what it should be of. better: whether such a fit, of `FEW_WINDOWS` windows, is well
            enough. gears: whether viscous friction and rotors may be in tau, too (`torque_scale`).
    """
    size = float(np.linalg.norm(arm.gravity))
    ways = [size * np.array(way) / np.linalg.norm(way) for way in product((-1, 0, 1), repeat=3) if any(way)]
    fits = [(torque_scale(recording, replace(arm, gravity=way), most=FEW_WINDOWS, gears=gears), way) for way in ways]
    found = [(fit.evidence, way) for fit, way in fits if fit is not None and not fit.is_wrong and better(fit)]
    return max(found, key=lambda pair: pair[0])[1] if found else None


def likelier_gravity(
    recording: Recording, arm: Arm, account: Callable[..., TorqueScale | None]
) -> NDArray[np.float64] | None:
    """Gravity (3,) that explains a log as a sound one, and far better than another account of it does; None: none does.

    Torque of the motors' side is asked with viscous friction and rotors among the unknowns: they would look like
    gravity that pulls another way.

    Args:
        recording, arm: the log and what it should be of. account: its fit, `torque_scale` with `most` and `gears` left
            open; the best of any share of the arm's own torque counts.
    """
    other = account(most=FEW_WINDOWS, gears=arm.motor_torque)
    if other is None:
        return None
    enough = other.best + OTHER_FORM
    return better_gravity(
        recording, arm, lambda fit: fit.misfit <= MODEL_MISFIT and fit.evidence > enough, arm.motor_torque
    )


def check_mounted_as_given(recording: Recording, arm: Arm, way: NDArray[np.float64] | None) -> None:
    """Refuse a log that gravity `way` explains better than what was given, if there is such a one.

    Raises:
        RecordingError: there is; the sentence says about which gravity that is.
    """
    if way is not None:
        raise RecordingError(
            f"{recording.source}: tau fits {arm.name} far better {_about(way, arm)}: expected the base mounted as "
            "given; say how it is (--gravity), or check the order and the signs of the joints"
        )


def mounted_otherwise(way: NDArray[np.float64], arm: Arm) -> str:
    """The note of an answer that such a base explains better."""
    return (
        f"the torques fit {arm.name} far better {_about(way, arm)}: if the base is mounted so, say so (--gravity), "
        "as the answer is of the gravity that was given"
    )


def _about(way: NDArray[np.float64], arm: Arm) -> str:
    return f"with gravity about {_written(way)} m/s² in the axes of the base than with {_written(arm.gravity)}"


def _written(gravity: Iterable[float]) -> str:
    """As `--gravity` takes it."""
    return ",".join(f"{round(x, 2) + 0.0:g}" for x in gravity)
