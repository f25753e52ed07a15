"""Whether two descriptions are of the same arm, whatever the names in them; and which joints of a log are the arm's."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms.facts import ARMS, ArmFacts
from armload.arms.model import Arm
from armload.errors import ArmError
from armload.inertia import InertialParameters

_TURN = 0.3  # [rad, m] of the first joint, which shows its axis


def link_fingerprint(arm: Arm) -> str:
    """SHA-256 of an arm's link parameters and joint geometry, whatever the pose of its base."""
    q = np.linspace(-0.5, 0.7, arm.n)
    R, p = _poses(arm, q)
    turned_R, turned_p = _poses(arm, q + _TURN * np.eye(arm.n)[0])
    digest = hashlib.sha256((np.round(arm.link_parameters, 6) + 0.0).tobytes())
    for part in (
        R[0].T @ R,  # as seen from the first moving link
        (p - p[0]) @ R[0],
        R[0].T @ turned_R[0],
        (turned_p[0] - p[0]) @ R[0],
    ):
        digest.update((np.round(part, 6) + 0.0).tobytes())
    return digest.hexdigest()


def prefixed_frame(arm: Arm, frame: str) -> str | None:
    """What an arm calls a frame that moves with its payload's; None: there is none, or there are several.

    By this name, with a prefix, or, of a built-in arm's flange, with such a flange's ending. What another arm of the
    file calls so is not meant.
    """
    endings = (frame, *(facts.flange_ending for facts in ARMS.values() if facts.flange == frame))
    if frame in arm.fixed_frames:
        return frame
    found = ([name for name in arm.fixed_frames if name.endswith(ending)] for ending in endings)
    return next((names[0] for names in found if len(names) == 1), None)


def flange_named(arm: Arm, sheets: Iterable[ArmFacts], beside: str | None = None) -> str | None:
    """What an arm calls its flange: a link that has the name of a sheet's, else one that ends as such flanges do.

    A tool behind the flange does not matter. None: there is none, or there are several.

    Args:
        sheets: of the arms whose flange it may be.
        beside: a frame that moves with the flange, where the file has several arms.
    """
    sheets = list(sheets)
    found = [name for name in arm.frames if name.endswith(tuple(facts.flange_ending for facts in sheets))]
    if beside in arm.frames:
        found = [name for name in found if _moved_alike(arm, name, str(beside))] or found
    exact = [name for name in found if name in {facts.flange for facts in sheets}]
    return next((names[0] for names in (exact, found) if len(names) == 1), None)


def from_frame(arm: Arm, frame: str | None) -> NDArray[np.float64]:
    """T (10, 10): phi about the arm's payload frame is T·phi about another frame behind its last joint; None: that one.

    Raises:
        ArmError: see `Arm.in_frame`.
    """
    return np.array([arm.in_frame(InertialParameters(unit, frame)).phi for unit in np.eye(10)]).T


def facts_of(arm: Arm) -> ArmFacts | None:
    """The sheet of an arm, whatever its file is called; None: it is no built-in one, or its frame cuts it short.

    >>> from armload.arms import arm
    >>> facts_of(arm("ur10e")).rated_payload
    12.5
    """
    facts = None if arm.known_as is None else ARMS.get(arm.known_as)
    return facts if facts is not None and facts.joints == arm.n else None


def names_among(arm: Arm, found: Collection[str]) -> tuple[str, ...] | None:
    """What the arm's joints (n,) are called among these names; None: one of them is missing.

    The names of its description hold first; then those under which its sheet knows its joints in logs of others.

    >>> from armload.arms import arm
    >>> names_among(arm("ur5e"), ["elbow_joint"]) is None
    True
    >>> names_among(arm("iiwa14"), [f"iiwa_joint_{k}" for k in range(7, 0, -1)])[0]
    'iiwa_joint_1'
    """
    facts = facts_of(arm)
    others = () if facts is None else facts.log_names or ()
    return next((names for names in (arm.joint_names, *others) if set(names) <= set(found)), None)


def _moved_alike(arm: Arm, one: str, other: str) -> bool:
    """Whether the same joints move two frames."""
    try:
        return (
            replace(arm, frame=one, attached=None).joint_names == replace(arm, frame=other, attached=None).joint_names
        )
    except ArmError:  # no joint moves one of them
        return False


def _poses(arm: Arm, q: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Orientations (n + 1, 3, 3) and origins (n + 1, 3) of the moving links and of the payload's frame."""
    R, p = arm.link_poses(q)
    frame_R, frame_p = arm.frame_pose(q)
    return np.concatenate([R[0], frame_R]), np.concatenate([p[0], frame_p])
