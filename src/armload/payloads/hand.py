"""The Franka Hand, the payload of the paper's benchmark."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from armload.arms import ARMS
from armload.errors import ArmError, PayloadError
from armload.inertia import InertialParameters
from armload.payloads.payload import Payload

if TYPE_CHECKING:
    from armload.arms import Arm

# Franka's published URDF of the hand: in the axes of panda_hand, inertia about the centre of mass.
MASS = 0.73  # [kg]
COM = (-0.01, 0.0, 0.03)  # [m]
INERTIA_COM = (1e-3, 2.5e-3, 1.7e-3)  # [kg·m²] diagonal
TURN = -np.pi / 4  # [rad] panda_hand about the z axis of panda_link8
HAND = "franka-hand"  # what the sheets of the arms it sits on call it


def fits(frame: str) -> bool:
    """Whether a frame is called as the flange of an arm that takes the hand, with whatever prefix."""
    return frame.endswith(_endings())


def franka_hand(flange: str = ARMS["panda"].flange) -> Payload:
    """The Franka Hand about the flange, in the flange's axes; `flange`: what the arm calls it (`hand_on`).

    The figures 0.73 kg, CoM (−0.01, 0, 0.03) m, inertia diag(1, 2.5, 1.7)·10⁻³ kg·m² about the CoM are those of the
    frame `panda_hand`, which shares the flange's origin and is turned −45° about its z axis. In `panda_link8` the CoM
    is therefore (−0.00707, +0.00707, 0.03) m and Ixy is not zero. Sources that give the same numbers "in the flange
    frame" differ from this by that turn.

    >>> franka_hand().parameters.com.round(5).tolist()
    [-0.00707, 0.00707, 0.03]

    Source: Franka's public robot descriptions (franka_description, hand; mounted with rpy = (0, 0, −π/4)).
    """
    in_hand = InertialParameters.from_com(MASS, COM, np.diag(INERTIA_COM), "panda_hand")
    c, s = np.cos(TURN), np.sin(TURN)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Payload("Franka Hand", in_hand.moved(rotation, np.zeros(3), flange))


def hand_on(arm: Arm) -> Payload:
    """The Franka Hand on an arm of Franka's, about whatever that calls its flange.

    >>> from armload.arms import arm
    >>> hand_on(arm("fr3")).parameters.frame
    'fr3_link8'

    Raises:
        PayloadError: the arm has no such flange, or several behind its last joint.
    """
    found = [name for name in arm.frames if fits(name) and _moves_with(arm, name)]
    if len(found) != 1:
        called = " or ".join(f"…{ending}" for ending in _endings())
        raise PayloadError(
            f"{arm.name} has {len(found) or 'no'} flange{'s' * (len(found) > 1)} of a Franka ({called}) for the "
            f"Franka Hand: describe the tool in a payload file about a frame of {arm.name}, such as {arm.frame!r}"
        )
    return franka_hand(found[0])


def _endings() -> tuple[str, ...]:
    return tuple(dict.fromkeys(facts.flange_ending for facts in ARMS.values() if facts.hand == HAND))


def _moves_with(arm: Arm, frame: str) -> bool:
    try:
        return replace(arm, frame=frame, attached=None).joint_names == arm.joint_names
    except ArmError:  # no joint moves it
        return False
